#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/clock.hpp"
#include "config/config.hpp"
#include "daemon/cycle/detection.hpp"

namespace binpick::daemon {
/// What is known of the supplies from one request to the next: the last scan of each with the picks that are left in
/// it, and where picks failed. No clock of its own.
class PickMemory {
 public:
  /// What the PLC asks for.
  struct Place {
    std::uint16_t supply_id = 0;
    std::uint16_t part_id = 0;
    friend auto operator<=>(const Place&, const Place&) = default;
  };

  /// A new scan of the supply takes the place of the one before. Failed picks there grow older by one.
  void keep(const Place& place, DetectResult result, TimePoint scanned_at);
  /// Of the scan that keep() was last told of.
  const DetectResult& scan(const Place& place) const { return scans_.at(place.supply_id).result; }

  struct Pick {
    std::size_t reachable = 0;  ///< Index in the choice of the supply's scan.
    bool again = false;         ///< A pick of this object has failed before.
    bool other = false;         ///< The way that failed would be the same: by the reachable's other one.
    std::size_t left = 0;       ///< Detections beside it that were not picked yet.
  };
  /// The next pick of the kept scan, if there is one: an object that stands apart (margin_mm) from all that were picked
  /// from this scan, from all that touched one of these, and from what overlaps with that, and of which no pick failed.
  /// Only a fresh scan gives objects of which one pick failed, after all others; the last of them, and only by another
  /// grasp, those that another one may lie on or that have to be drawn out aslant. Of which two failed, none until that
  /// is forgotten. Nothing is changed.
  std::optional<Pick> next(const Place& place, const config::Picks& options, TimePoint now) const;
  /// It is answered under this id.
  void answered(const Place& place, const Pick& pick, std::uint16_t pick_id, const config::Picks& options);

  /// By the robot. A failed one ends the use of its scan: who knows what was pushed.
  void on_report(std::uint16_t pick_id, bool done, const config::Picks& options);
  /// Objects that are not offered because of failed picks there, in words for the log.
  std::vector<std::string> passed_over(const Place& place) const;

  /// The supply was changed or moved.
  void forget(std::uint16_t supply_id);
  /// Somebody may have been in the cell: no pick without a new scan.
  void forget_scans() { scans_.clear(); }

 private:
  struct Scan {
    std::uint16_t part_id = 0;
    DetectResult result;
    TimePoint at{};
    std::vector<std::size_t> picked;  ///< Detections.
  };
  struct Failure {
    Eigen::Vector3d centre_mm;  ///< Of the object, supply frame.
    Transform<frame::Supply, frame::Tcp> T_supply_grasp;
    double radius_mm = 0;  ///< An object whose centre is nearer is this one.
    int picks = 1;
    int scans_left = 0;
  };
  struct Open {
    std::uint16_t pick_id = 0;
    Place place;
    Failure would_be;
  };
  /// Of this object, the one with most picks; none: nullptr.
  const Failure* failure_of(const Place& place, const Eigen::Vector3d& centre_mm) const;

  std::map<std::uint16_t, Scan> scans_;  ///< By supply.
  std::map<Place, std::vector<Failure>> failures_;
  std::optional<Open> open_;  ///< The last answered pick.
};
}  // namespace binpick::daemon
