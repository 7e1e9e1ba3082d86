#include "daemon/cycle/replay.hpp"

#include <cstdio>
#include <gtest/gtest.h>

#include "daemon/cycle/record_codec.hpp"
#include "tests/support/cell_file.hpp"
#include "tests/support/emulated_cell.hpp"
#include "tests/support/scenes.hpp"
#include "vision/kernels.hpp"

/// What a cycle leaves behind gives its result again.
namespace binpick::support {
namespace {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr std::size_t kCycles = 3;
#else
constexpr std::size_t kCycles = 100;
#endif

std::shared_ptr<const daemon::CellData> recording_cell() {
  CellFile file = coarse_cell();
  file.picks_per_scan = 1;
  file.record_dir = "records";
  return test_folder().load(file);
}

/// By way of the bytes of a file.
daemon::Record written_and_read(const daemon::Record& record) {
  auto read = daemon::decode(daemon::encode(record));
  EXPECT_TRUE(read.has_value());
  return read ? std::move(*read) : daemon::Record{};
}
}  // namespace

TEST(Replay, EveryRecordedCycleGivesTheSameResult) {
  const auto data = recording_cell();
  std::size_t cycles = 0, identical = 0, found = 0;
  for (std::uint64_t seed = 1; cycles < kCycles; ++seed) {
    EmulatedCell cell{data, scene_of("track_link", 3, seed), seed};
    ASSERT_TRUE(cell.run_until_ready());
    for (int pick = 0; pick < 20 && cycles < kCycles; ++pick) {
      const auto answer = cell.pick();
      ASSERT_TRUE(answer.has_value());
      const auto record = cell.cell().take_record();
      ASSERT_TRUE(record.has_value());
      ASSERT_FALSE(cell.cell().take_record().has_value()) << "one for each cycle";
      ASSERT_TRUE(record->result.has_value());
      EXPECT_EQ(record->answer->code, answer->code);
      EXPECT_EQ(record->answer->registers.at(42), answer->pick_id);
      EXPECT_EQ(record->scan->profiles.size(), record->scan->figures.profiles);
      const auto replayed = daemon::replay(written_and_read(*record), {});
      ASSERT_TRUE(replayed.has_value()) << replayed.error();
      const auto lines = daemon::differences(*record->result, replayed->result);
      EXPECT_TRUE(lines.empty()) << "cycle " << cycles << ": " << lines.front();
      identical += lines.empty() ? 1 : 0;
      found += record->result->report.detections.size();
      ++cycles;
      ASSERT_TRUE(cell.run_until([&] { return cell.robot.clear_of_view() && cell.plc.ready(); }));
    }
  }
  std::printf("%zu cycles replayed, %zu identical; %zu objects found in them\n", cycles, identical, found);
  EXPECT_EQ(identical, kCycles);
  EXPECT_GT(found, kCycles) << "results that are all empty would be alike as well";
}

TEST(Replay, ShowsWhatElseWouldHaveHappenedAndWhatIsMissing) {
  const auto data = recording_cell();
  EmulatedCell cell{data, scene_of("track_link", 3, 2)};
  ASSERT_TRUE(cell.run_until_ready());
  ASSERT_TRUE(cell.pick().has_value());
  const auto record = cell.cell().take_record();
  ASSERT_TRUE(record.has_value() && record->result.has_value());
  ASSERT_FALSE(record->result->choice.reachable.empty());

  daemon::Record steeper = *record;
  auto& text = steeper.cell.cell.text;
  const auto at = text.find("tilt_max_deg = ");
  ASSERT_NE(at, std::string::npos);
  text.insert(at + 15, "0.0");  // "45" becomes "0.045"
  const auto other = daemon::replay(steeper, {});
  ASSERT_TRUE(other.has_value()) << other.error();
  EXPECT_TRUE(other->result.choice.reachable.empty());
  EXPECT_FALSE(daemon::differences(*record->result, other->result).empty());

  daemon::Record other_base = *record;
  other_base.cell.knowledge_bases.front().checksum ^= 1;
  const auto refused = daemon::replay(other_base, {});
  ASSERT_FALSE(refused.has_value());
  EXPECT_NE(refused.error().find("is not the one of the record"), std::string::npos) << refused.error();
  const auto missing = daemon::replay(*record, {.part = {}, .knowledge_base = "/nowhere/a.kb"});
  ASSERT_FALSE(missing.has_value());
  EXPECT_NE(missing.error().find("binpick train "), std::string::npos) << missing.error();
}

TEST(Replay, ACycleThatFailsLeavesARecordToo) {
  EmulatedCell cell{recording_cell(), scene_of("track_link", 3, 2)};
  ASSERT_TRUE(cell.run_until_ready());
  cell.plc.raise_request(1, 1);
  ASSERT_TRUE(cell.run_until([&] { return cell.cell().sweep_state() == drivers::sweep::State::Sweeping; }));
  cell.run_for(std::chrono::milliseconds(500));
  cell.scanner.faults.unplugged = true;
  ASSERT_TRUE(cell.run_until([&] { return cell.plc.fault(); }));
  const auto record = cell.cell().take_record();
  ASSERT_TRUE(record.has_value());
  EXPECT_FALSE(record->result.has_value());
  EXPECT_EQ(record->answer->alarm, plc::Alarm::ScannerNoReply);
  EXPECT_GT(record->scan->profiles.size(), 10U);
  EXPECT_TRUE(daemon::replay(*record, {}).has_value()) << "what was measured can be looked at";
}
}  // namespace binpick::support
