#include <gtest/gtest.h>
#include <string>

#include "tests/emulators/program/ports.hpp"
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
}  // namespace binpick::support
