#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace binpick::plc {
/// Alarm codes as the PLC reads them. Values never change. Cause and cure of each stand in alarm_table().
enum class Alarm : std::uint16_t {
  None = 0,
  PivotNoReply = 100,
  PivotModuleError = 101,
  PivotPowerFault = 102,  ///< Motor supply gone: emergency stop, most often.
  PivotBusOff = 103,
  PivotReferenceFailed = 104,
  ScannerNoReply = 200,
  ScannerBadTelegrams = 201,
  ScannerRefused = 202,
  ScannerNoProfiles = 203,
  ScannerProfilesLost = 204,
  ScannerBlind = 205,  ///< Nothing found, and hardly anything of the supply was measured.
  RobotLost = 300,
  RobotBadLine = 301,
  RobotPathBroken = 302,  ///< It carries the scanner, and did not come to the end of its path.
  RobotPosesLost = 303,   ///< It carries the scanner, and does not say where it is.
  PlcLost = 400,
  PlcHeartbeatStopped = 401,
  PlcSecondWriter = 402,
  ScanTimeout = 500,
  DetectTimeout = 501,
  RobotNotClear = 502,
  VisionFailed = 600,
  SupplyNotFound = 601,        ///< It is to be located, and is not where it may be.
  ConfigurationRefused = 700,  ///< A reload was refused; the old configuration is in force.
  ConfigurationNeedsRestart = 701,
  RecordsNotWritten = 710,  ///< Cycles go on without.
};

/// One line of the alarm list as it stands on a panel: what, why, what to do.
struct AlarmText {
  Alarm alarm;
  std::string_view name;
  std::string_view cause;
  std::string_view cure;
};
/// All alarms in order of code; None is not among them.
std::span<const AlarmText> alarm_table();
/// The name in alarm_table(); "none" for None, "unknown alarm" for a number that is no alarm.
std::string_view to_string(Alarm alarm);
}  // namespace binpick::plc
