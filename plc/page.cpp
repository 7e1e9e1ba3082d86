#include "plc/page.hpp"

#include <set>
#include <span>
#include <utility>

#include "plc/alarms.hpp"
#include "plc/handshake.hpp"
#include "plc/registers.hpp"
#include "plc/result_codes.hpp"

namespace binpick::plc {
namespace {
std::string_view name_of(Type type) {
  switch (type) {
    case Type::U16:
      return "u16";
    case Type::I16:
      return "i16";
    case Type::U32:
      return "u32";
    case Type::F32:
      return "f32";
    case Type::Bits:
      return "bits";
  }
  return "?";
}

std::string_view meaning(Signal signal) {
  switch (signal) {
    case Signal::DevicesReady:
      return "all devices are there";
    case Signal::DevicesMissing:
      return "a device went away";
    case Signal::NewRequest:
      return "`request` rose with a new number, part and supply are known";
    case Signal::BadRequest:
      return "`request` rose, but part, supply or number are wrong, a device is missing, or `abort` stands";
    case Signal::RepeatedRequest:
      return "`request` rose with the number of the last accepted request";
    case Signal::StandingRequest:
      return "`request` was already 1 when the cell came up";
    case Signal::RequestDropped:
      return "`request` fell";
    case Signal::ScanComplete:
      return "the sweep is done";
    case Signal::DetectionDone:
      return "the detection has an answer";
    case Signal::ResultAcked:
      return "`result_ack` was changed to `result_sequence`";
    case Signal::AbortRaised:
      return "`abort` rose";
    case Signal::ResetRaised:
      return "`reset` rose";
    case Signal::FaultRaised:
      return "a device failed in a cycle, or the detection did";
    case Signal::Deadline:
      return "`plc.scan_timeout_ms` or `plc.detect_timeout_ms` passed";
  }
  return "?";
}

std::string_view meaning(Effect effect) {
  switch (effect) {
    case Effect::None:
      return "";
    case Effect::AcceptAndScan:
      return "`ack`, `busy`; result cleared; a sweep starts";
    case Effect::Refuse:
      return "`ack`, and at once a result with the code that says why";
    case Effect::RefuseNotReady:
      return "`ack`, and at once result code 31";
    case Effect::RepeatResult:
      return "`ack`, and at once the stored result; no sweep";
    case Effect::AckAgain:
      return "`ack`; the running cycle goes on and answers it";
    case Effect::DropAck:
      return "`ack` falls";
    case Effect::StartDetection:
      return "`scan_done`: the robot may enter";
    case Effect::PublishResult:
      return "result block filled, `result_valid`";
    case Effect::ClearResult:
      return "result block zero, `result_valid` falls";
    case Effect::StopAndClear:
      return "pivot stopped, cycle forgotten, result block zero";
    case Effect::RaiseFault:
      return "alarm; cycle forgotten, result block zero";
    case Effect::TimeOut:
      return "alarm; pivot stopped, cycle forgotten, result block zero";
    case Effect::ClearFault:
      return "alarms whose cause has gone are forgotten; devices are tried again";
  }
  return "?";
}

std::string_view meaning(State state) {
  switch (state) {
    case State::NotReady:
      return "Something is missing; `not_ready` tells what.";
    case State::Ready:
      return "A request is accepted at once.";
    case State::Scanning:
      return "The sweep runs (or waits for `robot_clear`).";
    case State::Detecting:
      return "The scan is done, the answer is being computed; the robot may enter.";
    case State::ResultValid:
      return "A result waits to be acknowledged; a new request is accepted, too.";
    case State::Fault:
      return "A fault ended the cycle; `reset` leads on.";
  }
  return "?";
}

/// Rows of equal state pair are one arrow.
std::string diagram() {
  std::string out = "```mermaid\nstateDiagram-v2\n    [*] --> NotReady\n";
  std::set<std::pair<State, State>> drawn;
  for (const Row& row : kRows) {
    if (row.from == row.to || !drawn.insert({row.from, row.to}).second) continue;
    std::string labels;
    for (const Row& other : kRows)
      if (other.from == row.from && other.to == row.to)
        labels += (labels.empty() ? "" : ", ") + std::string(to_string(other.on));
    out += "    " + std::string(to_string(row.from)) + " --> " + std::string(to_string(row.to)) + ": " + labels + "\n";
  }
  return out + "```\n";
}

std::string registers(std::uint16_t first, std::uint16_t length) {
  std::string out = "| 0-based | 40001 | 400001 | name | type | unit | meaning |\n|---|---|---|---|---|---|---|\n";
  for (const Register& r : kRegisters) {
    if (r.offset < first || r.offset >= first + length) continue;
    out += "| " + std::to_string(r.offset) + " | " + std::to_string(40001 + r.offset) + " | " +
           std::to_string(400001 + r.offset) + " | `" + std::string(r.name) + "` | " + std::string(name_of(r.type)) +
           " | " + std::string(r.unit) + " | " + std::string(r.help) + " |\n";
  }
  return out;
}

std::string bits(std::span<const Bit> table) {
  std::string out = "| bit | value | name | meaning |\n|---|---|---|---|\n";
  for (const Bit& b : table)
    out += "| " + std::to_string(b.bit) + " | " + std::to_string(1U << b.bit) + " | `" + std::string(b.name) + "` | " +
           std::string(b.help) + " |\n";
  return out;
}

constexpr std::string_view kHead = R"(# The PLC's registers

<!-- Generated from plc/registers.hpp, plc/handshake.hpp, plc/alarms.cpp and plc/result_codes.cpp. Do not edit:
     change the tables, then `cmake --build build/release --target plc_docs_write`. -->

Everything that a PLC programmer needs to ask the cell for picks, without any other page. All of it is made from the tables
that the program runs on.

## The line

* Modbus/TCP. The cell is the server (`plc.listen` of the cell file, usually port 502), the PLC is the client. Any unit id. With
  `plc.role = "client"` it is the other way round: [see below](#the-other-way-round-the-plc-is-the-server).
* Functions 3 and 4 read (both the same words), 6, 16 and 23 write, 8/0 echoes. Everything else is refused.
* **Write the whole request block** (words 0 … 7) with one function 16, in every poll. **Read status and result** (words 8 … 87,
  80 words) with one function 3, in every poll. A poll of 20 … 100 ms is right.
* Peers other than this machine itself have to stand in `plc.allow`.
* One client writes: the first that does. A second one may read; its writes are refused with exception 6 until the first one
  has closed or has been silent for 2 s.
* Words are 16 bits, high byte first, as Modbus says. 32-bit values take two words in the order `plc.word_order`: `s7`
  (high word first, ABCD) or `logix` (low word first, CDAB). The words `test_f32` and `test_u32` show which one it is:
  with `s7` they read 47F1 2000 0102 0304, with `logix` 2000 47F1 0304 0102.
* Addresses below hold for `plc.base_address = 0`; another base is added to each. "0-based" is what stands in the frame,
  40001 and 400001 are what Siemens and others write for the same word.

| exception | means here |
|---|---|
| 1 | this function is not served |
| 2 | a word outside the map, or a write outside the request block |
| 3 | a count or length that does not fit |
| 6 | another client writes already |

### The other way round: the PLC is the server

With `plc.role = "client"` the cell connects to a Modbus server in the PLC (`plc.address`; MB_SERVER of an S7, a server add-on
instruction of a Logix) and asks for unit `plc.unit_id`. The PLC keeps the same map in its holding registers, from
`plc.base_address` on, and the same handshake: what this page calls writing is then setting words 0 … 7, and reading is looking at
words 8 … 87.

* Every `plc.poll_ms` the cell reads all 88 words with one function 3. What has changed in the request block counts when two reads
  agree on it, `plc_heartbeat` apart; a raised `request` stands until `ack`, so nothing is missed.
* The cell writes with function 16, words 8 … 39 or 8 … 87 in one request and word 17, `status`, once more alone: a flag falls before
  the words that it speaks for change, and rises when all of them are there. Nobody else writes words 8 … 87; the cell reads them
  back, says in its log that somebody did, and writes them anew.
* **Raise `request` only while `ack` is 0**: else the cell, which looks now and then, may not have seen the last one fall.
* After connecting, the cell writes everything anew before it believes anything in the request block. A request that stands then and
  was answered before gets the same answer, no second sweep; one that stood when the cell came up is not carried out (code 30).
* No reply within `plc.reply_timeout_ms`, an exception, a reply of another transaction, unit, function or length: the cell says so in
  its log, closes the connection and connects anew, ever more slowly up to every 2 s. After `plc.heartbeat_timeout_ms` that is alarm
  400 or 401.
* The PLC's server needs one connection free for the cell. An MB_SERVER has one; let nothing else use its port.

)";

constexpr std::string_view kPick = R"(## One pick, step by step

Keep a copy of the request block in the PLC, write all eight words in every poll with `plc_heartbeat` counted up (at least once
a second), and read words 8 … 87 in every poll. All signals are levels: hold each until you see its answer.

1. After connecting, once: `map_version` = 2, `map_length` = 88, `test_f32` = 123456.0. Else stop: program and map, or the
   word order, do not fit. Read `ack_sequence` and `boot_count`.
2. Write the block with `control` = 0 (or 8: `robot_clear`) once. A request that already stands when the cell has just started
   is not carried out (result code 30); it has to be seen 0 first.
3. Set `robot_clear` (bit 3) whenever the robot is out of the scanner's view, and clear it before it goes in. (Where the robot
   carries the scanner, the bit means nothing: the cell asks the robot itself.)
4. **Wait for the robot, then for `ready`** (status bit 0; while it is 0, `not_ready` says why). `ready` speaks for the cell alone:
   it is 1 again as soon as a result is acknowledged, while the robot is still on its way. After a result with code 1 the robot
   has to have gone in (`robot_clear` 0) and come out again (`robot_clear` 1) before the next request is raised. A request that
   comes earlier waits with `robot_clear` = 0 until `plc.scan_timeout_ms` has passed, and a sweep into which the robot moves
   (`robot_clear` falls) is broken off: both are a fault with alarm 502.
5. Choose `sequence`: the last one plus 1 (65535 is followed by 1, never 0), and not equal to `ack_sequence`. Set `part_id`,
   `supply_id`, `result_ack` = 0 and the bit `request` (bit 0), all in the same write. **When the supply was changed or moved since
   its last request, set `new_scan` (bit 4) with it**: with `picks.per_scan` over 1 the answer may else come from the scan before,
   at once and without a sweep. A fault, an abort of a running cycle and a lost robot make the next scan a new one by themselves.
6. Wait until `ack` (bit 1) is 1 and `ack_sequence` is your number; then clear `request`.
7. When `scan_done` (bit 4) is 1, the robot may enter the view.
8. Wait until `result_valid` (bit 3) is 1 and both `result_sequence` and `result_sequence_tail` are your number. If `fault` (bit 5)
   rises instead, no result comes: go to "After a fault". If your own time-out passes (longer than `plc.scan_timeout_ms` and
   `plc.detect_timeout_ms` together: 25 s fits the defaults), go to "Abort".
9. Look at `result_code`. 1: take `approach_x` … `approach_c`, `grasp_x` … `grasp_c` and `retreat_x` … `retreat_z`, or let the robot
   fetch the pick of this `pick_id` over its socket. Any other code: the table of result codes says what it means and what to do. Whether the
   robot then succeeded stands in no register: the robot tells its own PLC.
10. Write `result_ack` = your number. The cell clears the result (`result_valid` = 0) and is `ready` again. Without this the result
    stays; it never expires by itself, and the next request clears it, too.

The same in bytes, request 5 for part 1 in supply 1 (transaction numbers left out as `tt tt`):

    write  tt tt 00 00 00 17 FF 10 00 00 00 08 10  00 2A 00 05 00 01 00 01 00 00 00 00 00 00 00 09
           heartbeat 42, sequence 5, part 1, supply 1, result_ack 0, 0, 0, control = request + robot_clear
    answer tt tt 00 00 00 06 FF 10 00 00 00 08
    read   tt tt 00 00 00 06 FF 03 00 08 00 50
    answer tt tt 00 00 00 A3 FF 03 A0  … 80 words from `map_version` to `result_sequence_tail`

### Retry

Raise `request` again with the **same** number, part and supply: if that request was accepted, you get the same answer again and no
second sweep, however often you ask. So after a time-out or a broken line, ask again with the same number. A result is taken by a
*change* of `result_ack` to its number: write 0 with each request. The same number with another part or supply is an error (code 22).
A request that was refused with 20, 21 or 31 did not use up its number.

### Abort

Set `abort` (bit 1), hold it until `abort_ack` (bit 6), clear it. The running cycle is stopped and forgotten, the result cleared. It
works in every state. The same number asked again is answered with code 32. A pick that was answered and not yet fetched is taken
back from the robot's socket too.

### After a fault

`fault` (bit 5) is 1, nothing is valid, `first_alarm` tells what came first, the list of alarms has the rest. Remove the cause, set
`reset` (bit 2), hold it until `reset_ack` (bit 7), clear it, wait for `ready`, request with a new number.
Alarms stay listed until `reset`, also those whose cause has gone; so one that came while the PLC was away is seen afterwards. Not
every alarm is a fault: while `fault` is 0, picks go on.

### After a restart

Of the cell: `boot_count` has changed, all else is 0, no result is valid. Clear `request` once, then begin at step 4 with a new number.
Of the PLC: begin at step 1. If a result of before is still valid, acknowledge it or leave it to the next request.
When the line of the writing client breaks, the cell takes `request`, `abort` and `reset` for 0; `robot_clear` keeps its value.

### Heartbeats

The cell counts `cell_heartbeat` up every 0.5 s; when it has stood still for 3 s, the cell is to be taken for dead, whatever TCP says.
The cell watches `plc_heartbeat` likewise (`plc.heartbeat_timeout_ms`; 0: not).

)";

constexpr std::string_view kConventions = R"(### Pose conventions

`approach_…`, `grasp_…` and `retreat_…` are the tcp in the robot's base. `plc.pose_convention` says how they are written. At the retreat
position the tcp is turned as at the grasp: it has no angles of its own.

| value | name | x y z | a b c | rotation |
|---|---|---|---|---|
| 0 | `ur` | m | rad | rotation vector rx, ry, rz (axis times angle) |
| 1 | `fanuc` | mm | deg | W, P, R: R = Rz(R) · Ry(P) · Rx(W) |
| 2 | `kawasaki` | mm | deg | O, A, T: R = Rz(O) · Ry(A) · Rz(T) |

)";

constexpr std::string_view kMakers = R"(## Siemens S7-1200/1500

`plc.word_order = "s7"`. Two MB_CLIENT jobs on **one** instance in turn, each started when the other is DONE:

| job | MB_MODE | MB_DATA_ADDR | MB_DATA_LEN | MB_DATA_PTR |
|---|---|---|---|---|
| write | 2 | 40001 | 8 | request block, Array[0..7] of Word |
| read | 0 | 40009 | 80 | status and result, Array[0..79] of Word |

Put the arrays into data blocks with standard access (`{ S7_Optimized_Access := 'FALSE' }`): the f32 at word n is the Real at byte
2 · (n − 8) of the array that was read. Do not change inputs while BUSY is 1. `binpick export plc --for s7` writes all of this and the
handshake as an SCL source: [plc/tia-portal.md](plc/tia-portal.md).

With `plc.role = "client"` call MB_SERVER in every cycle instead, with a structure of the 88 words in a data block with standard access
as MB_HOLD_REG, and `plc.base_address` as HR_Start_Offset: `binpick export plc --for s7 --role client`.

## Rockwell Logix

`plc.word_order = "logix"`. One transaction writes 8 words at address 0, one reads 80 words at address 8 into an INT array; COP from it
into a structure of INT, DINT and REAL: each 32-bit value of a block starts at an even word, so that the structure has no holes.
`binpick export plc --for logix` writes the structures, tags and the handshake: [plc/studio-5000.md](plc/studio-5000.md).

With `plc.role = "client"` the server's array of holding registers has the 88 words from `plc.base_address` on; the same program, written by
`--role client`, says what to copy where.
)";
}  // namespace

std::string registers_page() {
  std::string out{kHead};
  out += "## Request block, PLC → cell (words 0 … 7)\n\n" + registers(kRequestFirst, kRequestLength);
  out += "\nBits of `control`:\n\n" + bits(kControlBits);
  out += "\n## Status block, cell → PLC (words 8 … 39)\n\n" + registers(kStatusFirst, kStatusLength);
  out += "\nBits of `status`:\n\n" + bits(kStatusBits);
  out += "\nBits of `not_ready`:\n\n" + bits(kNotReadyBits);
  out += "\n## Result block, cell → PLC (words 40 … 87)\n\n";
  out += "All words are 0 while `result_valid` is 0.\n\n" + registers(kResultFirst, kResultLength) + "\n";
  out += kConventions;
  out += kPick;

  out += "## Result codes\n\n| code | name | cause | what to do |\n|---|---|---|---|\n";
  for (const ResultText& r : result_table())
    out += "| " + std::to_string(static_cast<unsigned>(r.code)) + " | " + std::string(r.name) + " | " +
           std::string(r.cause) + " | " + std::string(r.cure) + " |\n";
  out +=
      "\n### Reasons of \"found but not reachable\" (`unreachable_reason`)\n\n| code | name | what to do "
      "|\n|---|---|---|\n";
  for (const UnreachableText& u : unreachable_table())
    out += "| " + std::to_string(static_cast<unsigned>(u.reason)) + " | " + std::string(u.name) + " | " +
           std::string(u.cure) + " |\n";
  out += "\n## Alarms\n\n| code | name | cause | cure |\n|---|---|---|---|\n";
  for (const AlarmText& a : alarm_table())
    out += "| " + std::to_string(static_cast<unsigned>(a.alarm)) + " | " + std::string(a.name) + " | " +
           std::string(a.cause) + " | " + std::string(a.cure) + " |\n";

  out += "\n## The handshake\n\n| `cell_state` | name | meaning |\n|---|---|---|\n";
  for (const State state : kStates)
    out += "| " + std::to_string(static_cast<unsigned>(state)) + " | " + std::string(to_string(state)) + " | " +
           std::string(meaning(state)) + " |\n";
  out += "\n" + diagram();
  out += "\n| event | means |\n|---|---|\n";
  for (const Signal signal : kSignals)
    out += "| " + std::string(to_string(signal)) + " | " + std::string(meaning(signal)) + " |\n";
  out +=
      "\nWhat is not in this table changes nothing.\n\n| in state | event | next state | what the cell does "
      "|\n|---|---|---|---|\n";
  for (const Row& row : kRows)
    out += "| " + std::string(to_string(row.from)) + " | " + std::string(to_string(row.on)) + " | " +
           std::string(to_string(row.to)) + " | " + std::string(meaning(row.effect)) + " |\n";
  out += "\n";
  out += kMakers;
  return out;
}
}  // namespace binpick::plc
