#include <CLI/CLI.hpp>
#include <filesystem>
#include <gtest/gtest.h>

#include "tests/unit/cycle/trained_folder.hpp"
#include "tools/commands.hpp"

namespace binpick::tools {
namespace {
struct Answer {
  int exit_status = 0;
  std::string out;
};
Answer check(const std::string& path, bool without_knowledge = false) {
  CLI::App app;
  Answer answer;
  add_check(app, answer.exit_status);
  testing::internal::CaptureStdout();
  std::vector<std::string> line{path, "check"};  // CLI11 takes them from the back
  if (without_knowledge) line.insert(line.begin(), "--without-knowledge");
  app.parse(line);
  answer.out = testing::internal::GetCapturedStdout();
  return answer;
}

TEST(Check, AGoodCellIsSummedUp) {
  daemon::TrainedFolder folder;
  folder.edit("state_dir = \"/var/lib/binpick\"", "state_dir = \"state\"");
  folder.save();
  const Answer answer = check(folder.path("cell.toml"));
  EXPECT_EQ(answer.exit_status, 0);
  EXPECT_EQ(answer.out, folder.path("cell.toml") +
                            ": good\n"
                            "  cell     demo\n"
                            "  plc      connects to 0.0.0.0:502 (role server), word order s7, poses as ur\n"
                            "  scanner  SICK LMS 400 at 192.168.0.1:2111, on the pivot: PowerCube module 12 on can0\n"
                            "  robot    connects to 0.0.0.0:5002, dialect ur\n"
                            "  supply   1 lattice box: 1000 x 800 x 500 mm, sweep -16 ... 16 deg, 34 deg/s\n"
                            "  part     1 track_link: 1 grasp\n");
}

TEST(Check, ARobotThatCarriesTheScannerIsSummedUpAsOne) {
  daemon::TrainedFolder folder;
  config::make_leuze(folder, "lps36");
  config::put_on_robot(folder, "kawasaki");
  folder.edit("state_dir = \"/var/lib/binpick\"", "state_dir = \"state\"");
  folder.edit("role = \"server\"", "role = \"client\"").edit("listen = \"0.0.0.0:502\"", "");
  folder.edit("address = \"\"", "address = \"192.168.0.10:502\"").edit("word_order = \"s7\"", "word_order = \"logix\"");
  ASSERT_EQ(folder.findings(), "");
  const Answer answer = check(folder.path("cell.toml"), true);
  EXPECT_EQ(answer.exit_status, 0);
  EXPECT_EQ(answer.out,
            folder.path("cell.toml") +
                ": good\n"
                "  cell     demo\n"
                "  plc      is asked at 192.168.0.10:502 (role client), word order logix, poses as ur\n"
                "  scanner  Leuze LPS 36 at 192.168.60.3:9008 to own port 5634, on the robot\n"
                "  robot    connects to 0.0.0.0:5002, dialect kawasaki; its poses as lines to 0.0.0.0:5003\n"
                "  supply   1 lattice box: 300 x 300 x 120 mm, scan path 1, 10 s at most\n"
                "  part     1 track_link: 1 grasp\n"
                "  note     knowledge bases were not opened\n");
}

TEST(Check, AKnowledgeBaseThatTheDaemonWouldRefuseIsAFinding) {
  daemon::TrainedFolder folder;
  folder.edit("state_dir = \"/var/lib/binpick\"", "state_dir = \"state\"");
  folder.save();
  std::filesystem::remove(folder.path("track_link.kb"));
  const std::string place = ":" + std::to_string(folder.line_of("knowledge_base = ")) + ":18: part 1: ";
  Answer answer = check(folder.path("cell.toml"));
  EXPECT_EQ(answer.exit_status, 2);
  EXPECT_NE(answer.out.find(place + "knowledge base: cannot read " + folder.path("track_link.kb")), std::string::npos)
      << answer.out;
  EXPECT_NE(answer.out.find("binpick train " + folder.path("track_link.toml")), std::string::npos) << answer.out;
  EXPECT_EQ(check(folder.path("cell.toml"), true).exit_status, 0);

  folder.write("track_link.kb", "something else");
  answer = check(folder.path("cell.toml"));
  EXPECT_EQ(answer.exit_status, 2);
  EXPECT_NE(answer.out.find("is not a knowledge base"), std::string::npos) << answer.out;

  folder.train();
  folder.give_mesh(vision::shapes::box(200, 120, 49));
  answer = check(folder.path("cell.toml"));
  EXPECT_EQ(answer.exit_status, 2);
  EXPECT_NE(answer.out.find("was trained from another mesh"), std::string::npos) << answer.out;

  folder.write("track_link.stl", "");
  answer = check(folder.path("cell.toml"));
  EXPECT_EQ(answer.exit_status, 2);
  EXPECT_NE(answer.out.find(":" + std::to_string(folder.line_of("file = ")) + ":8: part 1: mesh "), std::string::npos)
      << answer.out;
}

TEST(Check, FoldersThatNobodyCouldWriteToAreFindings) {
  const auto said = [](const std::string& state, const std::string& pictures) {
    daemon::TrainedFolder folder;
    folder.edit("state_dir = \"/var/lib/binpick\"", "state_dir = \"" + state + "\"")
        .edit("picture_dir = \"\"", "picture_dir = \"" + pictures + "\"");
    EXPECT_EQ(folder.findings(), "");
    return check(folder.path("cell.toml"), true);
  };
  EXPECT_EQ(said("made/by/the/daemon", ".").exit_status, 0);
  const Answer missing = said("state", "pictures");
  EXPECT_EQ(missing.exit_status, 2);
  EXPECT_NE(missing.out.find("cell.picture_dir: there is no folder "), std::string::npos) << missing.out;
  const Answer file = said("track_link.stl", "");
  EXPECT_EQ(file.exit_status, 2);
  EXPECT_NE(file.out.find("track_link.stl is no folder; name one\n"), std::string::npos) << file.out;
  EXPECT_NE(said("track_link.stl/state", "").out.find("track_link.stl is no folder; name one\n"), std::string::npos);
}

TEST(Check, APartThatFitsIntoNoSupplyHasItsUnitsWrong) {
  const auto said = [](const std::string& unit, const std::string& size) {
    daemon::TrainedFolder folder;
    folder.edit("state_dir = \"/var/lib/binpick\"", "state_dir = \"state\"");
    folder.edit("size_mm = [1000, 800, 500]", "size_mm = " + size);
    folder.edit_part("mesh_unit = \"mm\"", "mesh_unit = \"" + unit + "\"");
    EXPECT_EQ(folder.findings(), "");
    return check(folder.path("cell.toml"), true).out;
  };
  EXPECT_NE(said("mm", "[1000, 800, 500]").find(": good\n"), std::string::npos);
  EXPECT_NE(
      said("m", "[1000, 800, 500]").find(": part 1: its mesh measures 2e+05 x 1.2e+05 x 5e+04 mm; correct mesh_unit"),
      std::string::npos);
  EXPECT_NE(said("cm", "[1000, 800, 500]").find("fits into no supply"), std::string::npos);
  EXPECT_NE(said("mm", "[100, 80, 500]").find("its mesh measures 200 x 120 x 50 mm and fits into no supply"),
            std::string::npos);
  EXPECT_NE(said("mm",
                 "[1000, 800, 500]\nT_base_supply = { xyz_mm = [1200, 0, 0], rpy_deg = [0, 0, 0] }\n"
                 "sweep_start_deg = -16\nsweep_end_deg = 16\n[[supply]]\nid = 2\nsize_mm = [50, 50, 50]")
                .find("supply.size_mm: none of the parts fits into it; correct it (mm)"),
            std::string::npos);
}

TEST(Check, FindingsAreWrongInput) {
  const Answer answer = check(config::in_source("tests/data/broken.toml"));
  EXPECT_EQ(answer.exit_status, 2);
  EXPECT_NE(
      answer.out.find("broken.toml:22:1: unknown key \"tilt_max_degree\" in [reach]; did you mean \"tilt_max_deg\"?\n"
                      "  22 | tilt_max_degree = 30\n"
                      "     | ^~~~~~~~~~~~~~~\n"),
      std::string::npos);
  EXPECT_TRUE(answer.out.ends_with("\n10 findings\n")) << answer.out;
}

TEST(Check, AFileThatIsNotThere) {
  const Answer answer = check("/nowhere/cell.toml");
  EXPECT_EQ(answer.exit_status, 2);
  EXPECT_EQ(answer.out,
            "/nowhere/cell.toml: cannot be opened: No such file or directory; check the path and who may read it\n"
            "1 finding\n");
}
}  // namespace
}  // namespace binpick::tools
