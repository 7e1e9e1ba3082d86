#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "base/clock.hpp"
#include "base/units.hpp"
#include "drivers/link/can.hpp"

/// Schunk PR 70 rotary module as a session without I/O, in either protocol that its generations speak.
namespace binpick::drivers::pivot {
using link::CanFrame;

enum class Protocol {
  PowerCube,  ///< The older electronics.
  Motion,     ///< Schunk Motion Protocol, the newer ones.
};
const char* to_string(Protocol protocol);

struct Options {
  Protocol protocol = Protocol::PowerCube;
  std::uint8_t module_id = 12;                   ///< 1 … 31; Motion Protocol: 1 … 255.
  std::chrono::milliseconds reply_timeout{100};  ///< Silence after a request before it is repeated or given up.
  std::chrono::milliseconds sample_period{10};   ///< Position, state and time stamp are asked this often.
  std::chrono::milliseconds setpoint_horizon{
      200};  ///< While moving, the module knows no target further ahead than this.
  std::chrono::seconds reference_timeout{30};
  /// For probing: looks and does not touch. Ready is said when the module is identified, whatever its state; no RESET,
  /// no reference run, no samples, and moves are refused.
  bool identify_only = false;
};

/// What the module says of itself at start; limits are read, never assumed.
struct ModuleInfo {
  std::string type;  ///< As the module names itself; PowerCube modules do not.
  std::uint16_t firmware = 0;
  std::uint32_t serial = 0;
  Angle position_min, position_max;
  double velocity_max_rad_s = 0;
  double acceleration_max_rad_s2 = 0;
};

struct Ready {
  ModuleInfo module;
};  ///< Referenced and standing still: it may be moved.
struct Sample {
  TimePoint at;
  Angle angle;
};  ///< Where the pivot was, at the time of the module's reading.
struct MoveDone {
  Angle angle;
};  ///< The target of move_to is reached and the pivot stands.
/// The module, its supply or the bus failed. The session goes on by itself until it can say Ready again.
struct Failed {
  enum class Why { NoReply, BusDown, BusOff, ModuleError, PowerFault, ReferenceFailed, MoveRefused } why = Why::NoReply;
  std::uint32_t state_word = 0;  ///< The bits of state_word.hpp, 0 when unknown.
  std::string text;              ///< The state and what to do, in words.
};
using Event = std::variant<Ready, Sample, MoveDone, Failed>;

/// One module. Owns no descriptor, reads no clock. Offline → Identifying → Referencing → Standing ⇄ Moving; Faulted
/// while the module reports an error that it has not recovered from. Moves are streamed as set-points of a short
/// horizon, so that the pivot stops by itself when the daemon vanishes.
class Session {
 public:
  enum class State { Offline, Identifying, Referencing, Standing, Moving, Faulted };

  explicit Session(const Options& options);

  /// The frames that it needs of the bus: the module's own, and those of anybody else who commands it.
  std::vector<link::CanFilter> filters() const;
  void on_link_up(TimePoint now);
  void on_link_down(const std::string& why, TimePoint now);
  void on_frame(const CanFrame& frame, TimePoint received_at);
  void on_deadline(TimePoint now);
  std::optional<TimePoint> deadline() const;
  std::vector<CanFrame> take_frames();
  std::optional<Event> take_event();
  State state() const;
  /// What the module said of itself, once it has; kept when it goes silent.
  std::optional<ModuleInfo> module() const;
  /// The last state (the bits of state_word.hpp), 0 before the first.
  std::uint32_t state_word() const;
  /// The same in words, with the module's own error where it has one.
  std::string state_in_words() const;

  /// Only in Standing or Moving (else ignored and logged). Clamped to the module's limits.
  void move_to(Angle target, double speed_rad_s, TimePoint now);
  /// Stops at once, in any state.
  void stop(TimePoint now);

 private:
  struct Impl;
  std::shared_ptr<Impl> impl_;
};
}  // namespace binpick::drivers::pivot
