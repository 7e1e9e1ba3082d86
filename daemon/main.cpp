#include <CLI/CLI.hpp>
#include <cstdio>
#include <optional>
#include <signal.h>
#include <string>
#include <sys/epoll.h>
#include <sys/signalfd.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>

#include "base/clock.hpp"
#include "base/lock_file.hpp"
#include "base/log.hpp"
#include "daemon/boot_count.hpp"
#include "daemon/cell.hpp"
#include "daemon/links.hpp"
#include "daemon/progress_watch.hpp"
#include "daemon/record_writer.hpp"
#include "daemon/reloader.hpp"
#include "daemon/spare_memory.hpp"
#include "daemon/vision_worker.hpp"
#include "drivers/link/loop.hpp"

/// binpickd: one loop, one vision worker. Read top to bottom: options, configuration, cell, loop, stop.
namespace binpick::daemon {
namespace {
constexpr int kExitConfig = 78;                                 // EX_CONFIG: systemd does not try again
constexpr Duration kStopMax = std::chrono::milliseconds(1500);  // SIGTERM to exit, well inside the promised 2 s

/// SIGTERM, SIGINT and SIGHUP as readable events. Blocked before any thread starts, so that all threads inherit it.
int open_signals() {
  sigset_t set;
  sigemptyset(&set);
  for (const int number : {SIGTERM, SIGINT, SIGHUP}) sigaddset(&set, number);
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
  signal(SIGPIPE, SIG_IGN);
  return signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
}

/// Fed only while the loop turns and the worker makes progress.
class Watchdog {
 public:
  Watchdog() {
    std::uint64_t us = 0;
    if (sd_watchdog_enabled(0, &us) > 0) period_ = std::chrono::microseconds(us) / 3;
  }
  std::optional<TimePoint> deadline() const { return period_.count() > 0 ? std::optional{next_} : std::nullopt; }
  void turn(const VisionWorker& worker, Duration detection_deadline, TimePoint now) {
    const bool alive = progress_.alive(worker.progress(), detection_deadline, now);
    if (period_.count() == 0 || now < next_) return;
    next_ = now + period_;
    if (alive) sd_notify(0, "WATCHDOG=1");
  }

 private:
  Duration period_{0};  // 0: no watchdog is wanted
  TimePoint next_{};
  ProgressWatch progress_;
};

int run(const std::string& path) {
  share_one_heap();
  const int signals = open_signals();
  auto loaded = load_cell(path);
  if (!loaded) {
    for (const auto& finding : loaded.error()) std::fprintf(stderr, "%s\n", finding.c_str());
    BINPICK_LOG(Error, "config", "%s refused, %zu finding(s); see them with: binpick check %s", path.c_str(),
                loaded.error().size(), path.c_str());
    return kExitConfig;
  }
  const SystemClock clock;
  const std::uint16_t boot_count = next_boot_count((*loaded)->config.state_dir);
  // Where the PLC is asked, no port in use tells a second daemon, or binpick, that one is at work.
  std::optional<LockFile> lock;
  if ((*loaded)->config.plc.role == plc::LineRole::Client) {
    lock.emplace((*loaded)->config.lock_path());
    if (lock->held_by_another()) {
      BINPICK_LOG(Error, "daemon",
                  "another binpickd is at work with %s; end it, or give this one its own cell.state_dir",
                  (*loaded)->config.lock_path().c_str());
      return 1;
    }
  }
  Cell cell{*loaded, boot_count};
  drivers::link::Loop loop;
  Links links{loop, cell};
  VisionWorker worker{[&loop] { loop.wake(); }};
  RecordWriter records{[&loop] { loop.wake(); }};
  Reloader reloader{[&path] { return load_cell(path); }, [&loop] { loop.wake(); }};
  Watchdog watchdog;
  std::optional<TimePoint> stop_by;

  loop.watch(signals, EPOLLIN, [&](std::uint32_t, TimePoint now) {
    signalfd_siginfo info{};
    while (read(signals, &info, sizeof info) == static_cast<ssize_t>(sizeof info)) {
      if (info.ssi_signo == SIGHUP) {
        sd_notifyf(0, "RELOADING=1\nSTATUS=reading %s", path.c_str());
        reloader.start();
      } else if (!stop_by) {
        BINPICK_LOG(Notice, "daemon", "stopping");
        sd_notify(0, "STOPPING=1");
        stop_by = now + kStopMax;
        cell.shut_down(now);
      }
    }
  });
  const auto& config = (*loaded)->config;
  const std::string carrier =
      config.carrier == config::Carrier::Robot ? "on the robot" : "on the pivot at " + config.pivot_can;
  BINPICK_LOG(Notice, "daemon", "%s is up: PLC at %s, scanner %s %s, robot at %s", config.name.c_str(),
              config.plc_line().c_str(), config.scanner_address.c_str(), carrier.c_str(), config.robot_listen.c_str());
  sd_notify(0, "READY=1\nSTATUS=running");

  TimePoint now = clock.now();
  while (true) {
    links.on_deadline(now);
    if (auto result = worker.take_result()) cell.on_detect_result(std::move(*result), now);
    if (auto edited = reloader.take()) {
      if (*edited) {
        cell.reload(std::move(**edited));
      } else {
        cell.reload_refused(edited->error(), now);
      }
      if (!reloader.pending() && !stop_by) sd_notify(0, "READY=1\nSTATUS=running");
    }
    cell.run(now);
    if (auto request = cell.take_detect_request()) {
      const auto cycle = request->cycle_id;
      if (!worker.post(std::move(*request))) {
        DetectResult failed;
        failed.cycle_id = cycle;
        failed.error = "the worker is still at an earlier scan";
        cell.on_detect_result(std::move(failed), now);
        cell.run(now);
      }
    }
    while (auto record = cell.take_record()) {
      const auto since_1970 = std::chrono::system_clock::now().time_since_epoch();
      record->origin.unix_ms = std::chrono::duration_cast<std::chrono::milliseconds>(since_1970).count();
      records.post(std::move(*record), cell.data().config.record);
    }
    if (const auto written = records.take_change()) cell.on_records_written(*written, now);
    links.flush(now);
    watchdog.turn(worker, cell.data().config.detection.deadline, now);
    if (stop_by && ((cell.safe() && records.idle()) || now >= *stop_by)) break;
    now = loop.wait(earlier(earlier(cell.deadline(), links.deadline()), earlier(watchdog.deadline(), stop_by)));
  }
  links.flush(clock.now());
  BINPICK_LOG(Notice, "daemon", "stopped%s", cell.safe() ? "" : ", but the pivot did not answer");
  if (worker.busy() || reloader.pending() || !records.idle()) {
    // Neither a detection nor a slow file system can be broken off; nobody waits for them any more.
    std::fflush(nullptr);
    _exit(0);
  }
  return 0;
}
}  // namespace
}  // namespace binpick::daemon

int main(int argc, char** argv) {
  CLI::App app{"binpickd: the cell controller of a bin-picking cell"};
  app.set_version_flag("--version", "binpickd " BINPICK_VERSION);
  std::string path;
  bool verbose = false;
  app.add_option("--config", path, "cell file (TOML)")->required();
  app.add_flag("--verbose", verbose, "log debug lines too");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
    std::fprintf(stderr, "binpickd: %s; binpickd --help says what it takes\n", error.what());
    return 2;
  }
  if (verbose) binpick::log::set_threshold(binpick::log::Level::Debug);
  try {
    return binpick::daemon::run(path);
  } catch (const std::exception& failure) {
    BINPICK_LOG(Error, "daemon", "cannot start: %s", failure.what());
    return 1;
  }
}
