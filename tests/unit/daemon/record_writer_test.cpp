#include "daemon/record_writer.hpp"

#include <condition_variable>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>
#include <mutex>
#include <sys/stat.h>
#include <unistd.h>

#include "base/clock.hpp"
#include "daemon/cycle/record_codec.hpp"
#include "tests/unit/daemon/own_folder.hpp"

namespace binpick::daemon {
namespace {
namespace fs = std::filesystem;
using namespace std::chrono_literals;

/// What a loop does: woken by the writer, it looks whether what it waits for has come.
class Loop {
 public:
  std::function<void()> wake() {
    return [this] {
      const std::lock_guard lock{mutex_};
      woken_.notify_all();
    };
  }
  bool wait(const std::function<bool()>& done) {
    std::unique_lock lock{mutex_};
    return woken_.wait_for(lock, 20s, done);
  }

 private:
  std::mutex mutex_;
  std::condition_variable woken_;
};

Record record_of(std::uint64_t cycle) {
  Record record;
  record.origin = {"test", 3, cycle, 0};
  return record;
}

TEST(RecordWriter, WritesWhatItIsGiven) {
  const OwnFolder folder;
  Loop loop;
  RecordWriter writer{loop.wake()};
  const config::Records place{folder.path("records"), 10};
  for (std::uint64_t cycle = 1; cycle <= 3; ++cycle) writer.post(record_of(cycle), place);
  ASSERT_TRUE(loop.wait([&] { return writer.idle(); }));
  EXPECT_EQ(writer.written(), 3U);
  EXPECT_FALSE(writer.take_change().has_value());
  const auto read = read_record(folder.path("records/cycle-00003-00000002.bpr"));
  ASSERT_TRUE(read.has_value()) << read.error().text;
  EXPECT_EQ(read->origin.cycle_id, 2U);
}

TEST(RecordWriter, AFolderThatRefusesIsToldOnceAndItsRecoveryToo) {
  const OwnFolder folder;
  Loop loop;
  RecordWriter writer{loop.wake()};
  const config::Records place{folder.path("records"), 10};
  std::ofstream{folder.path("records")} << "a file is in the way";
  for (std::uint64_t cycle = 1; cycle <= 3; ++cycle) {
    writer.post(record_of(cycle), place);
    ASSERT_TRUE(loop.wait([&] { return writer.idle(); }));
    EXPECT_EQ(writer.take_change(), cycle == 1 ? std::optional{false} : std::nullopt);
  }
  fs::remove(folder.path("records"));
  writer.post(record_of(4), place);
  ASSERT_TRUE(loop.wait([&] { return writer.idle(); }));
  EXPECT_EQ(writer.take_change(), true);
  EXPECT_EQ(writer.written(), 1U);
}

// A disk that hangs: the file to be written is a pipe that nobody reads.
TEST(RecordWriter, ADiskThatHangsNeverHoldsTheLoop) {
  const OwnFolder folder;
  Loop loop;
  RecordWriter writer{loop.wake()};
  const config::Records place{folder.path(""), 10};
  const std::string pipe = folder.path("cycle-00003-00000001.bpr.part" + std::to_string(getpid()));
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  const SystemClock clock;
  const TimePoint begin = clock.now();
  for (std::uint64_t cycle = 1; cycle <= 1000; ++cycle) writer.post(record_of(cycle), place);
  const double took_ms = in_ms(clock.now() - begin);
  EXPECT_EQ(writer.take_change(), false) << "most were dropped";
  EXPECT_FALSE(writer.idle());
  EXPECT_EQ(writer.written(), 0U);
  EXPECT_LT(took_ms, 1000) << "a thousand records, of which each one would have had to wait for ever";
  // Somebody reads at last: what waited is written, and the writer has come back.
  const int reader = open(pipe.c_str(), O_RDONLY);
  ASSERT_GE(reader, 0);
  char bytes[4096];
  while (read(reader, bytes, sizeof bytes) > 0) continue;
  close(reader);
  ASSERT_TRUE(loop.wait([&] { return writer.idle(); }));
  writer.post(record_of(1001), place);
  ASSERT_TRUE(loop.wait([&] { return writer.idle(); }));
  EXPECT_EQ(writer.take_change(), true);
  EXPECT_TRUE(fs::exists(folder.path("cycle-00003-00001001.bpr")));
}
}  // namespace
}  // namespace binpick::daemon
