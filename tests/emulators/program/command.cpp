#include "tests/emulators/program/command.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <sstream>
#include <vector>

namespace binpick::emulators {
namespace {
struct Switch {
  std::string_view name;
  bool Faults::*member;
  std::string_view help;
};
constexpr std::array kSwitches{
    Switch{"unplugged", &Faults::unplugged, "no link at all: connections are cut and refused, frames vanish"},
    Switch{"silent", &Faults::silent, "the link stands, nothing is answered or sent"},
    Switch{"garbage", &Faults::garbage, "bytes are corrupted"},
    Switch{"split_every_byte", &Faults::split_every_byte, "one byte per segment"},
    Switch{"wrong_id", &Faults::wrong_id, "answers under another id (CAN id, Modbus protocol id, pick id)"},
    Switch{"emergency_stop", &Faults::emergency_stop, "motor supply gone, logic alive (pivot, robot)"},
    Switch{"bus_off", &Faults::bus_off, "CAN controller bus-off (pivot)"},
};

struct OrderWord {
  std::string_view text;
  Order::Kind kind;
  std::string_view help;
};
constexpr std::array kOrders{
    OrderWord{"pick", Order::Kind::Pick, "the emulated PLC asks for one pick"},
    OrderWord{"take", Order::Kind::Take, "the highest object vanishes from the bin, as if a robot had taken it"},
    OrderWord{"refill", Order::Kind::Refill, "the bin is filled anew, with the next seed"},
    OrderWord{"robot restart", Order::Kind::RobotRestart, "the robot's program is stopped and started, where it is"},
    OrderWord{"robot stop_on_path", Order::Kind::RobotStopOnPath,
              "it stops in the middle of its next scan path, until \"robot restart\""},
    OrderWord{"plc restart", Order::Kind::PlcRestart, "power cycle of the PLC"},
    OrderWord{"plc abort", Order::Kind::PlcAbort, "the PLC raises abort"},
    OrderWord{"plc reset", Order::Kind::PlcReset, "the PLC raises reset"},
    OrderWord{"pivot power_cycle", Order::Kind::PivotPowerCycle, "24 V of the pivot off and on: its reference is lost"},
    OrderWord{"status", Order::Kind::Status, "where everything stands"},
    OrderWord{"help", Order::Kind::Help, "this list"},
    OrderWord{"quit", Order::Kind::Quit, "ends the program"},
};

constexpr std::array kDevices{Device::Pivot, Device::Scanner, Device::Robot, Device::Poses, Device::Plc};

std::vector<std::string> split(std::string_view line) {
  std::istringstream stream{std::string(line)};
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

std::optional<std::uint32_t> number(const std::string& word) {
  std::uint32_t value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc{} || end != word.data() + word.size()) return std::nullopt;
  return value;
}

std::string fault_names() {
  std::string names;
  for (const Switch& one : kSwitches) names += std::string(one.name) + ", ";
  return names + "delay MS, disconnect_after_bytes N, error_code N, healthy";
}

Expected<Command, std::string> parse_fault(Device device, const std::vector<std::string>& words) {
  FaultCommand command{device, {}, std::string(to_string(device))};
  for (std::size_t i = 1; i < words.size(); ++i) command.text += " " + words[i];
  const std::string& fault = words[1];
  if (fault == "healthy" && words.size() == 2) {
    command.apply = [](Faults& faults) { faults = {}; };
    return command;
  }
  const std::string value = words.size() > 2 ? words[2] : "";
  if (words.size() > 3) return unexpected("\"" + words[3] + "\" is too much after \"" + fault + " " + value + "\"");
  for (const Switch& one : kSwitches) {
    if (one.name != fault) continue;
    if (!value.empty() && value != "on" && value != "off")
      return unexpected("\"" + fault + "\" is on or off, not \"" + value + "\"");
    if (value.empty()) command.text += " on";
    command.apply = [member = one.member, on = value != "off"](Faults& faults) { faults.*member = on; };
    return command;
  }
  const auto n = number(value);
  if (fault == "delay") {
    if (!n || *n > 60'000) return unexpected(std::string("\"delay\" needs milliseconds, 0 ... 60000"));
    command.apply = [ms = *n](Faults& faults) { faults.delay = std::chrono::milliseconds(ms); };
  } else if (fault == "disconnect_after_bytes" || fault == "error_code") {
    if (!n && value != "off") return unexpected("\"" + fault + "\" needs a number, or off");
    if (fault == "error_code")
      command.apply = [n](Faults& faults) { faults.error_code = n; };
    else
      command.apply = [n](Faults& faults) { faults.disconnect_after_bytes = n; };
  } else {
    return unexpected("no fault \"" + fault + "\"; there are: " + fault_names());
  }
  return command;
}
}  // namespace

std::string_view to_string(Device device) {
  switch (device) {
    case Device::Pivot:
      return "pivot";
    case Device::Scanner:
      return "scanner";
    case Device::Robot:
      return "robot";
    case Device::Poses:
      return "poses";
    case Device::Plc:
      return "plc";
  }
  return "?";
}

Expected<Command, std::string> parse_command(std::string_view line) {
  const auto words = split(line);
  if (words.empty()) return unexpected(std::string("empty command; \"help\" lists all"));
  std::string joined;
  for (const auto& word : words) joined += (joined.empty() ? "" : " ") + word;
  const auto* order = std::ranges::find(kOrders, joined, &OrderWord::text);
  if (order != kOrders.end()) return Order{order->kind};
  const auto* device = std::ranges::find(kDevices, words[0], [](Device d) { return to_string(d); });
  if (device == kDevices.end()) return unexpected("no command \"" + joined + "\"; \"help\" lists all");
  if (words.size() < 2) return unexpected("\"" + joined + "\" what? There are: " + fault_names());
  return parse_fault(*device, words);
}

std::string command_help() {
  std::string text;
  const auto add = [&text](const std::string& command, std::string_view help) {
    text += "  " + command + std::string(command.size() < 34 ? 34 - command.size() : 1, ' ') + std::string(help) + "\n";
  };
  text += "DEVICE is pivot, scanner, robot, poses (of a robot that carries the scanner) or plc.\n";
  for (const Switch& one : kSwitches) add("DEVICE " + std::string(one.name) + " [on/off]", one.help);
  add("DEVICE delay MS", "added to every answer");
  add("DEVICE disconnect_after_bytes N", "the device cuts its link once, after N more bytes");
  add("DEVICE error_code N/off", "the device answers with this error of its own");
  add("DEVICE healthy", "all its faults off");
  for (const OrderWord& one : kOrders) add(std::string(one.text), one.help);
  return text;
}
}  // namespace binpick::emulators
