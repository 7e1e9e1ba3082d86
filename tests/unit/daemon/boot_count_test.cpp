#include "daemon/boot_count.hpp"

#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>
#include <string>
#include <sys/syscall.h>
#include <unistd.h>
#include <vector>

namespace {
std::vector<std::string> disk_calls;  // in their order: "fsync PATH", "rename FROM TO"
}

// In place of the C library's, for this whole program: what reaches the disk, and in which order, is not to be seen
// otherwise.
extern "C" int fsync(int fd) {
  disk_calls.push_back("fsync " + std::filesystem::read_symlink("/proc/self/fd/" + std::to_string(fd)).string());
  return static_cast<int>(syscall(SYS_fsync, fd));
}
extern "C" int rename(const char* from, const char* to) noexcept {
  disk_calls.push_back(std::string("rename ") + from + " " + to);
  return static_cast<int>(syscall(SYS_renameat2, AT_FDCWD, from, AT_FDCWD, to, 0));
}

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

/// A PLC that sees the count of before the power cut takes the cell for one that was never away.
TEST_F(BootCount, IsOnTheDiskBeforeAnybodyIsTold) {
  disk_calls.clear();
  next_boot_count(dir);
  ASSERT_EQ(disk_calls.size(), 3U);
  const std::string file = disk_calls[0].substr(6);
  EXPECT_EQ(disk_calls[0], "fsync " + file);
  EXPECT_EQ(disk_calls[1], "rename " + file + " " + (dir / "boot_count").string());
  EXPECT_EQ(disk_calls[2], "fsync " + dir.string());
}

TEST_F(BootCount, AFileOfNonsenseCountsAsNone) {
  std::filesystem::create_directories(dir);
  std::ofstream(dir / "boot_count") << "nonsense";
  EXPECT_EQ(next_boot_count(dir), 1);
}

TEST_F(BootCount, AFolderThatCannotBeWrittenCostsNothing) { EXPECT_GE(next_boot_count("/proc/binpick"), 1); }
}  // namespace binpick::daemon
