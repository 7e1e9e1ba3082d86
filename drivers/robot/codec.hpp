#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "base/bytes.hpp"
#include "base/expected.hpp"
#include "drivers/robot/session.hpp"

/// The robot's line protocol. Pure functions: no socket, no clock, no log.
/// The robot sends one line, the cell answers with 23 numbers, the same number of fields every time: before
/// PolyScope 5.15 a list variable of URScript cannot change its length, and a program of any make is simpler so. How
/// numbers, poses and lines are written is the dialect's (dialect.hpp). The protocol is described for integrators in
/// docs/robots/, one page for each make.
namespace binpick::drivers::robot {
inline constexpr int kProtocolVersion = 2;
/// Longest request without its line end. Strings of other makers' controllers hold 127 or 254 characters.
inline constexpr std::size_t kLineBytesMax = 126;
inline constexpr std::size_t kReplyFields = 23;
/// No coordinate of a pose is as large; supplies, poses and meshes of a cell file cannot add up to it.
inline constexpr double kLengthMax_mm = 99'999;
/// No answer is longer than this, line end included; a longer group is not ours.
inline constexpr std::size_t kReplyBytesMax = 512;

/// What a line asks for.
struct Request {
  enum class Kind {
    Hello,   ///< "hello": what is on record? Changes nothing.
    Fetch,   ///< "fetch"
    Done,    ///< "done 17"
    Failed,  ///< "failed 17"
    // Of a robot that carries the scanner:
    Begin,  ///< "begin 4": it stands at the start of the path of scan 4.
    End,    ///< "end 4": it stands at its end.
    Broken  ///< "broken 4": it stopped on the way.
  } kind = Kind::Hello;
  std::uint16_t pick_id = 0;  ///< Of a report, or the number of a scan: 1 … 65535.
  bool is_report() const { return kind == Kind::Done || kind == Kind::Failed; }
  bool is_of_scan() const { return kind == Kind::Begin || kind == Kind::End || kind == Kind::Broken; }
};

struct BadLine {
  enum class Kind { TooLong, NotText, UnknownWord, BadNumber, TooManyWords } kind = Kind::UnknownWord;
};
std::string to_string(const BadLine& error);

/// One line without its line end.
Expected<Request, BadLine> decode_request(std::string_view line);
/// With the line end of the make.
std::string encode(const Request& request, Dialect dialect);

/// Cuts a stream into lines: ended by CR, LF or CR LF, without it; empty lines are skipped. A line of more than
/// kLineBytesMax bytes is given once, as TooLong, when its end has come. Looks at each byte once.
class LineReader {
 public:
  void push(ByteView bytes);
  std::optional<Expected<std::string, BadLine>> next();
  void clear();

 private:
  Bytes pending_;       // not looked at yet
  std::size_t at_ = 0;  // in pending_
  std::string line_;    // begun, not ended
  bool too_long_ = false;
};

/// Second field of an answer. Values below 50 are those of the PLC's result code where both say the same.
enum class Status : std::uint16_t {
  NotReady = 0,     ///< No pick yet: ask again.
  Pick = 1,         ///< Fields 3 … 21 hold.
  ReportTaken = 2,  ///< The report is on record (also when it came twice).
  Hello = 3,
  Scan = 4,  ///< Carry the scanner: field "pick id" is the scan's number, field "part" the path's.
  Go = 5,    ///< The scanner measures: move along the path now.
  SupplyEmpty = 10,
  NothingFound = 11,
  NotReachable = 12,
  Fault = 40,
  UnknownPick = 50,  ///< A report of a pick that is not open: forget it, fetch.
  BadRequest = 51,   ///< The line was not understood.
  UnknownScan = 52,  ///< The scan is not wanted any more: stay clear, fetch.
};

enum class Outcome : std::uint16_t { None = 0, Done = 1, Failed = 2 };

/// One answer. Fields in order: protocol version, status, pick id, sequence, part, objects left, approach pose (6),
/// grasp pose (6), position of the retreat pose (3; turned as the grasp), pick id of the last report on record, its
/// outcome. Poses are tcp in base.
struct Reply {
  Status status = Status::NotReady;
  Pick pick;  ///< Default (all zero, identity) where there is none.
  std::uint16_t reported_id = 0;
  Outcome outcome = Outcome::None;
};

/// Plain decimals, never an exponent; at most 255 bytes, no line of more than kLineBytesMax where lines are read whole.
std::string encode(const Reply& reply, Dialect dialect);

struct BadReply {
  std::string text;
};
struct DecodedReply {
  Reply reply;
  std::size_t consumed = 0;
};
/// First answer in `text`; nullopt while it is incomplete. An answer of another protocol version is an error from its
/// first field on, whatever its length. The robot's half, for emulators and tests.
Expected<std::optional<DecodedReply>, BadReply> decode_reply(std::string_view text, Dialect dialect);
}  // namespace binpick::drivers::robot
