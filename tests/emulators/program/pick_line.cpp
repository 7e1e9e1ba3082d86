#include "tests/emulators/program/pick_line.hpp"

#include <cstdarg>
#include <cstdio>

#include "base/units.hpp"
#include "plc/result_codes.hpp"

namespace binpick::emulators {
namespace {
/// PLC and robot get the same pose: one as 32-bit floats, the other as decimals.
constexpr double kSamePoseMm = 0.1;

[[gnu::format(printf, 2, 3)]] void add(std::string& line, const char* format, ...) {
  char text[256];
  std::va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  if (!line.empty()) line += ", ";
  line += text;
}

void add_figures(std::string& line, const plc::CycleFigures& figures) {
  add(line, "sweep %.2f s, %u profiles, %u points, %u hypotheses, detection %u ms", figures.sweep_ms * 1e-3,
      figures.profiles, figures.points, figures.hypotheses, figures.detection_ms);
}
}  // namespace

PickVerdict judge(const PickSeen& pick, double tolerance_mm, double tolerance_deg) {
  PickVerdict verdict;
  verdict.taken = pick.grip && pick.grip->kind == GripResult::Kind::Taken;
  verdict.right = pick.nearest && pick.grip && (pick.how.empty() || pick.how == (verdict.taken ? "done" : "FAILED"));
  std::string& line = verdict.line;
  if (pick.result) {
    add(line, "sequence %u", pick.result->sequence);
    add_figures(line, pick.result->figures);
  }
  if (pick.nearest) {
    const double mm = pick.nearest->error.centroid_mm;
    const double deg = Angle::rad(pick.nearest->error.angle_rad).in_deg();
    add(line, "error %.1f mm %.1f deg", mm, deg);
    if (mm > tolerance_mm || deg > tolerance_deg) {
      verdict.right = false;
      line += " (TOO FAR OFF)";
    }
  } else {
    add(line, "no object to compare with");
  }
  if (pick.read) {
    const Eigen::Vector3d at = pick.read->T_base_grasp.iso.translation() * 1e-3;
    add(line, "robot read pick %u at (%.4f %.4f %.4f) m", pick.read->pick_id, at.x(), at.y(), at.z());
    const auto differ = [](const auto& a, const auto& b) {
      return (a.iso.translation() - b.iso.translation()).norm() > kSamePoseMm;
    };
    if (pick.result && (differ(pick.result->T_base_grasp, pick.read->T_base_grasp) ||
                        differ(pick.result->T_base_retreat, pick.read->T_base_retreat))) {
      verdict.right = false;
      line += " (NOT WHAT THE PLC READ)";
    }
  }
  if (pick.grip) add(line, "%s", to_string(*pick.grip).c_str());
  if (!pick.how.empty()) add(line, "%s", pick.how.c_str());
  return verdict;
}

std::string no_pick_line(const PlcResult& result) {
  std::string line;
  add(line, "no pick: sequence %u, result %u (%s)", result.sequence, static_cast<unsigned>(result.code),
      std::string(plc::to_string(result.code)).c_str());
  if (result.figures.profiles > 0) add_figures(line, result.figures);
  return line;
}
}  // namespace binpick::emulators
