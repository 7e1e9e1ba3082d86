#pragma once

#include <array>

namespace binpick::support {
/// Where in a request something happens to the cell.
enum class CyclePhase {
  Ready,          ///< Before the request.
  Positioning,    ///< The pivot is on its way to the start of the sweep.
  Sweeping,       ///< Profiles come.
  Detecting,      ///< The robot may enter.
  ResultPending,  ///< The answer stands; neither PLC nor robot need have read it.
  Picking,        ///< The robot is on its way with it.
};
inline constexpr std::array kCyclePhases{CyclePhase::Ready,     CyclePhase::Positioning,   CyclePhase::Sweeping,
                                         CyclePhase::Detecting, CyclePhase::ResultPending, CyclePhase::Picking};

constexpr const char* to_text(CyclePhase phase) {
  switch (phase) {
    case CyclePhase::Ready:
      return "ready";
    case CyclePhase::Positioning:
      return "positioning";
    case CyclePhase::Sweeping:
      return "sweeping";
    case CyclePhase::Detecting:
      return "detecting";
    case CyclePhase::ResultPending:
      return "result pending";
    case CyclePhase::Picking:
      return "picking";
  }
  return "?";
}
}  // namespace binpick::support
