#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>
#include <poll.h>
#include <signal.h>
#include <sys/inotify.h>
#include <thread>
#include <unistd.h>

#include "daemon/cycle/record_codec.hpp"
#include "tests/emulators/program/scan_paths.hpp"
#include "tests/support/scenes.hpp"
#include "tests/system/system_cell.hpp"
#include "tests/unit/daemon/own_folder.hpp"

/// The real daemon over real sockets: what memory and virtual time cannot show.
namespace binpick::support {
namespace {
using namespace std::chrono_literals;
namespace fs = std::filesystem;

/// Kills the daemon as soon as a file that it has made in the folder holds something: it writes then.
class KillInTheWrite {
 public:
  KillInTheWrite(const std::string& folder, const SystemCell& cell)
      : events_{inotify_init1(IN_CLOEXEC)}, thread_{[this, folder, &cell](const std::stop_token& stop) {
          inotify_add_watch(events_, folder.c_str(), IN_CREATE);
          for (std::array<char, 4096> news{}; !stop.stop_requested();) {
            pollfd created{events_, POLLIN, 0};
            if (poll(&created, 1, 20) < 1 || read(events_, news.data(), news.size()) <= 0) continue;
            const auto* event = reinterpret_cast<const inotify_event*>(news.data());
            const std::string path = folder + "/" + static_cast<const char*>(event->name);
            std::error_code gone;
            while (fs::file_size(path, gone) == 0 && !gone) continue;
            cell.signal(SIGKILL);
            return;
          }
        }} {}
  ~KillInTheWrite() {
    thread_ = {};  // stops and joins
    close(events_);
  }
  KillInTheWrite(const KillInTheWrite&) = delete;
  KillInTheWrite& operator=(const KillInTheWrite&) = delete;

 private:
  int events_;
  std::jthread thread_;
};

/// Sweeping: the pivot has left the start and profiles are collected.
bool reach_sweep(SystemCell& cell) {
  cell.plc().raise_request(1, 1);
  if (!cell.run_until([&] { return cell.plc().busy() && cell.pivot_moves(); })) return false;
  cell.run_for(900ms);  // past the drive to the start
  return cell.run_until([&] { return cell.pivot_moves(); }, 2s);
}
}  // namespace

class DaemonAndPivot : public testing::TestWithParam<const char*> {};  // pivot.protocol

TEST_P(DaemonAndPivot, MakeAWholePick) {
  CellFile file = coarse_cell();
  file.pivot = GetParam();
  SystemCell cell{file, scene_of("track_link", 3, 2)};
  ASSERT_TRUE(cell.run_until_ready());
  const auto result = cell.pick();
  ASSERT_TRUE(result.has_value());
  EXPECT_EQ(result->code, plc::ResultCode::PickFound);
  ASSERT_TRUE(cell.run_until([&] { return cell.robot().picks_done() == 1; }));
}
INSTANTIATE_TEST_SUITE_P(Both, DaemonAndPivot, testing::Values("powercube", "motion"));

struct Carrying {
  const char* name;
  const char* scanner;
  const char* robot;
};
struct CarriedScanner : testing::TestWithParam<Carrying> {};

TEST_P(CarriedScanner, IsMovedByTheRobotForAWholePick) {
  CellFile file = coarse_cell();
  file.scanner = GetParam().scanner;
  file.robot = GetParam().robot;
  file.scan_path = emulators::kLinearPath;
  const bool is_small = file.scanner != "lms400";
  if (is_small) file.parts = {"contact_bridge"};
  SystemCell cell{file, is_small ? scene_of("contact_bridge", 6, 11, kSmallBox_mm) : scene_of("track_link", 3, 2)};
  ASSERT_TRUE(cell.run_until_ready());
  const auto result = cell.pick();
  ASSERT_TRUE(result.has_value());
  EXPECT_EQ(result->code, plc::ResultCode::PickFound);
  ASSERT_TRUE(cell.run_until([&] { return cell.robot().picks_done() == 1; }));
}

INSTANTIATE_TEST_SUITE_P(Robots, CarriedScanner,
                         testing::Values(Carrying{"ur_rtde", "lms400", "ur"}, Carrying{"fanuc_lines", "lps36", "fanuc"},
                                         Carrying{"kawasaki_lines", "lps36hi", "kawasaki"}),
                         [](const auto& one) { return std::string{one.param.name}; });

TEST(Daemon, PollsAPlcThatIsTheServerAndTellsItWhenItEnds) {
  CellFile file = coarse_cell();
  file.plc_role = "client";
  SystemCell cell{file, scene_of("track_link", 3, 2)};
  ASSERT_TRUE(cell.run_until_ready());
  auto result = cell.pick();
  ASSERT_TRUE(result.has_value());
  EXPECT_EQ(result->code, plc::ResultCode::PickFound);
  // A second one would ask the same PLC and hold the same devices.
  const Ended second = run_program(BINPICKD_PROGRAM, {"--config", cell.cell_path()});
  EXPECT_EQ(second.status, 1);
  EXPECT_NE(second.errors.find("another binpickd is at work with "), std::string::npos) << second.errors;
  cell.plc().faults.unplugged = true;
  cell.run_for(500ms);
  cell.plc().faults = {};
  ASSERT_TRUE(cell.run_until([&] { return cell.plc().connected(); }, 5s));
  ASSERT_TRUE(cell.run_until([&] { return cell.robot().picks_done() == 1 && cell.plc().ready(); }));
  result = cell.pick();
  ASSERT_TRUE(result.has_value());
  EXPECT_NE(result->code, plc::ResultCode::None);
  ASSERT_TRUE(cell.run_until([&] { return cell.plc().idle() && cell.plc().ready(); }));
  cell.signal(SIGTERM);
  ASSERT_TRUE(cell.run_until([&] { return cell.exit_status().has_value(); }, 2s));
  EXPECT_EQ(cell.exit_status(), 0);
  EXPECT_FALSE(cell.plc().ready());
}

TEST(Daemon, KilledInASweepThePivotStopsByItselfAndThePlcSeesTheRestart) {
  SystemCell cell{coarse_cell(), scene_of("track_link", 3, 2)};
  ASSERT_TRUE(cell.run_until_ready());
  const auto boot = cell.plc().boot_count();
  ASSERT_TRUE(reach_sweep(cell));
  cell.signal(SIGKILL);
  const SystemClock clock;
  const TimePoint killed = clock.now();
  ASSERT_TRUE(cell.run_until([&] { return !cell.pivot_moves(); }, 1s));
  std::printf("the pivot stood %.0f ms after the kill\n", in_ms(clock.now() - killed));
  ASSERT_TRUE(cell.run_until([&] { return cell.exit_status().has_value(); }, 1s));
  cell.start_daemon();
  ASSERT_TRUE(cell.run_until([&] { return cell.plc().boot_count() == boot + 1; }));
  EXPECT_FALSE(cell.plc().result_valid());
  ASSERT_TRUE(cell.run_until_ready());
  const auto result = cell.pick();
  ASSERT_TRUE(result.has_value());
  EXPECT_EQ(result->code, plc::ResultCode::PickFound);
}

TEST(Daemon, TermInEachStateEndsItSafelyWithinTwoSeconds) {
  enum class When { Ready, Sweeping, Detecting, ResultValid };
  for (const When when : {When::Ready, When::Sweeping, When::Detecting, When::ResultValid}) {
    SystemCell cell{coarse_cell(), scene_of("track_link", 3, 2)};
    ASSERT_TRUE(cell.run_until_ready());
    cell.plc().hold_ack = true;
    if (when == When::Sweeping) {
      ASSERT_TRUE(reach_sweep(cell));
    }
    if (when == When::Detecting || when == When::ResultValid) {
      cell.plc().raise_request(1, 1);
      ASSERT_TRUE(
          cell.run_until([&] { return when == When::Detecting ? cell.plc().scan_done() : cell.plc().result_valid(); }));
    }
    cell.signal(SIGTERM);
    const SystemClock clock;
    const TimePoint told = clock.now();
    ASSERT_TRUE(cell.run_until([&] { return cell.exit_status().has_value(); }, 2s));
    std::printf("state %d: ended after %.0f ms\n", static_cast<int>(when), in_ms(clock.now() - told));
    EXPECT_EQ(cell.exit_status(), 0);
    EXPECT_TRUE(cell.run_until([&] { return !cell.pivot_moves(); }, 300ms));
  }
}

TEST(Daemon, ReloadsWhileCyclesRun) {
  SystemCell cell{coarse_cell(), scene_of("track_link", 3, 2)};
  ASSERT_TRUE(cell.run_until_ready());
  // A bad edit: alarm, and the old configuration goes on.
  cell.plc().raise_request(1, 1);
  ASSERT_TRUE(cell.run_until([&] { return cell.plc().busy(); }));
  std::ofstream(cell.cell_path()) << to_toml(cell.file()) << "\nnonsense = 1\n";
  cell.signal(SIGHUP);
  std::optional<emulators::PlcResult> result;
  ASSERT_TRUE(cell.run_until([&] { return (result = cell.plc().take_result()).has_value(); }));
  EXPECT_EQ(result->code, plc::ResultCode::PickFound);
  EXPECT_TRUE(cell.run_until([&] { return cell.plc().alarms_seen().contains(plc::Alarm::ConfigurationRefused); }, 2s));
  EXPECT_NE(cell.daemon_log().find("system.toml"), std::string::npos);
  // A good one: in force at the next cycle, and the alarm's cause is gone.
  // The robot has its own time: that it is clear of the view says little before it has fetched its pick.
  const auto robot_did = [&](std::size_t picks) {
    return cell.run_until(
        [&] { return cell.plc().ready() && cell.robot().picks_done() == picks && cell.robot().clear_of_view(); });
  };
  ASSERT_TRUE(robot_did(1));
  cell.plc().raise_request(1, 1);
  ASSERT_TRUE(cell.run_until([&] { return cell.plc().busy(); }));
  CellFile edited = cell.file();
  edited.tilt_max_deg = 0.1;
  std::ofstream(cell.cell_path()) << to_toml(edited);
  cell.signal(SIGHUP);
  ASSERT_TRUE(cell.run_until([&] { return (result = cell.plc().take_result()).has_value(); }));
  EXPECT_EQ(result->code, plc::ResultCode::PickFound);
  ASSERT_TRUE(cell.run_until([&] { return cell.daemon_log().find("is in force") != std::string::npos; }, 5s));
  ASSERT_TRUE(robot_did(2));
  result = cell.pick();
  ASSERT_TRUE(result.has_value());
  EXPECT_EQ(result->code, plc::ResultCode::NotReachable);
  // A reset keeps what still stands: the refusal does not, whatever else a busy machine may have raised.
  cell.plc().raise_reset();
  EXPECT_TRUE(cell.run_until(
      [&] { return std::ranges::count(cell.plc().alarms(), plc::Alarm::ConfigurationRefused) == 0; }, 2s));
}

TEST(Daemon, KilledInTheWriteOfARecordReplayTellsItInOneLine) {
  CellFile file = coarse_cell();
  file.frequency_hz = 360;
  file.resolution_deg = 0.1;
  file.sweep_speed_deg_s = 8;  // some megabytes: a write that a kill can hit
  // Memory is written page by page, a disk in steps of megabytes.
  const daemon::OwnFolder folder{daemon::folder_in_memory()};
  file.record_dir = folder.path("records");
  fs::create_directory(file.record_dir);
  const auto cut_off = [&] {
    for (const auto& entry : fs::directory_iterator{file.record_dir})
      if (entry.path().filename().string().find(".part") != std::string::npos) return entry.path();
    return fs::path{};
  };
  SystemCell cell{file, scene_of("track_link", 3, 2)};
  const auto start_again = [&] {
    const auto boot = cell.plc().boot_count();
    cell.start_daemon();
    return cell.run_until([&] { return cell.plc().boot_count() != boot; }) && cell.run_until_ready() &&
           cell.run_until([&] { return cell.robot().clear_of_view(); });
  };
  ASSERT_TRUE(cell.run_until_ready());
  // The kill may come after the last byte: then once more.
  std::string left_over;
  for (int attempt = 0; attempt < 10 && left_over.empty(); ++attempt) {
    if (attempt > 0) {
      ASSERT_TRUE(start_again());
    }
    {
      const KillInTheWrite killer{file.record_dir, cell};
      cell.plc().raise_request(1, 1);
      ASSERT_TRUE(cell.run_until([&] { return cell.exit_status().has_value(); }, 20s));
    }
    ASSERT_EQ(cell.exit_status(), 128 + SIGKILL);
    const fs::path left = cut_off();
    if (left.empty()) continue;
    if (daemon::read_record(left)) {
      fs::remove(left);
    } else {
      left_over = left;
    }
  }
  ASSERT_FALSE(left_over.empty()) << "no kill came while it wrote";
  EXPECT_GT(fs::file_size(left_over), 0U);
  std::printf("%ju bytes were written\n", static_cast<std::uintmax_t>(fs::file_size(left_over)));

  // The next start works on beside it, and what both left is replayed.
  ASSERT_TRUE(start_again());
  const auto result = cell.pick();
  ASSERT_TRUE(result.has_value());
  EXPECT_EQ(result->code, plc::ResultCode::PickFound);
  cell.signal(SIGTERM);
  ASSERT_TRUE(cell.run_until([&] { return cell.exit_status().has_value(); }, 3s));
  EXPECT_EQ(cell.exit_status(), 0);
  const Ended replay = run_program(BINPICK_PROGRAM, {"replay", file.record_dir});
  EXPECT_EQ(replay.status, 0) << replay.errors;
  EXPECT_NE(replay.output.find(" identical, 0 differ, 1 skipped"), std::string::npos) << replay.output;
  EXPECT_EQ(replay.output.find(" 0 identical"), std::string::npos) << replay.output;
  EXPECT_EQ(std::ranges::count(replay.errors, '\n'), 1) << replay.errors;
  EXPECT_TRUE(replay.errors.starts_with("binpick replay: skipped: " + left_over + " is cut off")) << replay.errors;
}

TEST(Daemon, RefusesABadFileAtTheStart) {
  const std::string path = test_folder().write({}, "refused.toml");
  std::ofstream(path, std::ios::app) << "\n[[part]]\nid = 1\n";
  const auto ended = run_program(BINPICKD_PROGRAM, {"--config", path});
  EXPECT_EQ(ended.status, 78);
  EXPECT_NE(ended.errors.find("refused.toml:"), std::string::npos) << ended.errors;
}

TEST(Daemon, OneFaultOfEachDeviceOverSockets) {
  SystemCell cell{coarse_cell(), scene_of("track_link", 3, 2)};
  ASSERT_TRUE(cell.run_until_ready());
  const auto recovers = [&](const char* what, plc::Alarm alarm) {
    SCOPED_TRACE(what);
    ASSERT_TRUE(cell.run_until([&] { return !cell.pivot_moves(); }, 1s));
    if (cell.run_until([&] { return cell.plc().fault(); }, 1s)) cell.plc().raise_reset();
    const SystemClock clock;
    const TimePoint healed = clock.now();
    ASSERT_TRUE(cell.run_until([&] { return cell.plc().ready() && cell.plc().idle(); }, 5s));
    std::printf("%s: ready again after %.2f s\n", what, in_s(clock.now() - healed));
    EXPECT_TRUE(cell.plc().alarms_seen().contains(alarm));
    const auto picks = cell.robot().picks_done();
    const auto result = cell.pick();
    ASSERT_TRUE(result.has_value());
    EXPECT_EQ(result->code, plc::ResultCode::PickFound);
    ASSERT_TRUE(cell.run_until([&] { return cell.robot().picks_done() > picks && cell.robot().clear_of_view(); }));
    cell.plc().forget_alarms_seen();
  };
  ASSERT_TRUE(reach_sweep(cell));
  cell.pivot().with([](emulators::Pivot& pivot) { pivot.faults.emergency_stop = true; });
  cell.pivot().wake();
  ASSERT_TRUE(cell.run_until([&] { return cell.plc().fault(); }, 3s));
  cell.pivot().with([](emulators::Pivot& pivot) { pivot.faults = {}; });
  cell.pivot().wake();
  recovers("pivot, emergency stop", plc::Alarm::PivotPowerFault);

  ASSERT_TRUE(reach_sweep(cell));
  cell.scanner_faults().unplugged = true;
  ASSERT_TRUE(cell.run_until([&] { return cell.plc().fault(); }, 3s));
  cell.scanner_faults() = {};
  recovers("scanner, pulled", plc::Alarm::ScannerNoReply);

  const auto picks = cell.robot().picks_done();
  ASSERT_TRUE(reach_sweep(cell));
  cell.robot().faults.unplugged = true;
  ASSERT_TRUE(cell.run_until([&] { return cell.plc().alarms_seen().contains(plc::Alarm::RobotLost); }, 3s));
  cell.robot().faults = {};
  ASSERT_TRUE(cell.run_until([&] { return cell.robot().picks_done() > picks && cell.robot().clear_of_view(); }));
  recovers("robot, pulled", plc::Alarm::RobotLost);

  ASSERT_TRUE(reach_sweep(cell));
  cell.plc().faults.unplugged = true;
  cell.run_for(5s);
  EXPECT_FALSE(cell.pivot_moves());
  cell.plc().faults = {};
  recovers("plc, pulled", plc::Alarm::PlcLost);
}
}  // namespace binpick::support
