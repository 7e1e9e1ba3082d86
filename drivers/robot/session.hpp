#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>

#include "base/bytes.hpp"
#include "base/clock.hpp"
#include "base/frames.hpp"

/// The robot's socket as a session without I/O: the robot is the client, the cell the server.
namespace binpick::drivers::robot {
/// Make of the controller: how answers are written (dialect.hpp). The conversation is the same for all.
enum class Dialect { UniversalRobots, Fanuc, Kawasaki };

struct Options {
  Dialect dialect = Dialect::UniversalRobots;
  std::chrono::seconds silence_max{60};  ///< A robot that says nothing for this long is taken for gone.
};

/// What the robot gets for a fetch. The same pick under the same id until it is reported or withdrawn.
struct Pick {
  std::uint16_t pick_id = 0;   ///< 1 … 65535; the PLC has the same id.
  std::uint16_t sequence = 0;  ///< The PLC's request that it answers.
  std::uint16_t part_id = 0;
  std::uint16_t objects_left = 0;
  Transform<frame::Base, frame::Tcp> T_base_approach;
  Transform<frame::Base, frame::Tcp> T_base_grasp;
  /// Turned as at the grasp. From the grasp in a straight line to here, and from here straight up.
  Transform<frame::Base, frame::Tcp> T_base_retreat;
};
/// Why there is no pick to fetch.
enum class NoPick : std::uint16_t { NotReady = 0, SupplyEmpty = 10, NothingFound = 11, NotReachable = 12, Fault = 40 };

struct Connected {};
struct Fetched {
  std::uint16_t pick_id;
};  ///< The pick was sent to the robot (again, perhaps).
/// Once for each pick, also when it was withdrawn after the robot had fetched it: the robot was on its way.
struct Reported {
  std::uint16_t pick_id;
  bool done;
};
struct Lost {
  std::string text;
};
/// Of the scan that was asked for. The robot stands at the start of the path, and waits for let_go().
struct PathBegun {};
struct PathEnded {};
struct PathBroken {};  ///< The robot stopped on the way, and says so.
using Event = std::variant<Connected, Fetched, Reported, Lost, PathBegun, PathEnded, PathBroken>;

/// One robot. What was offered and reported is on record beyond a connection, so that a robot that reconnects, or whose
/// program starts anew at any point, finds it again. Each line is answered by one group of numbers (codec.hpp).
class Session {
 public:
  explicit Session(const Options& options);

  void on_connected(TimePoint now);  ///< A new connection replaces the old one.
  void on_bytes(ByteView bytes, TimePoint now);
  void on_disconnected(TimePoint now);
  void on_deadline(TimePoint now);
  std::optional<TimePoint> deadline() const;
  Bytes take_output();
  std::optional<Event> take_event();
  bool take_reopen();  ///< True once when the connection must be closed.
  bool connected() const;
  std::uint64_t bad_lines() const;  ///< Requests that were not understood, since the start.

  /// An offer of the same id again changes what the next fetch gets.
  void offer(const Pick& pick);
  void withdraw(NoPick reason);

  /// Where the robot carries the scanner: the next fetch is answered by this scan instead, until it has ended. `scan`
  /// is its number, 1 … 65535; `path` the one that the robot's program knows.
  void ask_path(std::uint16_t scan, std::uint16_t path);
  void let_go();       ///< The scanner measures: the robot may move along the path.
  void forget_path();  ///< The scan is not wanted any more; the robot is told when it next says something of it.

 private:
  struct Impl;
  std::shared_ptr<Impl> impl_;
};
}  // namespace binpick::drivers::robot
