#include "daemon/cycle/cell_data.hpp"

#include <filesystem>
#include <gtest/gtest.h>

#include "base/log.hpp"
#include "tests/unit/cycle/trained_folder.hpp"

namespace binpick::daemon {
namespace {
/// What load_cell says of the folder; empty: it is good. The folder's own path is left out.
std::string said_of(const TrainedFolder& folder) {
  folder.save();
  const auto loaded = load_cell(folder.path("cell.toml"));
  if (loaded) return {};
  std::string text;
  for (const auto& finding : loaded.error()) text += finding + "\n";
  for (std::size_t at = 0; (at = text.find(folder.path(""))) != std::string::npos;)
    text.erase(at, folder.path("").size());
  return text;
}
const std::string kAgain = "; train it again: binpick train track_link.toml -o track_link.kb\n";
}  // namespace

TEST(CellData, AKnowledgeBaseOfAnotherMeshIsRefusedAtItsLine) {
  const TrainedFolder folder;
  EXPECT_EQ(said_of(folder), "");
  folder.give_mesh(vision::shapes::box(200, 120, 51));
  const std::string line = std::to_string(folder.line_of("knowledge_base = "));
  EXPECT_EQ(said_of(folder), "cell.toml:" + line +
                                 ":18: part 1: track_link.kb was trained from another mesh than track_link.stl" +
                                 kAgain + "  " + line + " | knowledge_base = \"track_link.kb\"\n  " +
                                 std::string(line.size(), ' ') + " |                  ^~~~~~~~~~~~~~~\n");
  folder.train();
  EXPECT_EQ(said_of(folder), "");
}

TEST(CellData, TheKnowledgeBaseOfAnotherPartIsNamedAsSuch) {
  TrainedFolder folder;
  folder.edit_part("# name = \"track link\"", "name = \"plate\"");
  folder.give_mesh(vision::shapes::box(200, 120, 20));
  EXPECT_NE(said_of(folder).find("part 1: track_link.kb is of track_link, not of plate; name its own: binpick train "
                                 "track_link.toml -o plate.kb\n"),
            std::string::npos)
      << said_of(folder);
}

TEST(CellData, AMeshInAnotherUnitIsAnotherMesh) {
  TrainedFolder folder;
  folder.edit_part("mesh_unit = \"mm\"", "mesh_unit = \"cm\"");
  EXPECT_NE(said_of(folder).find("was trained from another mesh than track_link.stl" + kAgain), std::string::npos);
}

TEST(CellData, OptionsThatWereOthersInTrainingAreNamed) {
  const auto after = [](const std::string& from, const std::string& to) {
    TrainedFolder folder;
    folder.edit_part(from, to);
    return said_of(folder);
  };
  const auto expect = [&](const std::string& from, const std::string& to, const std::string& name) {
    const std::string said = after(from, to);
    EXPECT_NE(said.find("part 1: track_link.kb was trained with another value of " + name +
                        " than that of track_link.toml" + kAgain),
              std::string::npos)
        << said;
  };
  expect("scanner = \"lms400\"", "scanner = \"lps36\"", "scanner");
  expect("rotations = 40", "rotations = 40\npixel_mm = 7", "pixel_mm");
  expect("rotations = 40", "rotations = 41", "rotations or picking");
  expect("picking = \"bin\"", "picking = \"conveyor\"", "picking");
  expect("[gripper]", "[symmetry]\nkind = \"none\"\n[gripper]", "symmetry");
  EXPECT_EQ(after("name = \"from above\"", "name = \"from the side\""), "") << "grasps are no matter of training";
}

TEST(CellData, ACellThatWasTrainedNeedsNoMesh) {
  const TrainedFolder folder;
  std::filesystem::remove(folder.path("track_link.stl"));
  std::string log;
  log::set_sink([&](log::Level level, std::string_view, std::string_view text) {
    if (level == log::Level::Warning) log.append(text);
  });
  EXPECT_EQ(said_of(folder), "");
  log::set_sink({});
  EXPECT_NE(log.find("part 1: whether track_link.kb was trained from its mesh cannot be told: "), std::string::npos)
      << log;
}

TEST(CellData, WhatIsNoKnowledgeBaseIsRefusedWithTheWayToMakeIt) {
  const TrainedFolder folder;
  folder.write("track_link.kb", "not one");
  const std::string said = said_of(folder);
  EXPECT_NE(said.find(":18: part 1: knowledge base track_link.kb: is not a knowledge base"), std::string::npos) << said;
  EXPECT_NE(said.find("(make it with: binpick train track_link.toml -o track_link.kb)"), std::string::npos) << said;
}
}  // namespace binpick::daemon
