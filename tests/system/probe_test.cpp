#include <future>
#include <gtest/gtest.h>
#include <string>

#include "tests/emulators/program/ports.hpp"
#include "tests/emulators/program/pose_port.hpp"
#include "tests/system/system_cell.hpp"

/// `binpick probe` on an emulated module over UDP: which protocol does it speak, and what is to be written.
namespace binpick::support {
namespace {
class ProbeProgram : public testing::TestWithParam<std::pair<const char*, const char*>> {};  // configured, spoken
}  // namespace

TEST_P(ProbeProgram, TellsWhatTheModuleSpeaksAndMovesNothing) {
  using drivers::pivot::Protocol;
  const auto [configured, spoken] = GetParam();
  CellFile file;
  file.pivot = configured;
  file.robot_port = 0;
  file.plc_port = free_port(SOCK_STREAM);
  file.scanner_port = free_port(SOCK_STREAM);
  file.can_port = free_port(SOCK_DGRAM);
  const std::string path = test_folder().write(file, "probe.toml");
  emulators::PivotOptions options;
  options.protocol = std::string(spoken) == "motion" ? Protocol::Motion : Protocol::PowerCube;
  emulators::PivotPort pivot{"cannelloni://127.0.0.1:" + std::to_string(file.can_port), options};
  const Ended said = run_program(BINPICK_PROGRAM, {"probe", path});
  const char* name = to_string(options.protocol);
  if (std::string(configured) == spoken) {
    EXPECT_NE(said.output.find(std::string(name) + " module 12"), std::string::npos) << said.output;
    EXPECT_NE(said.output.find("serial 12345678"), std::string::npos) << said.output;
    EXPECT_NE(said.output.find("not referenced"), std::string::npos) << said.output;
  } else {
    EXPECT_NE(said.output.find("write protocol = \"" + std::string(spoken) + "\" under [pivot] in " + path),
              std::string::npos)
        << said.output;
  }
  EXPECT_EQ(said.status, 1) << "no scanner is there";
  pivot.with([](emulators::Pivot& module) { EXPECT_EQ(module.reference_runs(), 0U); });
  EXPECT_EQ(pivot.angle_at(SystemClock{}.now()), options.start);
}
INSTANTIATE_TEST_SUITE_P(Both, ProbeProgram,
                         testing::Values(std::pair{"motion", "motion"}, std::pair{"powercube", "motion"},
                                         std::pair{"motion", "powercube"}));

namespace {
/// A cell whose robot carries the scanner; nothing answers but what a test plays.
CellFile carried_cell(const std::string& robot) {
  CellFile file;
  file.robot = robot;
  file.scan_path = 1;
  file.plc_port = free_port(SOCK_STREAM);
  file.scanner_port = free_port(SOCK_STREAM);
  file.robot_port = free_port(SOCK_STREAM);
  file.pose_port = free_port(SOCK_STREAM);
  return file;
}

/// `binpick probe` beside a robot that tells its poses.
Ended probe_with_poses(const CellFile& file, bool is_there) {
  const std::string path = test_folder().write(file, "poses.toml");
  const auto config = config::load(path);
  drivers::link::Loop loop;
  const emulators::FlangeMotion still = [](TimePoint) {
    Transform<frame::Base, frame::Flange> T;
    T.iso.translation() = Eigen::Vector3d{400, -300, 900};
    return T;
  };
  std::optional<emulators::PosePort> poses;
  if (is_there) poses.emplace(loop, config.value(), drivers::link::Endpoint{"127.0.0.1", file.pose_port}, still, 1);
  auto said = std::async(std::launch::async, [&] { return run_program(BINPICK_PROGRAM, {"probe", path}); });
  const SystemClock clock;
  while (said.wait_for(std::chrono::seconds(0)) != std::future_status::ready) {
    const TimePoint now = clock.now();
    if (poses) poses->turn(now);
    loop.wait(earlier(poses ? poses->deadline() : std::nullopt, now + std::chrono::milliseconds(20)));
  }
  return said.get();
}
}  // namespace

TEST(ProbeProgramOfACarriedScanner, TakesThePosesAsTheDaemonWould) {
  for (const char* robot : {"ur", "fanuc"}) {
    const CellFile file = carried_cell(robot);
    const Ended said = probe_with_poses(file, true);
    const std::string from = "poses    127.0.0.1:" + std::to_string(file.pose_port) + ": " +
                             (std::string{robot} == "ur" ? "controller software 5.11.0, " : "from 127.0.0.1: ");
    EXPECT_NE(said.output.find(from), std::string::npos) << said.output;
    EXPECT_NE(said.output.find(" poses per second, their times known within "), std::string::npos) << said.output;
    EXPECT_NE(said.output.find("the flange is at 400, -300, 900 mm"), std::string::npos) << said.output;
  }
}

TEST(ProbeProgramOfACarriedScanner, SaysWhyNoPosesCome) {
  Ended said = probe_with_poses(carried_cell("ur"), false);
  EXPECT_EQ(said.status, 1);
  EXPECT_NE(said.output.find(": no connection: Connection refused; check address, port (30004)"), std::string::npos)
      << said.output;
  said = probe_with_poses(carried_cell("kawasaki"), false);
  EXPECT_EQ(said.status, 1);
  EXPECT_NE(said.output.find(": the port is free, but nobody sends poses to it; start the robot's background program"),
            std::string::npos)
      << said.output;
}
}  // namespace binpick::support
