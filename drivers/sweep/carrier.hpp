#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>

#include "base/clock.hpp"
#include "base/frames.hpp"
#include "base/units.hpp"

namespace binpick::drivers::sweep {
/// The pivot turns the scanner over the supply.
struct PivotSweep {
  Angle start, end;
  double speed_rad_s = 0.5;              ///< From start to end.
  double positioning_speed_rad_s = 1.0;  ///< To the start.
};
/// The robot carries the scanner along a path that was taught it.
struct RobotPath {
  std::uint16_t number = 1;                         ///< By which the robot's program knows it.
  Duration prepare_max = std::chrono::seconds(20);  ///< Until the robot stands at its start.
  Duration path_max = std::chrono::seconds(20);     ///< From its start to its end.
};
using Motion = std::variant<PivotSweep, RobotPath>;

/// Where the carrier was: the pivot's angle, or the flange of the robot.
using CarrierPose = std::variant<Angle, Transform<frame::Base, frame::Flange>>;

/// What moves the scanner: told where to go, asked where it was. Its owner hands it the events of its device and the
/// sweep what it makes of them (CarrierNews).
class Carrier {
 public:
  virtual ~Carrier() = default;
  /// Takes up what the next sweep is. The error says why it cannot be, and what to do.
  virtual std::optional<std::string> plan(const Motion& motion) = 0;
  virtual void go_to_start(TimePoint now) = 0;
  virtual void go_to_end(TimePoint now) = 0;
  virtual void stop(TimePoint now) = 0;
  virtual Duration prepare_max() const = 0;  ///< To the start, at most.
  virtual Duration path_max() const = 0;     ///< From there to the end, at most.
  virtual std::string overdue() const = 0;   ///< What to say when it took longer.
  /// The latest time that at() may know of.
  virtual std::optional<TimePoint> newest() const = 0;
  virtual std::optional<CarrierPose> at(TimePoint at) const = 0;
};

struct CarrierNews {
  enum class Kind {
    Moved,    ///< at() knows more.
    Arrived,  ///< It stands where it was told to go.
    Failed,
  } kind = Kind::Moved;
  std::string text;  ///< Of Failed.
};
}  // namespace binpick::drivers::sweep
