#pragma once

#include <deque>
#include <optional>
#include <string>
#include <variant>

#include "base/clock.hpp"
#include "drivers/scanner/any/scanner.hpp"
#include "drivers/sweep/carrier.hpp"
#include "drivers/sweep/sequence.hpp"

/// One sweep: carrier and scanner moved together; each profile leaves with the carrier's pose of its own time.
namespace binpick::drivers::sweep {
struct Plan {
  Motion motion;
  Duration scanner_latency{0};  ///< A profile is this much older than it says.
};

/// A profile with where the carrier was when it was measured.
struct RegisteredProfile {
  scanner::Profile profile;
  CarrierPose carrier;
};
/// The carrier stands and the last profile has been handed out.
struct Done {
  Duration duration{0};                   ///< From the first movement of the sweep proper to its end.
  std::size_t profiles = 0;               ///< Handed out.
  std::size_t profiles_without_pose = 0;  ///< A tenth at most: else the sweep has failed.
  std::uint64_t profiles_lost = 0;        ///< By the scanner's counter.
};
struct Failed {
  enum class Device {
    Carrier,
    Scanner,
    Poses,  ///< The carrier moved, but where it was is not known.
    None    ///< The sweep took too long.
  } device = Device::None;
  std::string text;
};
using Event = std::variant<RegisteredProfile, Done, Failed>;

/// Drives carrier and scanner through the table in sequence.hpp. Whoever owns the sessions drains their events and
/// hands each on, in a sweep or not.
class Sweep {
 public:
  Sweep(Carrier& carrier, scanner::Scanner& scanner) : carrier_{carrier}, scanner_{scanner} {}

  /// Both devices must be ready.
  void begin(const Plan& plan, TimePoint now);
  void abort(TimePoint now);
  void on_carrier(const CarrierNews& news, TimePoint now);
  void on_scanner(const scanner::Event& event, TimePoint now);
  void on_deadline(TimePoint now);
  std::optional<TimePoint> deadline() const { return deadline_; }
  std::optional<Event> take_event();
  State state() const { return state_; }

 private:
  void apply(Input input, TimePoint now);
  void hand_out_profiles();
  void finish_drained(TimePoint now);
  bool waits_for_pose() const;
  void report_end();

  Carrier& carrier_;
  scanner::Scanner& scanner_;
  Plan plan_;
  State state_ = State::Idle;
  bool scanner_stopped_ = false;
  std::optional<TimePoint> deadline_;
  std::deque<scanner::Profile> waiting_;  // for a pose of the carrier later than themselves
  std::optional<TimePoint> move_began_, move_ended_, last_profile_at_;
  Done done_;
  Failed failure_;
  std::deque<Event> events_;
};
}  // namespace binpick::drivers::sweep
