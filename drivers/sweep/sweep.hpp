#pragma once

#include <deque>
#include <optional>
#include <string>
#include <variant>

#include "base/clock.hpp"
#include "base/units.hpp"
#include "drivers/pivot/session.hpp"
#include "drivers/scanner/lms400/session.hpp"
#include "drivers/sweep/angle_track.hpp"
#include "drivers/sweep/sequence.hpp"

/// One sweep: pivot and scanner moved together; each profile leaves with the pivot's angle of its own time.
namespace binpick::drivers::sweep {
struct Plan {
  Angle start, end;
  double speed_rad_s = 0.5;              ///< From start to end.
  double positioning_speed_rad_s = 1.0;  ///< To the start.
  Duration pivot_latency{0};             ///< A position sample is this much older than it says.
  Duration scanner_latency{0};           ///< A profile is this much older than it says.
};

/// A profile with the pivot angle at the time it was measured.
struct RegisteredProfile {
  lms400::Profile profile;
  Angle pivot;
};
/// The pivot stands and the last profile has been handed out.
struct Done {
  Duration duration{0};      ///< From the first movement of the sweep proper to its end.
  std::size_t profiles = 0;  ///< Handed out.
  std::size_t profiles_without_angle = 0;
  std::uint64_t profiles_lost = 0;  ///< By the scanner's counter.
};
struct Failed {
  enum class Device { Pivot, Scanner, None } device = Device::None;  ///< None: the sweep took too long.
  std::string text;
};
using Event = std::variant<RegisteredProfile, Done, Failed>;

/// Drives both sessions through the table in sequence.hpp. Whoever owns the sessions drains their events and hands each
/// to on_pivot or on_scanner, in a sweep or not.
class Sweep {
 public:
  Sweep(pivot::Session& pivot, lms400::Session& scanner) : pivot_{pivot}, scanner_{scanner} {}

  /// Both devices must be ready. Starts from the end of the plan that the pivot is nearer to.
  void begin(const Plan& plan, TimePoint now);
  void abort(TimePoint now);
  void on_pivot(const pivot::Event& event, TimePoint now);
  void on_scanner(const lms400::Event& event, TimePoint now);
  void on_deadline(TimePoint now);
  std::optional<TimePoint> deadline() const { return deadline_; }
  std::optional<Event> take_event();
  State state() const { return state_; }

 private:
  std::optional<std::string> beyond_limits() const;
  void apply(Input input, TimePoint now);
  void hand_out_profiles();

  pivot::Session& pivot_;
  lms400::Session& scanner_;
  Plan plan_;
  State state_ = State::Idle;
  std::optional<TimePoint> deadline_;
  AngleTrack track_;
  std::deque<lms400::Profile> waiting_;  // for a pivot sample later than themselves
  std::optional<TimePoint> move_began_, move_ended_, last_profile_at_;
  Done done_;
  Failed failure_;
  std::deque<Event> events_;
};
}  // namespace binpick::drivers::sweep
