#include "tests/system/system_cell.hpp"

#include <cstdio>
#include <fcntl.h>
#include <fstream>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <set>
#include <signal.h>
#include <spawn.h>
#include <sstream>
#include <stdexcept>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/emulators/program/scan_paths.hpp"

extern char** environ;

namespace binpick::support {
std::uint16_t free_port(int type) {
  static std::set<std::uint16_t> given;
  for (int attempt = 0; attempt < 100; ++attempt) {
    const int fd = socket(AF_INET, type, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t length = sizeof address;
    const bool bound = bind(fd, reinterpret_cast<sockaddr*>(&address), length) == 0 &&
                       getsockname(fd, reinterpret_cast<sockaddr*>(&address), &length) == 0;
    close(fd);
    if (bound && given.insert(ntohs(address.sin_port)).second) return ntohs(address.sin_port);
  }
  throw std::runtime_error("no free port");
}

namespace {
/// `output_path` empty: its standard output is ours.
pid_t start(const std::string& program, const std::vector<std::string>& arguments, const std::string& log_path,
            const std::string& output_path = {}) {
  std::vector<std::string> words{program};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (auto& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  constexpr int kAppend = O_WRONLY | O_CREAT | O_APPEND;
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, log_path.c_str(), kAppend, 0600);
  if (!output_path.empty())
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, output_path.c_str(), kAppend, 0600);
  pid_t child = -1;
  const int failed = posix_spawn(&child, program.c_str(), &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) throw std::runtime_error("cannot start " + program);
  return child;
}

int status_of(int wait_status) {
  return WIFEXITED(wait_status) ? WEXITSTATUS(wait_status) : 128 + WTERMSIG(wait_status);
}

std::string text_of(const std::string& path) {
  std::ifstream file(path);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}
}  // namespace

SystemCell::SystemCell(CellFile file, emulators::World scene) : file_{std::move(file)}, world_{std::move(scene)} {
  file_.plc_port = free_port(SOCK_STREAM);
  file_.scanner_port = free_port(SOCK_STREAM);
  file_.robot_port = free_port(SOCK_STREAM);
  file_.can_port = free_port(SOCK_DGRAM);
  file_.pose_port = free_port(SOCK_STREAM);
  file_.state_dir = test_folder().path() + "/state";
  cell_path_ = test_folder().write(file_, "system.toml");
  log_path_ = test_folder().path() + "/daemon.log";
  std::remove(log_path_.c_str());
  auto config = config::load(cell_path_);
  if (!config) throw std::runtime_error(to_string(config.error().front()));
  config_ = std::move(*config);

  const config::Supply& supply = config_->supplies.front();
  emulators::RobotOptions robot{.dialect = config_->robot.dialect};
  emulators::WhereScanner where;
  if (config_->carrier == config::Carrier::Robot) {
    robot.paths = emulators::scan_paths(*config_, supply);
    const emulators::FlangeMotion flange = [this](TimePoint at) { return robot_->device.flange_at(at); };
    poses_ = std::make_unique<emulators::PosePort>(loop_, *config_,
                                                   drivers::link::Endpoint{"127.0.0.1", file_.pose_port}, flange, 1);
    where = emulators::on_flange(supply.T_base_supply, config_->T_flange_scanner, flange);
  } else {
    emulators::PivotOptions pivot;
    pivot.protocol = config_->pivot.protocol;
    pivot.referenced = true;
    pivot_ = std::make_unique<emulators::PivotPort>(config_->pivot_can, pivot);
    const emulators::ScannerPlace place{config_->mount.T_base_pivot, config_->mount.T_pivot_scanner,
                                        supply.T_base_supply};
    where = emulators::on_pivot(place, [this](TimePoint at) { return pivot_->angle_at(at); });
  }
  scanner_ = emulators::open_scanner(loop_, *config_, world_, std::move(where), 1);
  robot_ = std::make_unique<emulators::RobotPort>(loop_, *drivers::link::parse_endpoint(config_->robot_listen),
                                                  emulators::Robot{robot});
  emulators::PlcOptions plc;
  plc.cell_role = config_->plc.role;
  plc_ = std::make_unique<emulators::PlcPort>(loop_, *drivers::link::parse_endpoint(config_->plc_line()),
                                              emulators::Plc{plc});
  start_daemon();
}

SystemCell::~SystemCell() {
  if (!exit_status()) {
    signal(SIGKILL);
    waitpid(daemon_, nullptr, 0);
  }
  if (testing::Test::HasFailure()) std::fprintf(stderr, "--- log of binpickd ---\n%s---\n", daemon_log().c_str());
}

void SystemCell::start_daemon() {
  exit_status_.reset();
  daemon_ = start(BINPICKD_PROGRAM, {"--config", cell_path_}, log_path_);
}

void SystemCell::signal(int number) const { kill(daemon_, number); }

std::optional<int> SystemCell::exit_status() {
  int status = 0;
  if (!exit_status_ && waitpid(daemon_, &status, WNOHANG) == daemon_) exit_status_ = status_of(status);
  return exit_status_;
}

std::string SystemCell::daemon_log() const { return text_of(log_path_); }

bool SystemCell::run_until(const std::function<bool()>& done, Duration limit) {
  const SystemClock clock;
  TimePoint now = clock.now();
  const TimePoint until = now + limit;
  while (true) {
    plc_->device.set_robot_clear(robot_->device.clear_of_view());
    scanner_->turn(now);
    robot_->turn(now);
    if (poses_) poses_->turn(now);
    plc_->turn(now);
    while (robot_->device.take_event()) {
    }
    if (done()) return true;
    if (now >= until) return false;
    // Processes and the pivot's thread are looked at every 5 ms; everything else wakes the loop.
    const auto next = earlier(earlier(scanner_->deadline(), robot_->deadline()),
                              earlier(plc_->deadline(), poses_ ? poses_->deadline() : std::nullopt));
    now = loop_.wait(earlier(next, std::min(until, now + std::chrono::milliseconds(5))));
  }
}

void SystemCell::run_for(Duration time) {
  run_until([] { return false; }, time);
}

bool SystemCell::run_until_ready(Duration limit) {
  return run_until([this] { return plc().ready(); }, limit);
}

std::optional<emulators::PlcResult> SystemCell::pick() {
  while (plc().take_result()) {
  }
  plc().raise_request(1, 1);
  std::optional<emulators::PlcResult> result;
  run_until([&] { return (result = plc().take_result()).has_value(); });
  return result;
}

bool SystemCell::pivot_moves() {
  const SystemClock clock;
  return pivot_->with([&](emulators::Pivot& pivot) { return pivot.moving(clock.now()); });
}

Ended run_program(const std::string& program, const std::vector<std::string>& arguments) {
  const std::string log_path = test_folder().path() + "/program.err";
  const std::string output_path = test_folder().path() + "/program.out";
  std::remove(log_path.c_str());
  std::remove(output_path.c_str());
  const pid_t child = start(program, arguments, log_path, output_path);
  int status = 0;
  waitpid(child, &status, 0);
  return {status_of(status), text_of(log_path), text_of(output_path)};
}
}  // namespace binpick::support
