#include <filesystem>
#include <gtest/gtest.h>

#include "tests/unit/config/cell_files.hpp"

namespace binpick::config {
namespace {
TEST(Texts, AConfigurationKeepsWhatItWasReadFrom) {
  const CellFolder folder;
  const auto loaded = folder.load();
  ASSERT_TRUE(loaded.has_value()) << folder.findings();
  EXPECT_NE(loaded->text.find("[[supply]]"), std::string::npos);
  EXPECT_NE(loaded->recipes[0].part.text.find("track_link.stl"), std::string::npos);
}

TEST(Texts, AreLoadedAgainWhereTheFilesAreGone) {
  const CellFolder folder;
  const auto loaded = folder.load();
  ASSERT_TRUE(loaded.has_value()) << folder.findings();
  const FileText cell{loaded->path, loaded->text};
  std::vector<FileText> parts{{loaded->recipes[0].part.path, loaded->recipes[0].part.text}};
  std::filesystem::remove_all(folder.path(""));
  const auto again = load_texts(cell, parts);
  ASSERT_TRUE(again.has_value()) << to_string(again.error().front());
  EXPECT_EQ(again->recipes[0].part.mesh_path, loaded->recipes[0].part.mesh_path);
  EXPECT_EQ(again->recipes[0].knowledge_base, loaded->recipes[0].knowledge_base);
  EXPECT_EQ(again->recipes[0].part.grasps.size(), 1U);

  parts.front().path += "x";
  const auto without = load_texts(cell, parts);
  ASSERT_FALSE(without.has_value());
  EXPECT_NE(to_string(without.error().front()).find("not among the files"), std::string::npos)
      << to_string(without.error().front());
}
}  // namespace
}  // namespace binpick::config
