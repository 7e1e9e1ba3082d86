#include "daemon/boot_count.hpp"

#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>

namespace binpick::daemon {
namespace {
struct BootCount : testing::Test {
  std::filesystem::path dir = std::filesystem::path(testing::TempDir()) / "binpick-boot-count";
  void SetUp() override { std::filesystem::remove_all(dir); }
  void TearDown() override { std::filesystem::remove_all(dir); }
};
}  // namespace

TEST_F(BootCount, CountsStartsFromOneAndWrapsOverZero) {
  EXPECT_EQ(next_boot_count(dir), 1);
  EXPECT_EQ(next_boot_count(dir), 2);
  std::ofstream(dir / "boot_count") << 65535;
  EXPECT_EQ(next_boot_count(dir), 1);
}

TEST_F(BootCount, AFileOfNonsenseCountsAsNone) {
  std::filesystem::create_directories(dir);
  std::ofstream(dir / "boot_count") << "nonsense";
  EXPECT_EQ(next_boot_count(dir), 1);
}

TEST_F(BootCount, AFolderThatCannotBeWrittenCostsNothing) { EXPECT_GE(next_boot_count("/proc/binpick"), 1); }
}  // namespace binpick::daemon
