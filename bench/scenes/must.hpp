#pragma once

#include <optional>
#include <string>
#include <vector>

#include "bench/scenes/alarm_scenes.hpp"
#include "bench/scenes/comparison.hpp"

/// What detection is held to, and where it stands.
namespace binpick::bench {
enum class Figure : std::uint8_t {
  ApMean,
  ApWorst,
  FirstRight,
  Error_mm,
  Error_deg,
  PrecisionHalf,    ///< From score .5 on.
  RecallHalf,       ///< From score .5 on.
  Calibration,      ///< Expected error of the score.
  NormalisedError,  ///< Squared, over its degrees of freedom; median.
  TimeP50,          ///< Whole list, ms.
  TimeP99,
  FirstP50,   ///< First valid pose, ms.
  PeerSpeed,  ///< Times as fast as OpenCV's surface_matching, same scenes.
  PeerError,  ///< Our mean 1 - AP over its.
  Alarms,     ///< Scenes without the part that have a detection above .5.
};

struct Demand {
  Figure figure;
  std::string_view where;  ///< A class, or "all".
  double must;
  std::optional<double> aim;
  double least = 0;  ///< Where less is better: below this is wrong too.
};

/// All that a folder has to say.
struct Evidence {
  std::vector<ClassFigures> classes;
  std::vector<ClassFigures> peer, beside_peer;  ///< OpenCV's and ours on the scenes that both saw.
  AlarmCounts alarms;
};

struct Standing {
  Demand demand;
  std::optional<Estimate> here;  ///< None: not measured.
  bool must = false, aim = false;
};
std::vector<Standing> standings(const Evidence& evidence);
void print_standings(const std::vector<Standing>& standings);
}  // namespace binpick::bench
