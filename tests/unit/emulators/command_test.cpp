#include "tests/emulators/program/command.hpp"

#include <fstream>
#include <gtest/gtest.h>
#include <sstream>
#include <string>

namespace binpick::emulators {
namespace {
using namespace std::chrono_literals;

FaultCommand fault(std::string_view line) {
  const auto command = parse_command(line);
  EXPECT_TRUE(command) << line << ": " << (command ? "" : command.error());
  if (!command || !std::holds_alternative<FaultCommand>(*command)) return {Device::Pivot, [](Faults&) {}, "?"};
  return std::get<FaultCommand>(*command);
}
}  // namespace

TEST(EmulatorCommand, FaultsAreSwitchedOnAndOff) {
  const FaultCommand on = fault("scanner silent on");
  EXPECT_EQ(on.device, Device::Scanner);
  EXPECT_EQ(on.text, "scanner silent on");
  Faults faults;
  on.apply(faults);
  EXPECT_TRUE(faults.silent);
  fault("  scanner   silent off\r").apply(faults);
  EXPECT_FALSE(faults.silent);
  fault("pivot emergency_stop").apply(faults);
  EXPECT_TRUE(faults.emergency_stop);
  EXPECT_EQ(fault("pivot emergency_stop").text, "pivot emergency_stop on");
}

TEST(EmulatorCommand, EachFaultOfTheStructHasItsWord) {
  Faults faults;
  for (const char* name :
       {"unplugged", "silent", "garbage", "split_every_byte", "wrong_id", "emergency_stop", "bus_off"})
    fault("robot " + std::string(name)).apply(faults);
  fault("plc delay 250").apply(faults);
  fault("plc disconnect_after_bytes 100").apply(faults);
  fault("plc error_code 17").apply(faults);
  EXPECT_TRUE(faults.unplugged && faults.silent && faults.garbage && faults.split_every_byte && faults.wrong_id &&
              faults.emergency_stop && faults.bus_off);
  EXPECT_EQ(faults.delay, 250ms);
  EXPECT_EQ(faults.disconnect_after_bytes, 100U);
  EXPECT_EQ(faults.error_code, 17U);
  fault("plc error_code off").apply(faults);
  EXPECT_EQ(faults.error_code, std::nullopt);
  fault("plc healthy").apply(faults);
  EXPECT_FALSE(faults.unplugged || faults.silent || faults.disconnect_after_bytes || faults.delay > 0ms);
}

TEST(EmulatorCommand, OrdersAreWholeLines) {
  const auto order = parse_command("robot restart");
  ASSERT_TRUE(order);
  EXPECT_EQ(std::get<Order>(*order).kind, Order::Kind::RobotRestart);
  EXPECT_EQ(std::get<Order>(*parse_command(" quit ")).kind, Order::Kind::Quit);
}

TEST(EmulatorCommand, WhatIsNotUnderstoodIsSaid) {
  const auto error = [](std::string_view line) {
    const auto command = parse_command(line);
    return command ? std::string("understood") : command.error();
  };
  EXPECT_EQ(error("scanner sielnt"),
            "no fault \"sielnt\"; there are: unplugged, silent, garbage, split_every_byte, wrong_id, emergency_stop, "
            "bus_off, delay MS, disconnect_after_bytes N, error_code N, healthy");
  EXPECT_EQ(error("camera silent"), "no command \"camera silent\"; \"help\" lists all");
  EXPECT_EQ(error("scanner silent maybe"), "\"silent\" is on or off, not \"maybe\"");
  EXPECT_EQ(error("scanner delay"), "\"delay\" needs milliseconds, 0 ... 60000");
  EXPECT_EQ(error("scanner delay 1s"), "\"delay\" needs milliseconds, 0 ... 60000");
  EXPECT_EQ(error("scanner error_code x"), "\"error_code\" needs a number, or off");
  EXPECT_EQ(error("scanner silent on please"), "\"please\" is too much after \"silent on\"");
  for (const char* line : {"", "scanner", "quit now", "\xff\xfe", "pivot delay 99999999999"})
    EXPECT_NE(error(line), "understood") << line;
}

TEST(EmulatorCommand, ThePageNamesEveryCommand) {
  std::ifstream file{std::string(BINPICK_SOURCE_DIR) + "/docs/emulators.md"};
  std::stringstream page;
  page << file.rdbuf();
  std::istringstream help{command_help()};
  std::string line;
  std::getline(help, line);
  while (std::getline(help, line)) {
    const std::string command = line.substr(2, line.find("  ", 2) - 2);
    EXPECT_NE(page.str().find("`" + command + "`"), std::string::npos) << command;
  }
}
}  // namespace binpick::emulators
