#include <iterator>

#include "config/keys.hpp"

namespace binpick::config {
namespace {
/// A choice of an enumeration: its values in the order of `choices`.
template <class Enum, std::size_t n>
Chosen chosen(Enum& target, const Enum (&values)[n]) {
  std::vector<Enum> list(std::begin(values), std::end(values));
  return {
      [&target, list](std::size_t i) { target = list.at(i); },
      [&target, list] { return static_cast<std::size_t>(std::find(list.begin(), list.end(), target) - list.begin()); }};
}
constexpr const char* kSick = "scanner.model = lms400";
constexpr const char* kLeuze = "scanner.model = lps36, lps36hi";
constexpr const char* kOnPivot = "scanner.carrier = pivot";
constexpr const char* kOnRobot = "scanner.carrier = robot";
}  // namespace

// A table, one key each: the formatter would give every field its own line.
// clang-format off
const std::vector<Section<Config>>& cell_sections() {
  using enum Type;
  using C = Config;
  constexpr Change kRestart = Change::Restart;
  static const std::vector<Section<Config>> sections = {
      {"cell",
       "The cell as a whole.",
       {
           {{.name = "name", .type = Text, .default_value = "\"cell\"", .example = "\"demo\"",
             .help = "Name of the cell in the log."},
            [](C& c) -> Slot { return &c.name; }},
           {{.name = "state_dir", .type = Path, .default_value = "\"/var/lib/binpick\"", .change = kRestart,
             .help = "Folder for what must survive a restart (the boot counter). The service owns it."},
            [](C& c) -> Slot { return &c.state_dir; }},
           {{.name = "picture_dir", .type = Path, .default_value = "\"\"",
             .help = "A picture of each cycle's detection (PNG) goes to this folder; empty: none."},
            [](C& c) -> Slot { return &c.picture_dir; }},
       }},
      {"plc",
       "The PLC asks for picks over Modbus/TCP (docs/plc-registers.md), in one of two roles.",
       {
           {{.name = "role", .type = Choice, .default_value = "\"server\"", .change = kRestart,
             .choices = {"server", "client"},
             .help = "What the daemon is: server, and the PLC connects to listen (MB_CLIENT); or client, and the daemon "
                     "polls the PLC's own server at address (MB_SERVER)."},
            [](C& c) -> Slot { return chosen(c.plc.role, {plc::LineRole::Server, plc::LineRole::Client}); }},
           {{.name = "listen", .type = Endpoint, .default_value = "\"0.0.0.0:502\"", .change = kRestart,
             .help = "Role server: address and port to listen on. Ports below 1024 need the capability that the "
                     "service has."},
            [](C& c) -> Slot { return &c.plc_listen; }},
           {{.name = "address", .type = Endpoint, .default_value = "\"\"", .change = kRestart,
             .help = "Role client: of the PLC's Modbus server, \"192.168.0.10:502\" for example."},
            [](C& c) -> Slot { return &c.plc.address; }},
           {{.name = "unit_id", .type = Integer, .max = 255, .default_value = "255", .change = kRestart,
             .help = "Role client: unit id of every request; the replies have to carry the same."},
            [](C& c) -> Slot { return &c.plc.unit_id; }},
           {{.name = "poll_ms", .type = Integer, .unit = "ms", .min = 5, .max = 1000, .default_value = "20",
             .change = kRestart,
             .help = "Role client: from the beginning of one poll to that of the next, where the PLC is fast enough."},
            [](C& c) -> Slot { return &c.plc.poll; }},
           {{.name = "reply_timeout_ms", .type = Integer, .unit = "ms", .min = 50, .max = 10000,
             .default_value = "1000", .change = kRestart,
             .help = "Role client: a request without a reply for this long ends the connection; it is opened anew."},
            [](C& c) -> Slot { return &c.plc.reply_timeout; }},
           {{.name = "word_order", .type = Choice, .default_value = "\"s7\"", .change = kRestart,
             .choices = {"s7", "logix"},
             .help = "Order of the two words of a 32-bit value: s7 has the high word first, logix (COP) the low "
                     "one."},
            [](C& c) -> Slot {
              return chosen(c.plc.word_order, {plc::WordOrder::HighWordFirst, plc::WordOrder::LowWordFirst});
            }},
           {{.name = "pose_convention", .type = Choice, .default_value = "\"ur\"", .change = kRestart,
             .choices = {"ur", "fanuc", "kawasaki"},
             .help = "How poses stand in the result block: ur is metres and a rotation vector, fanuc is mm and W "
                     "P R in degrees, kawasaki is mm and O A T in degrees."},
            [](C& c) -> Slot {
              using enum plc::PoseConvention;
              return chosen(c.plc.pose_convention, {UniversalRobots, Fanuc, Kawasaki});
            }},
           {{.name = "base_address", .type = Integer, .max = 65000, .default_value = "0", .change = kRestart,
             .help = "Modbus address (counted from 0) of the first register of the map."},
            [](C& c) -> Slot { return &c.plc.base_address; }},
           {{.name = "allow", .type = Addresses, .default_value = "[]", .example = "[\"192.168.0.10\"]",
             .help = "Role server: addresses that may connect, the PLC's first of all. This machine itself always may, any "
                     "other is refused."},
            [](C& c) -> Slot { return &c.plc.allow; }},
           {{.name = "connections_max", .type = Integer, .min = 1, .max = 16, .default_value = "8",
             .help = "Role server: connections at the same time; one of them may write."},
            [](C& c) -> Slot { return &c.plc.connections_max; }},
           {{.name = "heartbeat_timeout_ms", .type = Integer, .unit = "ms", .max = 60000, .default_value = "3000",
             .help = "The PLC's heartbeat word unchanged for this long is an alarm; 0: it is not watched."},
            [](C& c) -> Slot { return &c.plc.heartbeat_timeout; }},
           {{.name = "scan_timeout_ms", .type = Integer, .unit = "ms", .min = 1000, .max = 120000,
             .default_value = "15000",
             .help = "From the accepted request to the last profile; longer is a fault."},
            [](C& c) -> Slot { return &c.plc.scan_timeout; }},
           {{.name = "detect_timeout_ms", .type = Integer, .unit = "ms", .min = 200, .max = 120000,
             .default_value = "5000",
             .help = "From the last profile to the result; longer is a fault."},
            [](C& c) -> Slot { return &c.plc.detect_timeout; }},
       }},
      {"pivot",
       "The Schunk PR 70 that turns the scanner.",
       {
           {{.name = "can", .type = CanBus, .only_for = kOnPivot, .in_example = true,
             .required = true, .example = "\"can0\"", .change = kRestart,
             .help = "The CAN bus: a network interface (can0), or cannelloni://HOST:PORT for CAN over UDP."},
            [](C& c) -> Slot { return &c.pivot_can; }},
           {{.name = "can_listen_port", .type = Integer, .max = 65535, .only_for = kOnPivot, .in_example = true,
             .default_value = "0", .change = kRestart,
             .help = "Own UDP port for cannelloni; 0: any."},
            [](C& c) -> Slot { return &c.pivot_can_listen_port; }},
           {{.name = "protocol", .type = Choice, .only_for = kOnPivot, .in_example = true,
             .default_value = "\"powercube\"", .change = kRestart,
             .choices = {"powercube", "motion"},
             .help = "What the module speaks: powercube (older electronics) or motion (Schunk Motion Protocol, newer "
                     "ones). `binpick probe` tells which it answers."},
            [](C& c) -> Slot {
              using enum drivers::pivot::Protocol;
              return chosen(c.pivot.protocol, {PowerCube, Motion});
            }},
           {{.name = "module_id", .type = Integer, .min = 1, .max = 255, .only_for = kOnPivot, .in_example = true,
             .default_value = "12", .change = kRestart,
             .help = "The module's number on the bus; PowerCube modules have 1 to 31."},
            [](C& c) -> Slot { return &c.pivot.module_id; }},
           {{.name = "reply_timeout_ms", .type = Integer, .unit = "ms", .min = 10, .max = 5000,
             .only_for = kOnPivot, .in_example = true,
             .default_value = "100", .change = kRestart,
             .help = "Silence after a request before it is repeated, then given up."},
            [](C& c) -> Slot { return &c.pivot.reply_timeout; }},
           {{.name = "sample_period_ms", .type = Integer, .unit = "ms", .min = 2, .max = 100, .only_for = kOnPivot, .in_example = true,
             .default_value = "10",
             .change = kRestart,
             .help = "The module's position is asked this often."},
            [](C& c) -> Slot { return &c.pivot.sample_period; }},
           {{.name = "setpoint_horizon_ms", .type = Integer, .unit = "ms", .min = 20, .max = 2000,
             .only_for = kOnPivot, .in_example = true,
             .default_value = "200", .change = kRestart,
             .help = "While moving, the module knows no target further ahead than this: so long it moves on when "
                     "the daemon vanishes (with protocol = motion at least as long as it needs to brake)."},
            [](C& c) -> Slot { return &c.pivot.setpoint_horizon; }},
           {{.name = "reference_timeout_s", .type = Integer, .unit = "s", .min = 1, .max = 300,
             .only_for = kOnPivot, .in_example = true,
             .default_value = "30", .change = kRestart,
             .help = "The module's homing takes no longer than this."},
            [](C& c) -> Slot { return &c.pivot.reference_timeout; }},
           {{.name = "latency_ms", .type = Number, .unit = "ms", .min = -200, .max = 200, .only_for = kOnPivot, .in_example = true,
             .default_value = "0",
             .help = "Added to the time of each position: how much later it was really taken than the answer says."},
            [](C& c) -> Slot { return &c.pivot_latency; }},
           {{.name = "T_base_pivot", .type = Transform, .only_for = kOnPivot, .in_example = true,
             .required = true,
             .example = "{ xyz_mm = [1200, 0, 1860], rpy_deg = [0, 90, 0] }",
             .help = "Where the pivot stands in the robot's base frame. Its z axis is the axis of rotation."},
            [](C& c) -> Slot { return &c.mount.T_base_pivot.iso; }},
       }},
      {"scanner",
       "The line scanner.",
       {
           {{.name = "model", .type = Choice, .required = true, .example = "\"lms400\"", .change = kRestart,
             .choices = {"lms400", "lps36", "lps36hi"},
             .help = "lms400: SICK LMS 400 (TCP); lps36, lps36hi: Leuze LPS 36 and LPS 36 HI (UDP)."},
            [](C& c) -> Slot {
              using enum ScannerModel;
              return chosen(c.scanner_model, {Lms400, Lps36, Lps36Hi});
            }},
           {{.name = "address", .type = Endpoint, .required = true, .example = "\"192.168.0.1:2111\"",
             .change = kRestart,
             .help = "Of the scanner. An LPS 36 as delivered is at 192.168.60.3:9008."},
            [](C& c) -> Slot { return &c.scanner_address; }},
           {{.name = "listen_port", .type = Integer, .max = 65535, .only_for = kLeuze, .default_value = "5634",
             .change = kRestart,
             .help = "Own UDP port, to which the scanner sends its telegrams; 0: any."},
            [](C& c) -> Slot { return &c.scanner_listen_port; }},
           {{.name = "exposure", .type = Choice, .only_for = kLeuze, .default_value = "\"device\"",
             .change = kRestart,
             .choices = {"device", "normal", "bright", "dark", "normal_to_bright", "manual"},
             .help = "device: as it was set up with the maker's program. Dark targets want \"dark\"."},
            [](C& c) -> Slot {
              using enum drivers::lps36::Exposure;
              using Exposure = std::optional<drivers::lps36::Exposure>;
              return chosen(c.lps36.exposure, {Exposure{}, Exposure{Normal}, Exposure{Bright}, Exposure{Dark},
                                               Exposure{NormalToBright}, Exposure{Manual}});
            }},
           {{.name = "manual_exposure_us", .type = Integer, .unit = "us", .min = 74, .max = 1310, .only_for = kLeuze,
             .sample = "300", .change = kRestart,
             .help = "With exposure = \"manual\". An LPS 36 takes no less than 98."},
            [](C& c) -> Slot { return &c.manual_exposure_us; }},
           {{.name = "frequency_hz", .type = Number, .unit = "Hz", .min = 150, .max = 500, .only_for = kSick, .in_example = true, .default_value = "360",
             .change = kRestart,
             .help = "Profiles per second. The device may set another value; it is then used and logged."},
            [](C& c) -> Slot { return &c.lms400.frequency_hz; }},
           {{.name = "resolution_deg", .type = Number, .unit = "deg", .min = 0.1, .max = 1, .only_for = kSick, .in_example = true, .default_value = "0.25",
             .change = kRestart,
             .help = "Between the points of a profile."},
            [](C& c) -> Slot { return &c.lms400.resolution; }},
           {{.name = "start_deg", .type = Number, .unit = "deg", .min = 55, .max = 125, .only_for = kSick, .in_example = true, .default_value = "55",
             .example = "70", .change = kRestart,
             .help = "Device angle of the first point; 90 is straight ahead."},
            [](C& c) -> Slot { return &c.lms400.start; }},
           {{.name = "range_deg", .type = Number, .unit = "deg", .min = 1, .max = 70, .only_for = kSick, .in_example = true, .default_value = "70",
             .example = "40", .change = kRestart,
             .help = "Opening angle; start_deg + range_deg is 125 at most."},
            [](C& c) -> Slot { return &c.lms400.range; }},
           {{.name = "extended_remission", .type = Flag, .only_for = kSick, .in_example = true, .default_value = "false", .change = kRestart,
             .help = "For dark targets, remission below 10 %."},
            [](C& c) -> Slot { return &c.lms400.extended_remission; }},
           {{.name = "filter_mask", .type = Integer, .max = 15, .only_for = kSick, .in_example = true, .default_value = "0", .change = kRestart,
             .help = "The device's own filters, added up: 1 median, 2 edge, 4 range, 8 mean."},
            [](C& c) -> Slot { return &c.lms400.filter_mask; }},
           {{.name = "reply_timeout_ms", .type = Integer, .unit = "ms", .min = 50, .max = 10000,
             .only_for = kSick, .in_example = true, .default_value = "1000", .change = kRestart,
             .help = "Silence after a command before giving up."},
            [](C& c) -> Slot { return &c.lms400.reply_timeout; }},
           {{.name = "spin_up_timeout_ms", .type = Integer, .unit = "ms", .min = 1000, .max = 60000,
             .only_for = kSick, .in_example = true, .default_value = "10000", .change = kRestart,
             .help = "The same for commands after which the motor has to settle."},
            [](C& c) -> Slot { return &c.lms400.spin_up_timeout; }},
           {{.name = "profile_timeout_ms", .type = Integer, .unit = "ms", .min = 50, .max = 1000,
             .default_value = "500", .change = kRestart,
             .help = "Silence while measuring before it is a fault."},
            [](C& c) -> Slot { return &c.lms400.profile_timeout; }},
           {{.name = "latency_ms", .type = Number, .unit = "ms", .min = -200, .max = 200, .default_value = "0",
             .help = "A profile was measured this much before it came in."},
            [](C& c) -> Slot { return &c.scanner_latency; }},
           {{.name = "T_pivot_scanner", .type = Transform, .only_for = kOnPivot, .in_example = true, .required = true,
             .example = "{ xyz_mm = [60, 0, 0], rpy_deg = [180, -90, 0] }",
             .help = "Where the scanner sits on the pivot at angle zero. Its z axis points straight ahead, x lies "
                     "in the scan plane."},
            [](C& c) -> Slot { return &c.mount.T_pivot_scanner.iso; }},
           {{.name = "carrier", .type = Choice, .default_value = "\"pivot\"", .change = kRestart,
             .choices = {"pivot", "robot"},
             .help = "What moves it over the supply: the pivot, or the robot, which carries it along a taught path "
                     "(docs/robots/)."},
            [](C& c) -> Slot { return chosen(c.carrier, {Carrier::Pivot, Carrier::Robot}); }},
           {{.name = "T_flange_scanner", .type = Transform, .only_for = kOnRobot, .required = true,
             .example = "{ xyz_mm = [0, 80, 120], rpy_deg = [0, 0, 0] }",
             .help = "Where the scanner sits on the robot's flange. Its z axis points straight ahead, x lies in the "
                     "scan plane."},
            [](C& c) -> Slot { return &c.T_flange_scanner.iso; }},
       }},
      {"record",
       "A file of each cycle, to look into it again: `binpick replay` (docs/records.md).",
       {
           {{.name = "dir", .type = Path, .default_value = "\"\"",
             .help = "Folder for them, made when it is not there; empty: nothing is recorded."},
            [](C& c) -> Slot { return &c.record.dir; }},
           {{.name = "size_max_mb", .type = Number, .unit = "MB", .min = 1, .max = 1e6, .default_value = "500",
             .help = "All records together; the oldest are removed. A cycle needs one to five."},
            [](C& c) -> Slot { return &c.record.size_max_mb; }},
       }},
      {"robot",
       "The socket that the robot's program fetches picks from (docs/robots/).",
       {
           {{.name = "dialect", .type = Choice, .default_value = "\"ur\"", .change = kRestart,
             .choices = {"ur", "fanuc", "kawasaki"},
             .help = "Make of the controller: how answers are written to its socket. ur: metres and a rotation vector, "
                     "fanuc: mm and W P R in degrees, kawasaki: mm and O A T in degrees (docs/robots/)."},
            [](C& c) -> Slot {
              using enum drivers::robot::Dialect;
              return chosen(c.robot.dialect, {UniversalRobots, Fanuc, Kawasaki});
            }},
           {{.name = "listen", .type = Endpoint, .default_value = "\"\"", .example = "\"0.0.0.0:5002\"",
             .change = kRestart,
             .help = "Address and port to listen on; empty: no robot connects, the PLC forwards the movement."},
            [](C& c) -> Slot { return &c.robot_listen; }},
           {{.name = "allow", .type = Addresses, .default_value = "[]", .example = "[\"192.168.0.20\"]",
             .help = "Addresses that may connect. This machine itself always may, any other is refused."},
            [](C& c) -> Slot { return &c.robot_allow; }},
           {{.name = "silence_max_s", .type = Integer, .unit = "s", .min = 1, .max = 3600, .default_value = "60",
             .change = kRestart,
             .help = "A robot that says nothing for this long is taken for gone."},
            [](C& c) -> Slot { return &c.robot.silence_max; }},
           {{.name = "pose_address", .type = Endpoint, .only_for = kOnRobot, .default_value = "\"\"",
             .example = "\"192.168.0.20:30004\"", .change = kRestart,
             .help = "For dialect ur: where its poses come from by RTDE, the controller's port 30004."},
            [](C& c) -> Slot { return &c.pose_address; }},
           {{.name = "pose_listen", .type = Endpoint, .only_for = kOnRobot, .default_value = "\"\"",
             .example = "\"0.0.0.0:5003\"", .change = kRestart,
             .help = "For dialect fanuc and kawasaki: where its background program sends its poses to."},
            [](C& c) -> Slot { return &c.pose_listen; }},
           {{.name = "pose_latency_ms", .type = Number, .unit = "ms", .min = -200, .max = 200, .only_for = kOnRobot,
             .default_value = "0",
             .help = "A pose was measured this much before its time stamp says."},
            [](C& c) -> Slot { return &c.pose_latency; }},
           {{.name = "T_flange_tcp", .type = Transform, .only_for = kOnRobot,
             .default_value = "{ xyz_mm = [0, 0, 0], rpy_deg = [0, 0, 0] }", .change = kRestart,
             .help = "The tcp whose pose the robot sends. Not for ur from software 3.12 or 5.5.1 on: it tells by itself."},
            [](C& c) -> Slot { return &c.T_flange_tcp.iso; }},
       }},
      {"reach",
       "What the gripper can reach.",
       {
           {{.name = "tilt_max_deg", .type = Number, .unit = "deg", .max = 90, .default_value = "40",
             .help = "Between the tcp's z axis and straight down into the supply."},
            [](C& c) -> Slot { return InRadians{&c.reach.tilt_max_rad}; }},
           {{.name = "wall_clearance_mm", .type = Number, .unit = "mm", .max = 1000, .default_value = "0",
             .help = "The tcp stays this far inside the supply's walls."},
            [](C& c) -> Slot { return &c.reach.wall_clearance_mm; }},
           {{.name = "clearance_mm", .type = Number, .unit = "mm", .max = 1000, .sample = "1",
             .help = "Gripper and held part stay this far from walls, floor and all that was measured. Default: 0.3 of "
                     "the noise of the part's scanner class. Where there is more room, a grasp goes first."},
            [](C& c) -> Slot { return &c.reach.clearance_mm; }},
           {{.name = "unmeasured", .type = Choice, .default_value = "\"blocked\"", .choices = {"free", "blocked", "last"},
             .help = "What stands where the scanner saw nothing: nothing; or what surrounds that place goes on in it, and "
                     "a shadow hides as much as it can. With \"free\" such grasps are still the last choice; with \"last\" "
                     "they are offered only where nothing else can be taken."},
            [](C& c) -> Slot {
              using enum vision::Unmeasured;
              return chosen(c.reach.unmeasured, {Free, Blocked, Last});
            }},
           {{.name = "radius_max_mm", .type = Number, .unit = "mm", .max = 20000, .default_value = "0",
             .help = "The tcp stays within this distance of the origin of the robot's base, at the grasp and at the "
                     "approach pose; 0: no limit."},
            [](C& c) -> Slot { return &c.reach.radius_max_mm; }},
           {{.name = "axis_min_mm", .type = Number, .unit = "mm", .max = 20000, .default_value = "0",
             .help = "And this far from the z axis of the robot's base."},
            [](C& c) -> Slot { return &c.reach.axis_min_mm; }},
       }},
      {"detection",
       "Finding the objects.",
       {
           {{.name = "threads", .type = Integer, .min = 1, .max = 64, .default_value = "2",
             .help = "The result does not depend on it."},
            [](C& c) -> Slot { return &c.detection.threads; }},
           {{.name = "deadline_ms", .type = Integer, .unit = "ms", .min = 100, .max = 60000, .default_value = "3000",
             .help = "After this the best found so far is answered. Shorter than plc.detect_timeout_ms."},
            [](C& c) -> Slot { return &c.detection.deadline; }},
           {{.name = "search", .type = Choice, .default_value = "\"exhaustive\"",
             .choices = {"exhaustive", "votes"},
             .help = "exhaustive: every trained view is tried at every maximum; votes: only what the features vote for."},
            [](C& c) -> Slot {
              return chosen(c.detection.search, {vision::Search::Exhaustive, vision::Search::Votes});
            }},
       }},
      {"picks",
       "How many picks one scan is good for, and what is remembered of those that failed.",
       {
           {{.name = "per_scan", .type = Integer, .min = 1, .max = 100, .default_value = "1",
             .help = "Picks that are answered from one scan at most, the next ones at once and without a sweep. More than "
                     "1 needs a PLC that raises new_scan when the supply was changed or moved."},
            [](C& c) -> Slot { return &c.picks.per_scan; }},
           {{.name = "scan_valid_ms", .type = Integer, .unit = "ms", .min = 1000, .max = 600000, .default_value = "60000",
             .help = "An older scan is not used again."},
            [](C& c) -> Slot { return &c.picks.scan_valid; }},
           {{.name = "margin_mm", .type = Number, .unit = "mm", .min = 0, .max = 1000, .default_value = "10",
             .help = "Seen from above, the next object stands so far apart from all that were picked from the scan, and "
                     "from what touched these: it has not moved with them."},
            [](C& c) -> Slot { return &c.picks.margin_mm; }},
           {{.name = "failed_scans", .type = Integer, .min = 0, .max = 1000, .default_value = "10",
             .help = "For so many scans a failed pick is remembered: its object comes after all others, and is left alone "
                     "when a second one has failed, or the first where another object may lie on it. 0: not at all."},
            [](C& c) -> Slot { return &c.picks.failed_scans; }},
       }},
  };
  return sections;
}

const Section<Supply>& supply_section() {
  using enum Type;
  using S = Supply;
  static const Section<Supply> section = {
      "supply",
      "A charge carrier and the sweep over it. One entry for each place that the PLC can name.",
      {
          {{.name = "id", .type = Integer, .min = 1, .max = 65535, .required = true, .example = "1",
            .help = "By which the PLC names it."},
           [](S& s) -> Slot { return &s.id; }},
          {{.name = "name", .type = Text, .default_value = "\"\"", .example = "\"lattice box\"",
            .help = "For the log."},
           [](S& s) -> Slot { return &s.name; }},
          {{.name = "size_mm", .type = Vector, .unit = "mm", .min = 0, .max = 5000, .required = true,
            .example = "[1000, 800, 500]",
            .help = "Inside: along x, along y, height of the walls. Height 0: none, the window over a belt."},
           [](S& s) -> Slot { return &s.size_mm; }},
          {{.name = "T_base_supply", .type = Transform, .required = true,
            .example = "{ xyz_mm = [1200, 0, 0], rpy_deg = [0, 0, 0] }",
            .help = "Middle of its floor in the robot's base frame, z up, x and y along the walls."},
           [](S& s) -> Slot { return &s.T_base_supply.iso; }},
          {{.name = "locate", .type = Flag, .default_value = "false",
            .help = "The supply is found by its rim in every scan, and T_base_supply is corrected by that. The sweep has to "
                    "reach beyond the walls."},
           [](S& s) -> Slot { return &s.locate; }},
          {{.name = "locate_offset_max_mm", .type = Number, .unit = "mm", .min = 1, .max = 500, .default_value = "80",
            .help = "A supply that stands farther from its place, along x or y, is refused."},
           [](S& s) -> Slot { return &s.place_limits.offset_mm; }},
          {{.name = "locate_turn_max_deg", .type = Number, .unit = "deg", .min = 0.5, .max = 20, .default_value = "10",
            .help = "Turned by more, it is refused."},
           [](S& s) -> Slot { return InRadians{&s.place_limits.turn_rad}; }},
          {{.name = "sweep_start_deg", .type = Number, .unit = "deg", .min = -160, .max = 160, .only_for = kOnPivot, .in_example = true,
            .required = true,
            .example = "-16",
            .help = "Pivot angle at which measuring begins. The module's own limits hold too."},
           [](S& s) -> Slot { return &s.sweep_start; }},
          {{.name = "sweep_end_deg", .type = Number, .unit = "deg", .min = -160, .max = 160, .only_for = kOnPivot, .in_example = true,
            .required = true,
            .example = "16",
            .help = "Pivot angle at which it ends."},
           [](S& s) -> Slot { return &s.sweep_end; }},
          {{.name = "sweep_speed_deg_s", .type = Number, .unit = "deg/s", .min = 1, .max = 149,
            .only_for = kOnPivot, .in_example = true,
            .default_value = "30", .example = "34",
            .help = "Slower gives more profiles."},
           [](S& s) -> Slot { return InRadians{&s.sweep_speed_rad_s}; }},
          {{.name = "scan_path", .type = Integer, .min = 1, .max = 999, .only_for = kOnRobot, .default_value = "1",
            .help = "The path over it, by the number that the robot's program knows."},
           [](S& s) -> Slot { return &s.scan_path; }},
          {{.name = "path_timeout_ms", .type = Integer, .unit = "ms", .min = 500, .max = 120000, .only_for = kOnRobot,
            .default_value = "10000",
            .help = "From the beginning of the path to its end; longer is a fault. plc.scan_timeout_ms holds for this and "
                    "for the robot's way to the beginning."},
           [](S& s) -> Slot { return &s.path_timeout; }},
      }};
  return section;
}

const Section<RecipeEntry>& recipe_section() {
  using enum Type;
  using R = RecipeEntry;
  static const Section<RecipeEntry> section = {
      "part",
      "A recipe: a part that the PLC can ask for.",
      {
          {{.name = "id", .type = Integer, .min = 1, .max = 65535, .required = true, .example = "1",
            .help = "By which the PLC names it."},
           [](R& r) -> Slot { return &r.recipe.id; }},
          {{.name = "file", .type = Path, .required = true, .example = "\"track_link.toml\"",
            .help = "Its PART.toml."},
           [](R& r) -> Slot { return &r.file; }},
          {{.name = "knowledge_base", .type = Path, .required = true, .example = "\"track_link.kb\"",
            .help = "Made of the part file by binpick train."},
           [](R& r) -> Slot { return &r.recipe.knowledge_base; }},
          {{.name = "score_min", .type = Number, .max = 1, .default_value = "0.5",
            .help = "An object found with a lower probability is not offered."},
           [](R& r) -> Slot { return &r.recipe.score_min; }},
          {{.name = "tilt_max_deg", .type = Number, .unit = "deg", .max = 90, .sample = "30",
            .help = "For this part instead of reach.tilt_max_deg."},
           [](R& r) -> Slot { return InRadiansIfGiven{&r.recipe.tilt_max_rad}; }},
      }};
  return section;
}
// clang-format on
}  // namespace binpick::config
