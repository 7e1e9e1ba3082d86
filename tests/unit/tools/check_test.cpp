#include <CLI/CLI.hpp>
#include <gtest/gtest.h>

#include "tests/unit/config/cell_files.hpp"
#include "tools/commands.hpp"

namespace binpick::tools {
namespace {
struct Answer {
  int exit_status = 0;
  std::string out;
};
Answer check(const std::string& path) {
  CLI::App app;
  Answer answer;
  add_check(app, answer.exit_status);
  testing::internal::CaptureStdout();
  app.parse(std::vector<std::string>{path, "check"});  // CLI11 takes them from the back
  answer.out = testing::internal::GetCapturedStdout();
  return answer;
}

TEST(Check, AGoodCellIsSummedUp) {
  const config::CellFolder folder;
  ASSERT_TRUE(folder.load().has_value());
  const Answer answer = check(folder.path("cell.toml"));
  EXPECT_EQ(answer.exit_status, 0);
  EXPECT_EQ(answer.out, folder.path("cell.toml") + ": good\n" +
                            "  cell     demo, PLC at 0.0.0.0:502, robot at 0.0.0.0:5002\n"
                            "  devices  pivot 12 on can0, LMS 400 at 192.168.0.1:2111\n"
                            "  supply   1 lattice box: 1000 x 800 x 500 mm, sweep -16 ... 16 deg\n"
                            "  part     1 track_link: 1 grasp\n"
                            "           not trained yet: binpick train " +
                            folder.path("track_link.toml") + " -o " + folder.path("track_link.kb") + "\n");
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
