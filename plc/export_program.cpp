#include "plc/export_program.hpp"

#include <algorithm>
#include <array>

#include "base/check.hpp"
#include "plc/alarms.hpp"
#include "plc/counterpart.hpp"
#include "plc/export_dialect.hpp"
#include "plc/result_codes.hpp"

namespace binpick::plc {
namespace {
using Kind = Variable::Kind;

constexpr std::array kVariables{
    Variable{"enable", Role::Input, Kind::Bool, "1: talk to the cell."},
    Variable{"start", Role::Input, Kind::Bool, "A pick is wanted. Hold until done or failed, then drop."},
    Variable{"abort", Role::Input, Kind::Bool, "Stop and forget the running cycle."},
    Variable{"reset", Role::Input, Kind::Bool, "Go on after a fault; clears the alarm list."},
    Variable{"robot_clear", Role::Input, Kind::Bool, "The robot is out of the scanner's view."},
    Variable{"new_scan", Role::Input, Kind::Bool,
             "The supply was changed or moved: the next answer comes from a new scan."},
    Variable{"skip_pick", Role::Input, Kind::Bool,
             "The robot will not fetch the last pick: do not wait until it has gone in."},
    Variable{"part_id", Role::Input, Kind::Number, "id of a [[part]] of the cell file."},
    Variable{"supply_id", Role::Input, Kind::Number, "id of a [[supply]] of the cell file."},
    Variable{"connected", Role::Output, Kind::Bool, "Line and map are good."},
    Variable{"ready", Role::Output, Kind::Bool, "The cell would accept a request now."},
    Variable{"busy", Role::Output, Kind::Bool, "A request is under way."},
    Variable{"robot_may_enter", Role::Output, Kind::Bool, "The scan is done; 0 while a scan may come or runs."},
    Variable{"done", Role::Output, Kind::Bool, "result answers the request; until start is dropped."},
    Variable{"failed", Role::Output, Kind::Bool, "No result: abort, time-out or fault; see problem."},
    Variable{"fault", Role::Output, Kind::Bool, "The cell has a fault; raise reset."},
    Variable{"alarm", Role::Output, Kind::Bool, "The cause of at least one alarm is there."},
    Variable{"timed_out", Role::Output, Kind::Bool, "The last request had no answer in time and was aborted."},
    Variable{"step", Role::Output, Kind::Number, "Where the program stands, see the list of steps."},
    Variable{"problem", Role::Output, Kind::Number,
             "0 none, 1 the cell's heartbeat stands still, 2 other map version or length, 3 other word order, "
             "4 time-out, 5 fault of the cell."},
    Variable{"first_alarm", Role::Output, Kind::Number, "The alarm that came first; 0: none."},
    Variable{"not_ready", Role::Output, Kind::Word, "Why ready is 0, as bits."},
    Variable{"result_code", Role::Output, Kind::Number, "Of the last result, see the list of codes."},
    Variable{"result", Role::Output, Kind::Result, "The last result; it stays until the next one."},
    Variable{"request", Role::Inner, Kind::Request, "What is written next."},
    Variable{"status", Role::Inner, Kind::Status, "What was read last."},
    Variable{"answer", Role::Inner, Kind::Result, "What was read last."},
    Variable{"sequence", Role::Inner, Kind::Number, "Number of the last request."},
    Variable{"beat_seen", Role::Inner, Kind::Number, "The cell's heartbeat as it was."},
    Variable{"boot_seen", Role::Inner, Kind::Number, "Which start of the cell this program has met."},
    Variable{"step_seen", Role::Inner, Kind::Number, "The step as it was."},
    Variable{"beat_changed", Role::Inner, Kind::Bool, ""},
    Variable{"beat_known", Role::Inner, Kind::Bool, ""},
    Variable{"map_fits", Role::Inner, Kind::Bool, ""},
    Variable{"order_fits", Role::Inner, Kind::Bool, ""},
    Variable{"line", Role::Inner, Kind::Bool, ""},
    Variable{"line_lost", Role::Inner, Kind::Bool, ""},
    Variable{"own_ack", Role::Inner, Kind::Bool, "ack belongs to this program's request."},
    Variable{"own_result", Role::Inner, Kind::Bool, "The result belongs to this program's request and is whole."},
    Variable{"level_open", Role::Inner, Kind::Bool, "A level waits for its acknowledge."},
    Variable{"pending", Role::Inner, Kind::Bool, "A request was raised and has no result yet."},
    Variable{"taken", Role::Inner, Kind::Bool, "The result was taken."},
    Variable{"robot_owed", Role::Inner, Kind::Bool, "After a pick the robot has to have gone in first."},
    Variable{"t_beat", Role::Inner, Kind::Timer, "The cell's heartbeat."},
    Variable{"t_settle", Role::Inner, Kind::Timer, "The line is good for so long before a request."},
    Variable{"t_answer", Role::Inner, Kind::Timer, "From the request to the result."},
    Variable{"t_level", Role::Inner, Kind::Timer, "From a level to its acknowledge."},
};

constexpr std::array kBlocks{
    Block{"BinPick_Request", kRequestFirst, kRequestLength, "PLC to cell, written with one function 16",
          "PLC to cell, read by the cell"},
    Block{"BinPick_Status", kStatusFirst, kStatusLength, "cell to PLC, read with one function 3 with the result",
          "cell to PLC, written by the cell"},
    Block{"BinPick_Result", kResultFirst, kResultLength, "cell to PLC, read with one function 3 with the status",
          "cell to PLC, written by the cell"},
};

constexpr std::string_view kBefore = R"(// 1. What the cell says.
@beat_changed := (@status.cell_heartbeat <> @beat_seen);
@beat_seen := @status.cell_heartbeat;
!timer t_beat cell NOT @beat_changed
IF @beat_changed THEN
   @beat_known := TRUE;
ELSIF @t_beat.Q THEN
   @beat_known := FALSE;
END_IF;
@map_fits := (@status.map_version = $version) AND (@status.map_length = $length);
@order_fits := (@status.test_f32 = $f32) AND (@status.test_u32 = $u32);
@line := @enable AND @beat_known AND @map_fits AND @order_fits;
@line_lost := (NOT @line) OR (@status.boot_count <> @boot_seen);
@own_ack := @status.status[ack] AND (@status.ack_sequence = @sequence);
@own_result := @status.status[result_valid] AND (@answer.result_sequence = @sequence)
   AND (@answer.result_sequence_tail = @sequence);
IF (NOT @robot_clear) OR @skip_pick THEN
   @robot_owed := FALSE;
END_IF;

// 2. How long things take.
@level_open := (@step = @step_seen) AND ((@step = {Acknowledging})
   OR ((@step = {Aborting}) AND (NOT @status.status[abort_ack]))
   OR ((@step = {Resetting}) AND (NOT @status.status[reset_ack])));
@step_seen := @step;
!timer t_settle settle @line AND (@step = {Offline})
!timer t_answer answer (@step >= {Requesting}) AND (@step <= {WaitResult})
!timer t_level level @level_open

// 3. The handshake, PLC side.
)";

constexpr std::string_view kAfter = R"(
// 4. What is written: levels that belong to the step, and a heartbeat.
// In Idle a result answers what was asked before this program was restarted: nobody waits for it.
IF (@step = {Idle}) AND @status.status[result_valid] THEN
   @request.result_ack := @answer.result_sequence;
END_IF;
)";

constexpr std::string_view kOutputs = R"(IF @request.plc_heartbeat >= 32767 THEN
   @request.plc_heartbeat := 0;
ELSE
   @request.plc_heartbeat := @request.plc_heartbeat + 1;
END_IF;

// 5. Outputs.
@connected := (@step <> {Offline});
@ready := @connected AND @status.status[ready];
@busy := (@step >= {Requesting}) AND (@step <= {Acknowledging});
@robot_may_enter := @connected AND @status.status[scan_done] AND (@step <> {Requesting});
@done := (@step = {Finished}) AND @taken;
@failed := ((@step = {Finished}) AND (NOT @taken)) OR (@step = {Fault});
@fault := @connected AND @status.status[fault];
@alarm := @connected AND @status.status[alarm_active];
@first_alarm := @status.first_alarm;
@not_ready := @status.not_ready;
IF @connected THEN
   IF @fault THEN
      @problem := 5;
   ELSIF @timed_out THEN
      @problem := 4;
   ELSE
      @problem := 0;
   END_IF;
ELSIF NOT @beat_known THEN
   @problem := 1;
ELSIF NOT @map_fits THEN
   @problem := 2;
ELSIF NOT @order_fits THEN
   @problem := 3;
ELSE
   @problem := 0;
END_IF;
)";

std::string_view condition(When when) {
  switch (when) {
    case When::Nothing:
      break;
    case When::LineUpAgain:
      return "@t_settle.Q AND @pending AND @start AND (@status.boot_count = @boot_seen)";
    case When::LineUp:
      return "@t_settle.Q";
    case When::LineLost:
      return "@line_lost";
    case When::AbortWanted:
      return "@abort";
    case When::ResetWanted:
      return "@reset";
    case When::StartWanted:
      // ack still 1: the cell has not yet seen that the last request was dropped.
      return "@start AND @status.status[ready] AND (NOT @status.status[ack]) AND @robot_clear AND (NOT @robot_owed)";
    case When::StartDropped:
      return "NOT @start";
    case When::Acked:
      return "@own_ack";
    case When::ScanDone:
      return "@status.status[scan_done]";
    case When::ResultThere:
      return "@own_result";
    case When::ResultCleared:
      return "NOT @status.status[result_valid]";
    case When::Faulted:
      return "@status.status[fault]";
    case When::FaultGone:
      return "NOT @status.status[fault]";
    case When::AbortAcked:
      return "@status.status[abort_ack] AND (NOT @abort)";
    case When::ResetAcked:
      return "@status.status[reset_ack] AND (NOT @reset)";
    case When::TimedOut:
      return "@t_answer.Q";
    case When::Unanswered:
      return "@t_level.Q";
  }
  BINPICK_CHECK(false);
}

std::string_view statements(Act act) {
  switch (act) {
    case Act::None:
      return "";
    case Act::Meet:
      return "@pending := FALSE;\n@boot_seen := @status.boot_count;\n";
    case Act::ChooseNumber:
      // A PLC that has just started goes on from the number that the cell knows, so that it never repeats one.
      return "IF @sequence = 0 THEN\n   @sequence := @status.ack_sequence;\nEND_IF;\n"
             "!next\n"
             "IF @sequence = @status.ack_sequence THEN\n   !next\nEND_IF;\n"
             "@request.sequence := @sequence;\n@request.part_id := @part_id;\n@request.supply_id := @supply_id;\n"
             "@request.result_ack := 0;\n@pending := TRUE;\n@taken := FALSE;\n@timed_out := FALSE;\n";
    case Act::AskAgain:
      return "@request.result_ack := 0;\n@taken := FALSE;\n@timed_out := FALSE;\n";
    case Act::TakeResult:
      return "!copy result answer\n@result_code := @answer.result_code;\n@taken := TRUE;\n@pending := FALSE;\n"
             "@robot_owed := (@answer.result_code = $found);\n@request.result_ack := @sequence;\n";
    case Act::GiveUp:
      return "@pending := FALSE;\n@taken := FALSE;\n";
    case Act::GiveUpLate:
      return "@pending := FALSE;\n@taken := FALSE;\n@timed_out := TRUE;\n";
  }
  BINPICK_CHECK(false);
}

std::string number(std::uint64_t value) { return std::to_string(value); }
std::string number(PlcStep step) { return number(static_cast<std::uint64_t>(step)); }

std::string indented(std::string_view text, std::size_t columns) {
  std::string out;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = text.find('\n', at);
    const std::string_view line = text.substr(at, end - at);
    if (!line.empty()) out += std::string(columns, ' ') + std::string(line);
    out += '\n';
    if (end == std::string_view::npos) break;
    at = end + 1;
  }
  return out;
}

/// CASE over the steps, one branch per step, made from kPlcRows.
std::string steps() {
  std::string out = "CASE @step OF\n";
  for (const PlcStepText& s : kPlcSteps) {
    out += "   " + number(s.step) + ":  // " + std::string(s.name) + ": " + std::string(s.help) + "\n";
    std::string branch;
    for (const PlcRow& row : kPlcRows) {
      if (row.from != s.step) continue;
      branch += (branch.empty() ? "IF " : "ELSIF ") + std::string(condition(row.on)) + " THEN\n";
      branch += indented(statements(row.act), 3);
      branch += "   @step := " + number(row.to) + ";  // " + std::string(text_of(row.to).name) + "\n";
    }
    out += indented(branch + "END_IF;\n", 6);
  }
  return out + "END_CASE;\n";
}

std::string control_bits() {
  std::string out;
  for (const Bit& bit : kControlBits) {
    std::string value;
    for (const PlcStepText& s : kPlcSteps)
      if ((s.control >> bit.bit & 1) != 0)
        value += (value.empty() ? "" : " OR ") + ("(@step = " + number(s.step) + ")");
    if (value.empty()) value = "@" + std::string(bit.name);  // robot_clear: the input's word
    out += "@request.control[" + std::string(bit.name) + "] := " + value + ";\n";
  }
  return out;
}

std::string_view name_of(const std::optional<PoseConvention>& convention) {
  if (!convention) return "m and rad, or mm and deg: as pose_convention says";
  switch (*convention) {
    case PoseConvention::UniversalRobots:
      return "ur: m, rotation vector in rad";
    case PoseConvention::Fanuc:
      return "fanuc: mm, W P R in deg";
    case PoseConvention::Kawasaki:
      return "kawasaki: mm, O A T in deg";
  }
  return "";
}

std::string unit_of(const Register& r, const ExportOptions& options) {
  const bool length = r.unit == "m or mm", angle = r.unit == "rad or deg";
  if (!options.pose_convention || (!length && !angle)) return std::string(r.unit);
  const bool ur = *options.pose_convention == PoseConvention::UniversalRobots;
  return length ? (ur ? "m" : "mm") : (ur ? "rad" : "deg");
}
}  // namespace

std::span<const Variable> program_variables() { return kVariables; }
std::span<const Block> map_blocks() { return kBlocks; }

std::string_view help_of(const Block& block, const ExportOptions& options) {
  return options.role == LineRole::Client ? block.help_asked : block.help;
}

std::vector<Register> registers_of(const Block& block) {
  std::vector<Register> out;
  for (const Register& r : kRegisters)
    if (r.offset >= block.first && r.offset < block.first + block.length) out.push_back(r);
  return out;
}

std::string comment_of(const Register& r, const ExportOptions& options) {
  const unsigned offset = options.base_address + r.offset;
  std::string out = number((offset < 9999 ? 40001U : 400001U) + offset) + " (word " + number(r.offset) + ")";
  if (const std::string unit = unit_of(r, options); !unit.empty()) out += ", " + unit;
  if (r.type == Type::Bits) {
    out += ", bits:";
    const auto list = [&out](const auto& table) {
      for (const Bit& bit : table) out += " " + number(bit.bit) + " " + std::string(bit.name);
    };
    if (r.name == "control") list(kControlBits);
    if (r.name == "status") list(kStatusBits);
    if (r.name == "not_ready") list(kNotReadyBits);
  }
  if (!r.help.empty()) out += ". " + std::string(r.help);
  return ascii(out);
}

std::vector<std::string> program_head(const ExportOptions& options) {
  std::vector<std::string> out{
      "Bin-picking cell: register map version " + number(kMapVersion) + ", handshake, PLC side.",
      "Written by 'binpick export plc'; do not edit the generated part, export again.",
      "Poses are the tcp in the robot's base, " + std::string(name_of(options.pose_convention)) + ".",
      "Use: enable = 1; wait for connected; set part_id and supply_id, then start = 1 until done or failed.", "Steps:"};
  for (const PlcStepText& s : kPlcSteps)
    out.push_back("  " + number(s.step) + " " + std::string(s.name) + ": " + std::string(s.help));
  out.push_back("States of the cell (cell_state):");
  for (const State state : kStates)
    out.push_back("  " + number(static_cast<std::uint64_t>(state)) + " " + std::string(to_string(state)));
  out.push_back("Result codes:");
  for (const ResultText& r : result_table())
    out.push_back("  " + number(static_cast<std::uint64_t>(r.code)) + " " + std::string(r.name) + ". " +
                  std::string(r.cure));
  out.push_back("Alarms:");
  for (const AlarmText& a : alarm_table())
    out.push_back("  " + number(static_cast<std::uint64_t>(a.alarm)) + " " + std::string(a.name));
  for (std::string& line : out) line = ascii(line);
  return out;
}

std::string program_body(Dialect dialect, const ExportOptions& options) {
  const std::string text =
      std::string(kBefore) + steps() + std::string(kAfter) + control_bits() + std::string(kOutputs);
  return ascii(spoken(dialect, options, text));
}
}  // namespace binpick::plc
