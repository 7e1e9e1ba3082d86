#include "plc/alarms.hpp"

#include <algorithm>
#include <array>

namespace binpick::plc {
namespace {
constexpr std::array kAlarms{
    AlarmText{
        Alarm::PivotNoReply, "pivot does not answer",
        "No frame from the pivot module on the CAN bus within the reply time-out.",
        "Check the logic supply and the CAN cable of the pivot, both terminators, the module id and the bit rate."},
    AlarmText{Alarm::PivotModuleError, "pivot module error",
              "The module reports an error of its own in its state word, or cannot do what is asked of it; the log "
              "says which.",
              "Read the log: remove what blocks or overheats the pivot, or correct the sweep, then reset."},
    AlarmText{Alarm::PivotPowerFault, "pivot without motor supply",
              "The motor supply of the pivot is gone while its logic is alive: emergency stop, most often.",
              "Release the emergency stop, switch the motor supply on, then reset."},
    AlarmText{Alarm::PivotBusOff, "pivot CAN bus off",
              "The CAN controller left the bus after too many errors, or the interface is down.",
              "Check cable, shield, terminators and bit rate; the link comes back by itself once the bus is sound."},
    AlarmText{Alarm::PivotReferenceFailed, "pivot reference failed",
              "The reference run did not end within its time-out, or the module refused it.",
              "Make sure that the pivot can turn freely through its whole range, then reset."},
    AlarmText{Alarm::ScannerNoReply, "scanner does not answer",
              "No connection to the scanner, or no reply to a command within the reply time-out.",
              "Check supply, network cable and address of the scanner; `binpick probe` tries it alone."},
    AlarmText{Alarm::ScannerBadTelegrams, "scanner sends bad telegrams",
              "Bytes from the scanner are not telegrams of its manual: a wrong device or port, or a broken line.",
              "Check that the address belongs to this scanner and that nobody else talks to it."},
    AlarmText{Alarm::ScannerRefused, "scanner refused a command",
              "The scanner answered a command with an error; the log gives the device's reason in words.",
              "Correct the scanner's settings in the cell file as the log says, then reset."},
    AlarmText{Alarm::ScannerNoProfiles, "scanner sends no profiles",
              "Measuring was started, yet no profile arrived in time.",
              "Check that the motor turns and that the scanner shows no error; switch it off and on, then reset."},
    AlarmText{Alarm::ScannerProfilesLost, "profiles lost in a sweep",
              "The scan counter has gaps: more profiles were lost than a sweep may miss.",
              "Give the scanner a network of its own (100 Mbit/s, no hub) and look at the load of the controller."},
    AlarmText{Alarm::ScannerBlind, "scanner sees hardly anything",
              "Nothing was found, and less than 30 % of the supply was measured in this scan: it tells nothing of what "
              "lies there. Goes with the next scan that sees more.",
              "Clean the scanner's window; look at its mount and distance, at the sweep's angles or the robot's path, "
              "and for what is dark, mirrors or shines in; `binpick scan` shows what it sees."},
    AlarmText{Alarm::RobotLost, "robot not connected",
              "The robot's socket closed, or it said nothing for the configured time.",
              "Start the robot's program; check its address and the network."},
    AlarmText{Alarm::RobotBadLine, "robot sent a bad line",
              "The robot sent text that is not a command of the line protocol.",
              "Compare the robot's program with the one in docs/robots."},
    AlarmText{Alarm::RobotPathBroken, "robot broke off the scan path",
              "The robot, which carries the scanner, stopped on its path, was lost on it or did not end it in time.",
              "Clear the stop at the robot's panel, move it out of the bin, start its program, then reset."},
    AlarmText{
        Alarm::RobotPosesLost, "robot's poses do not come",
        "The robot carries the scanner, but where it is does not arrive (RTDE, or its background program).",
        "Check [robot] pose_address or pose_listen, start the background program, look at the log for the reason."},
    AlarmText{Alarm::PlcLost, "PLC not connected", "No Modbus connection of the PLC for longer than allowed.",
              "Check network and PLC; the cell goes on by itself once the PLC writes again."},
    AlarmText{Alarm::PlcHeartbeatStopped, "PLC heartbeat stopped",
              "The PLC is connected, but its heartbeat word did not change within the time-out.",
              "Check that the PLC is in RUN and counts plc_heartbeat up in every write."},
    AlarmText{Alarm::PlcSecondWriter, "second Modbus writer refused",
              "A second connection tried to write while the first one is alive; the log names it.",
              "Let one client write; a panel or engineering station may only read."},
    AlarmText{Alarm::ScanTimeout, "scan took too long",
              "The sweep did not end within plc.scan_timeout_ms after the request was accepted.",
              "Look for an alarm of pivot or scanner beside this one; else raise the time-out, then reset."},
    AlarmText{Alarm::DetectTimeout, "detection took too long", "No result within plc.detect_timeout_ms after the scan.",
              "Lower detection.deadline_ms or raise the time-out; look for other load on the controller, then reset."},
    AlarmText{Alarm::RobotNotClear, "robot not clear of the view",
              "A pick was asked for, but the control bit robot_clear stayed 0, or fell during the sweep.",
              "Move the robot out of the scanner's view, then reset; the PLC waits for robot_clear before it raises a "
              "request."},
    AlarmText{Alarm::VisionFailed, "detection failed",
              "The detection stopped with an error of its own; the log has the text.",
              "Check the knowledge base of this part (`binpick train` again), then reset; keep the log for a report."},
    AlarmText{
        Alarm::SupplyNotFound, "supply not found",
        "The supply is located in every scan (supply.locate), and its rim is not seen, or stands too far off; the log "
        "has the reason with numbers.",
        "Put the supply to its place and clear its rim, then reset; look at supply.size_mm and at how far the sweep "
        "reaches."},
    AlarmText{Alarm::ConfigurationRefused, "configuration refused",
              "An edited cell file has errors; the old configuration is in force.",
              "Run `binpick check` on the file, correct it, reload again."},
    AlarmText{Alarm::ConfigurationNeedsRestart, "configuration needs a restart",
              "A reload changed keys that take effect only at a start; the log names them.",
              "Restart binpickd between two picks, or take the edit back."},
    AlarmText{
        Alarm::RecordsNotWritten, "records are not written",
        "The records of cycles cannot be written: the disk is full, too slow, or the folder refuses them. Picking "
        "goes on.",
        "Make room on the disk or lower record.size_max_mb; the log says what failed."},
};
static_assert(std::ranges::is_sorted(kAlarms, {}, &AlarmText::alarm));
}  // namespace

std::span<const AlarmText> alarm_table() { return kAlarms; }

std::string_view to_string(Alarm alarm) {
  if (alarm == Alarm::None) return "none";
  const auto* text = std::ranges::find(kAlarms, alarm, &AlarmText::alarm);
  return text == kAlarms.end() ? "unknown alarm" : text->name;
}
}  // namespace binpick::plc
