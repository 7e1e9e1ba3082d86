#include "daemon/record_ring.hpp"

#include <csignal>
#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "daemon/cycle/record_codec.hpp"
#include "tests/unit/daemon/own_folder.hpp"

namespace binpick::daemon {
namespace {
namespace fs = std::filesystem;

Record small_record(std::uint64_t cycle) {
  Record record;
  record.origin = {"test", 3, cycle, 0};
  return record;
}

std::string name_of(std::uint64_t cycle) { return record_name(small_record(cycle).origin); }

/// All that lies in the folder, in whole blocks.
std::uint64_t blocks_in(const std::string& folder) {
  std::uint64_t bytes = 0;
  for (const auto& entry : fs::directory_iterator{folder}) bytes += (entry.file_size() + 4095) / 4096 * 4096;
  return bytes;
}

TEST(RecordRing, KeepsItsCapOverTenThousandRecordsAndTheNewestOnes) {
  const OwnFolder folder{folder_in_memory()};
  RecordRing ring{folder.path("records")};
  constexpr std::uint64_t kCap = 200 * 4096;
  for (std::uint64_t cycle = 1; cycle <= 10'000; ++cycle) {
    const auto written = ring.write(name_of(cycle), encode(small_record(cycle)), kCap);
    ASSERT_TRUE(written.has_value()) << written.error();
    ASSERT_LE(ring.bytes(), kCap);
    if (cycle % 500 == 0) {
      ASSERT_EQ(blocks_in(ring.dir()), ring.bytes()) << cycle;
    }
  }
  EXPECT_EQ(ring.bytes(), kCap);
  for (std::uint64_t cycle = 10'000 - 199; cycle <= 10'000; ++cycle)
    EXPECT_TRUE(fs::exists(ring.dir() + "/" + name_of(cycle))) << cycle;
}

TEST(RecordRing, CountsWhatAnEarlierStartLeftAndNothingOfOthers) {
  const OwnFolder folder;
  const std::string left_over = folder.path("cycle-00002-00000009.bpr.part4711");
  std::ofstream{left_over} << std::string(5000, 'x');
  std::ofstream{folder.path("notes.txt")} << std::string(50'000, 'x');
  fs::create_directory(folder.path("cycle-old.bpr"));
  RecordRing ring{folder.path("")};
  ASSERT_TRUE(ring.write(name_of(1), encode(small_record(1)), 4 * 4096).has_value());
  EXPECT_EQ(ring.bytes(), 3 * 4096U) << "two blocks of what was left, one of the new one";
  ASSERT_TRUE(ring.write(name_of(2), encode(small_record(2)), 4 * 4096).has_value());
  EXPECT_TRUE(fs::exists(left_over));
  ASSERT_TRUE(ring.write(name_of(3), encode(small_record(3)), 4 * 4096).has_value());
  EXPECT_FALSE(fs::exists(left_over)) << "the oldest";
  // A lower cap is reached with the next record.
  ASSERT_TRUE(ring.write(name_of(4), encode(small_record(4)), 2 * 4096).has_value());
  EXPECT_EQ(ring.bytes(), 2 * 4096U);
  EXPECT_FALSE(fs::exists(folder.path(name_of(2))));
  EXPECT_TRUE(fs::exists(folder.path("notes.txt")) && fs::exists(folder.path("cycle-old.bpr")));
  // Written again under the same name it counts once.
  ASSERT_TRUE(ring.write(name_of(4), encode(small_record(4)), 4 * 4096).has_value());
  EXPECT_EQ(ring.bytes(), 2 * 4096U);
}

TEST(RecordRing, TellsWhyItCannotWriteAndGoesOnAfterwards) {
  const OwnFolder folder;
  std::ofstream{folder.path("file")} << "x";
  RecordRing in_a_file{folder.path("file")};
  const auto no_folder = in_a_file.write(name_of(1), encode(small_record(1)), 1 << 20);
  ASSERT_FALSE(no_folder.has_value());
  EXPECT_NE(no_folder.error().find("record.dir"), std::string::npos) << no_folder.error();

  RecordRing ring{folder.path("records")};
  const auto too_large = ring.write(name_of(1), Bytes(5000), 4096);
  ASSERT_FALSE(too_large.has_value());
  EXPECT_NE(too_large.error().find("raise record.size_max_mb"), std::string::npos) << too_large.error();
  ASSERT_TRUE(ring.write(name_of(1), encode(small_record(1)), 1 << 20).has_value());
  fs::remove_all(ring.dir());
  EXPECT_FALSE(ring.write(name_of(2), encode(small_record(2)), 1 << 20).has_value());
  ASSERT_TRUE(ring.write(name_of(3), encode(small_record(3)), 1 << 20).has_value()) << "the folder is made anew";
  EXPECT_EQ(ring.bytes(), blocks_in(ring.dir()));
}

/// A disk of 1 MB, where this user may mount one.
class SmallDisk {
 public:
  explicit SmallDisk(std::string path) : path_{std::move(path)} {
    fs::create_directory(path_);
    mounted_ = ::mount("binpick-test", path_.c_str(), "tmpfs", 0, "size=1m") == 0;
  }
  ~SmallDisk() {
    if (mounted_) ::umount2(path_.c_str(), MNT_DETACH);
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;
  bool mounted() const { return mounted_; }

 private:
  std::string path_;
  bool mounted_ = false;
};

TEST(RecordRing, AFullDiskLosesTheRecordAndNothingElse) {
  const OwnFolder folder;
  const SmallDisk disk{folder.path("disk")};
  if (!disk.mounted()) GTEST_SKIP() << "this user cannot mount a disk of 1 MB";
  RecordRing ring{folder.path("disk")};
  ASSERT_TRUE(ring.write(name_of(1), Bytes(300'000), 10 << 20).has_value());
  const std::string others = folder.path("disk/others");
  std::ofstream{others} << std::string(600'000, 'x');
  const auto full = ring.write(name_of(2), Bytes(300'000), 10 << 20);
  ASSERT_FALSE(full.has_value());
  EXPECT_NE(full.error().find("No space left"), std::string::npos) << full.error();
  EXPECT_TRUE(fs::exists(folder.path("disk/" + name_of(1))));
  EXPECT_EQ(std::distance(fs::directory_iterator{folder.path("disk")}, {}), 2) << "nothing half written stays";
  fs::remove(others);
  EXPECT_TRUE(ring.write(name_of(3), Bytes(300'000), 10 << 20).has_value());
}

// The same refusal in the midst of a write, for users who cannot mount: no file of this process may grow beyond.
TEST(RecordRing, AWriteThatIsRefusedInItsMidstLeavesNothing) {
  const OwnFolder folder;
  RecordRing ring{folder.path("")};
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  rlimit small = before;
  small.rlim_cur = 100'000;
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  const auto refused = ring.write(name_of(1), Bytes(300'000), 10 << 20);
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  ASSERT_FALSE(refused.has_value());
  EXPECT_TRUE(fs::is_empty(folder.path("")));
  EXPECT_TRUE(ring.write(name_of(1), Bytes(300'000), 10 << 20).has_value());
}

TEST(RecordRing, AKillInTheMidstOfAWriteLeavesWhatIsKnownAsCutOff) {
  const OwnFolder folder;
  Record large = small_record(1);
  large.cell.cell.text.assign(std::size_t{64} << 20, 'x');
  const Bytes bytes = encode(large);
  std::string left_over;
  // The kill may come before the first byte or after the last one: then once more.
  for (int attempt = 0; attempt < 50 && left_over.empty(); ++attempt) {
    fs::remove_all(folder.path("records"));
    fs::create_directory(folder.path("records"));
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      RecordRing ring{folder.path("records")};
      const bool written = ring.write(name_of(1), bytes, std::uint64_t{1} << 30).has_value();
      _exit(written ? 0 : 1);
    }
    const std::string part = folder.path("records/" + name_of(1) + ".part" + std::to_string(child));
    std::error_code not_yet;
    int status = 0;
    while (waitpid(child, &status, WNOHANG) == 0)
      if (const auto size = fs::file_size(part, not_yet); !not_yet && size > 0) kill(child, SIGKILL);
    if (fs::exists(part) && fs::file_size(part) > 0 && fs::file_size(part) < bytes.size()) left_over = part;
  }
  ASSERT_FALSE(left_over.empty()) << "no kill came while it wrote";
  EXPECT_FALSE(fs::exists(folder.path("records/" + name_of(1)))) << "under its name it is whole or not there";
  const auto read = read_record(left_over);
  ASSERT_FALSE(read.has_value());
  EXPECT_EQ(read.error().kind, RecordError::Kind::CutOff) << read.error().text;
}
}  // namespace
}  // namespace binpick::daemon
