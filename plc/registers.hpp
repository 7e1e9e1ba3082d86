#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

/// The register map: the one place where it is written down. docs/plc-registers.md is generated from it.
/// Offsets are 0-based Modbus addresses relative to plc.base_address. Names, offsets, types and bits are an interface:
/// they change only together with kMapVersion.
namespace binpick::plc {
enum class Type : std::uint8_t { U16, I16, U32, F32, Bits };
enum class Direction : std::uint8_t { PlcToCell, CellToPlc };

struct Register {
  std::string_view name;
  std::uint16_t offset = 0;
  Type type = Type::U16;
  Direction direction = Direction::CellToPlc;
  std::string_view unit;
  std::string_view help;
};

struct Bit {
  std::uint8_t bit = 0;
  std::string_view name;
  std::string_view help;
};

inline constexpr std::uint16_t kMapVersion = 2;
inline constexpr float kTestF32 = 123456.0F;           ///< 0x47F12000.
inline constexpr std::uint32_t kTestU32 = 0x01020304;  ///< 0102 0304 high word first.

/// The block that the PLC writes, all of it in one FC16; control is its last word.
inline constexpr std::uint16_t kRequestFirst = 0;
inline constexpr std::uint16_t kRequestLength = 8;
inline constexpr std::uint16_t kStatusFirst = 8;
inline constexpr std::uint16_t kStatusLength = 32;
inline constexpr std::uint16_t kResultFirst = 40;
inline constexpr std::uint16_t kResultLength = 48;
inline constexpr std::uint16_t kMapLength = 88;
inline constexpr std::size_t kAlarmListLength = 8;

inline constexpr std::array kRegisters{
    // clang-format off
    // Request block, PLC → cell.
    Register{"plc_heartbeat", 0, Type::U16, Direction::PlcToCell, "", "Counted up by the PLC at least once a second; the cell alarms when it stands still for plc.heartbeat_timeout_ms."},
    Register{"sequence", 1, Type::U16, Direction::PlcToCell, "", "Number of the request, 1 … 65535, then 1 again. A new number asks for new work, the same number again for the same answer. 0: no request."},
    Register{"part_id", 2, Type::U16, Direction::PlcToCell, "", "Recipe: id of a [[part]] of the cell file."},
    Register{"supply_id", 3, Type::U16, Direction::PlcToCell, "", "id of a [[supply]] of the cell file."},
    Register{"result_ack", 4, Type::U16, Direction::PlcToCell, "", "Written with the result's sequence number once it is read: the result is cleared. Write 0 with the next request."},
    Register{"request_reserved_5", 5, Type::U16, Direction::PlcToCell, "", "Write 0."},
    Register{"request_reserved_6", 6, Type::U16, Direction::PlcToCell, "", "Write 0."},
    Register{"control", 7, Type::Bits, Direction::PlcToCell, "", "Control bits, the last word of the block: all else is there when request is seen."},
    // Status block, cell → PLC.
    Register{"map_version", 8, Type::U16, Direction::CellToPlc, "", "Version of this map, 2. Check it once after connecting."},
    Register{"map_length", 9, Type::U16, Direction::CellToPlc, "words", "Length of this map, 88. Check it once after connecting."},
    Register{"test_f32", 10, Type::F32, Direction::CellToPlc, "", "Always 123456.0: 47F1 2000 with the high word first (S7), 2000 47F1 with the low word first (Logix)."},
    Register{"test_u32", 12, Type::U32, Direction::CellToPlc, "", "Always 16909060 (0x01020304): 0102 0304 with the high word first, 0304 0102 with the low word first."},
    Register{"boot_count", 14, Type::U16, Direction::CellToPlc, "", "Changes with every start of the cell controller."},
    Register{"cell_heartbeat", 15, Type::U16, Direction::CellToPlc, "", "Counted up by the cell every 0.5 s; alarm in the PLC when it stands still for 3 s."},
    Register{"cell_state", 16, Type::U16, Direction::CellToPlc, "", "State of the handshake, see the table of states."},
    Register{"status", 17, Type::Bits, Direction::CellToPlc, "", "Status bits."},
    Register{"ack_sequence", 18, Type::U16, Direction::CellToPlc, "", "Sequence number that the bit ack belongs to; the last one answered. 0 after a start."},
    Register{"not_ready", 19, Type::Bits, Direction::CellToPlc, "", "Why the bit ready is 0; 0 when it is 1."},
    Register{"first_alarm", 20, Type::U16, Direction::CellToPlc, "", "The alarm that came first since the last reset; 0: none."},
    Register{"alarm_count", 21, Type::U16, Direction::CellToPlc, "", "Alarms in the list (those beyond eight are counted too)."},
    Register{"alarm_1", 22, Type::U16, Direction::CellToPlc, "", "Alarms since the last reset in the order in which they came. One whose cause has gone stays until reset."},
    Register{"alarm_2", 23, Type::U16, Direction::CellToPlc, "", ""},
    Register{"alarm_3", 24, Type::U16, Direction::CellToPlc, "", ""},
    Register{"alarm_4", 25, Type::U16, Direction::CellToPlc, "", ""},
    Register{"alarm_5", 26, Type::U16, Direction::CellToPlc, "", ""},
    Register{"alarm_6", 27, Type::U16, Direction::CellToPlc, "", ""},
    Register{"alarm_7", 28, Type::U16, Direction::CellToPlc, "", ""},
    Register{"alarm_8", 29, Type::U16, Direction::CellToPlc, "", ""},
    Register{"last_alarm", 30, Type::U16, Direction::CellToPlc, "", "The latest alarm since the start; a reset does not clear it."},
    Register{"alarms_total", 31, Type::U16, Direction::CellToPlc, "", "Alarms raised since the start: it changes with each one, also while the PLC was away."},
    Register{"picks_total", 32, Type::U16, Direction::CellToPlc, "", "Results with code 1 since the start."},
    Register{"cycles_total", 33, Type::U16, Direction::CellToPlc, "", "Requests accepted since the start."},
    Register{"word_order", 34, Type::U16, Direction::CellToPlc, "", "0: high word first, 1: low word first (plc.word_order)."},
    Register{"pose_convention", 35, Type::U16, Direction::CellToPlc, "", "0: ur, 1: fanuc, 2: kawasaki (plc.pose_convention), see the table of conventions."},
    Register{"status_reserved_36", 36, Type::U16, Direction::CellToPlc, "", "0."},
    Register{"status_reserved_37", 37, Type::U16, Direction::CellToPlc, "", "0."},
    Register{"status_reserved_38", 38, Type::U16, Direction::CellToPlc, "", "0."},
    Register{"status_reserved_39", 39, Type::U16, Direction::CellToPlc, "", "0."},
    // Result block, cell → PLC.
    Register{"result_sequence", 40, Type::U16, Direction::CellToPlc, "", "Sequence number of the request that this answers (head)."},
    Register{"result_code", 41, Type::U16, Direction::CellToPlc, "", "How it went, see the table of result codes."},
    Register{"pick_id", 42, Type::U16, Direction::CellToPlc, "", "Number of the pick; the robot's socket gives the same pick under the same number. 0: no pick."},
    Register{"result_part_id", 43, Type::U16, Direction::CellToPlc, "", "Part that was asked for."},
    Register{"result_supply_id", 44, Type::U16, Direction::CellToPlc, "", "Supply that was asked for."},
    Register{"objects_left", 45, Type::U16, Direction::CellToPlc, "", "Objects found beside this one."},
    Register{"fill_level", 46, Type::U16, Direction::CellToPlc, "%", "How full the supply is, by volume."},
    Register{"unreachable_reason", 47, Type::U16, Direction::CellToPlc, "", "With result code 12: why most of the objects cannot be taken, see the table of reasons. Else 0."},
    Register{"score", 48, Type::F32, Direction::CellToPlc, "", "Probability that the detection is right, 0 … 1."},
    Register{"approach_x", 50, Type::F32, Direction::CellToPlc, "m or mm", "Approach pose: the tcp in the robot's base, in the configured convention."},
    Register{"approach_y", 52, Type::F32, Direction::CellToPlc, "m or mm", ""},
    Register{"approach_z", 54, Type::F32, Direction::CellToPlc, "m or mm", ""},
    Register{"approach_a", 56, Type::F32, Direction::CellToPlc, "rad or deg", "First angle: rx, W or O."},
    Register{"approach_b", 58, Type::F32, Direction::CellToPlc, "rad or deg", "Second angle: ry, P or A."},
    Register{"approach_c", 60, Type::F32, Direction::CellToPlc, "rad or deg", "Third angle: rz, R or T."},
    Register{"grasp_x", 62, Type::F32, Direction::CellToPlc, "m or mm", "Grasp pose, likewise. Come straight down to the approach pose, go to the grasp in a straight line, then in a straight line to the retreat position, then straight up (docs/picking.md)."},
    Register{"grasp_y", 64, Type::F32, Direction::CellToPlc, "m or mm", ""},
    Register{"grasp_z", 66, Type::F32, Direction::CellToPlc, "m or mm", ""},
    Register{"grasp_a", 68, Type::F32, Direction::CellToPlc, "rad or deg", ""},
    Register{"grasp_b", 70, Type::F32, Direction::CellToPlc, "rad or deg", ""},
    Register{"grasp_c", 72, Type::F32, Direction::CellToPlc, "rad or deg", ""},
    Register{"retreat_x", 74, Type::F32, Direction::CellToPlc, "m or mm", "Retreat position of the tcp, with the part; the angles stay those of the grasp. Often straight above it."},
    Register{"retreat_y", 76, Type::F32, Direction::CellToPlc, "m or mm", ""},
    Register{"retreat_z", 78, Type::F32, Direction::CellToPlc, "m or mm", ""},
    Register{"sweep_ms", 80, Type::U16, Direction::CellToPlc, "ms", "Duration of the sweep."},
    Register{"profiles", 81, Type::U16, Direction::CellToPlc, "", "Profiles of the sweep."},
    Register{"points", 82, Type::U32, Direction::CellToPlc, "", "Measured points."},
    Register{"hypotheses", 84, Type::U32, Direction::CellToPlc, "", "Hypotheses tested."},
    Register{"detection_ms", 86, Type::U16, Direction::CellToPlc, "ms", "Duration of the detection."},
    Register{"result_sequence_tail", 87, Type::U16, Direction::CellToPlc, "", "The same number as result_sequence; take the result only when both are equal."},
    // clang-format on
};

/// Bits of `control`. Levels, never pulses: hold each until its acknowledge is seen.
namespace control {
inline constexpr std::uint16_t kRequest = 1 << 0, kAbort = 1 << 1, kReset = 1 << 2, kRobotClear = 1 << 3,
                               kNewScan = 1 << 4;
}
inline constexpr std::array kControlBits{
    Bit{0, "request", "A pick is wanted. Raise with or after the rest of the block, drop when ack is seen."},
    Bit{1, "abort",
        "Stop and forget the running cycle, clear the result. Hold until abort_ack; while it is 1, requests are "
        "refused."},
    Bit{2, "reset", "Go on after a fault; clears the alarm list. Hold until reset_ack."},
    Bit{3, "robot_clear",
        "The robot is out of the scanner's view. No sweep is made while this is 0, unless the robot carries the "
        "scanner."},
    Bit{4, "new_scan",
        "With a request: the supply was changed or moved, what is known of it does not hold. Without it, the answer "
        "may "
        "come from the scan before (picks.per_scan)."},
};

/// Bits of `status`.
namespace status {
inline constexpr std::uint16_t kReady = 1 << 0, kAck = 1 << 1, kBusy = 1 << 2, kResultValid = 1 << 3,
                               kScanDone = 1 << 4, kFault = 1 << 5, kAbortAck = 1 << 6, kResetAck = 1 << 7,
                               kAlarm = 1 << 8;
}
inline constexpr std::array kStatusBits{
    Bit{0, "ready", "A request would be accepted now. While it is 0, not_ready tells why."},
    Bit{1, "ack", "The request with number ack_sequence was seen (accepted or refused). Falls after request falls."},
    Bit{2, "busy", "A cycle is running."},
    Bit{3, "result_valid",
        "The result block answers request result_sequence. Stays until result_ack or the next request."},
    Bit{4, "scan_done", "The scan of the last accepted request is done: the robot may enter. Falls with the next one."},
    Bit{5, "fault", "A fault ended the cycle or stands; first_alarm tells which. Needs reset."},
    Bit{6, "abort_ack", "abort was seen and carried out. Falls with abort."},
    Bit{7, "reset_ack", "reset was seen. Falls with reset."},
    Bit{8, "alarm_active", "The cause of at least one alarm is still there."},
};

/// Bits of `not_ready`; values are those of NotReady in plc/session.hpp.
inline constexpr std::array kNotReadyBits{
    Bit{0, "pivot", "The pivot is not referenced, or not there."},
    Bit{1, "scanner", "The scanner is not there, or not set up yet."},
    Bit{2, "robot", "The robot is not connected."},
    Bit{3, "vision", "A knowledge base is missing, or the detection has not started."},
    Bit{4, "configuration", "The configuration is not usable."},
    Bit{5, "alarm", "A fault stands; raise reset once its cause is gone."},
    Bit{6, "cycle_running", "A cycle is running."},
    Bit{7, "result_pending", "A result waits for result_ack (a new request is accepted all the same)."},
    Bit{8, "starting", "The cell controller has just started."},
    Bit{9, "stopping", "The cell controller is being stopped."},
};

constexpr std::uint16_t words(Type type) { return type == Type::U32 || type == Type::F32 ? 2 : 1; }

/// Offset of a register by its name; a name that is not in the map does not compile.
consteval std::uint16_t at(std::string_view name) {
  for (const Register& r : kRegisters)
    if (r.name == name) return r.offset;
  throw "no such register";
}

namespace detail {
constexpr bool map_has_no_gap_or_overlap() {
  std::uint16_t next = 0;
  for (const Register& r : kRegisters) {
    if (r.offset != next) return false;
    next = static_cast<std::uint16_t>(next + words(r.type));
  }
  return next == kMapLength;
}
/// Logix aligns 32-bit members to 4 bytes: within each block a 32-bit value starts at an even word, so that a COP from
/// the INT array fits the UDT without a hole.
constexpr bool long_values_are_aligned() {
  return std::ranges::all_of(kRegisters, [](const Register& r) {
    const std::uint16_t first = r.offset >= kResultFirst ? kResultFirst : r.offset >= kStatusFirst ? kStatusFirst : 0;
    return words(r.type) == 1 || (r.offset - first) % 2 == 0;
  });
}
constexpr bool directions_follow_blocks() {
  return std::ranges::all_of(kRegisters, [](const Register& r) {
    return (r.direction == Direction::PlcToCell) == (r.offset < kRequestFirst + kRequestLength);
  });
}
constexpr bool names_are_unique() {
  for (const Register& r : kRegisters)
    if (std::ranges::count(kRegisters, r.name, &Register::name) != 1) return false;
  return true;
}
}  // namespace detail
static_assert(detail::map_has_no_gap_or_overlap());
static_assert(detail::long_values_are_aligned());
static_assert(detail::directions_follow_blocks());
static_assert(detail::names_are_unique());
static_assert(kStatusFirst == kRequestFirst + kRequestLength && kResultFirst == kStatusFirst + kStatusLength);
static_assert(kResultFirst + kResultLength == kMapLength && kStatusFirst % 2 == 0 && kResultFirst % 2 == 0);
static_assert(kStatusLength + kResultLength <= 125, "status and result are read in one request");
static_assert(kRequestLength <= 121, "the request block is written in one request, by function 23 too");
static_assert(at("control") == kRequestFirst + kRequestLength - 1, "the request bits are the last word written");
static_assert(at("result_sequence") == kResultFirst && at("result_sequence_tail") == kMapLength - 1);
static_assert(at("alarm_8") == at("alarm_1") + kAlarmListLength - 1);
}  // namespace binpick::plc
