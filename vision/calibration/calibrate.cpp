#include "vision/calibration/calibrate.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <optional>

#include "vision/calibration/pose_spread.hpp"

namespace binpick::vision::calibration {
namespace {
using Eigen::MatrixXd;
using Eigen::Vector3d;

/// Thirteen unknowns at most, three numbers of each scan, and one scan is always left out.
constexpr std::size_t kScansMin = 6;
/// The mount may do this many times the error of measuring one sphere; more is no calibration.
constexpr double kDilutionMax = 4;
constexpr std::size_t kSeenMax = 500;

template <class... Values>
std::string format(const char* text, Values... values) {
  char words[300];
  std::snprintf(words, sizeof words, text, values...);
  return words;
}

std::vector<SeenPoint> seen_points(const Question& question, const Mount& mount) {
  std::vector<SeenPoint> seen;
  if (mount.on_pivot) {
    for (const Vector3d& place : question.places_mm)
      if (const auto point = seen_from_pivot(mount, place)) seen.push_back(*point);
    return seen;
  }
  std::size_t all = 0, count = 0;
  for (const SphereScan& scan : question.scans)
    for (const CarriedProfile& profile : scan.profiles) all += profile.x_mm.size();
  for (const SphereScan& scan : question.scans)
    for (const CarriedProfile& profile : scan.profiles)
      for (std::size_t i = 0; i < profile.x_mm.size(); ++i) {
        const Vector3d p{profile.x_mm[i], 0, profile.z_mm[i]};
        if (p.allFinite() && p.z() > 0 && count++ % (all / kSeenMax + 1) == 0)
          seen.push_back({profile.T_root_carrier, p});
      }
  return seen;
}

/// Mean over the points of the square of a random vector J · step, and over how many squares of normal numbers it
/// averages: Satterthwaite's degrees of freedom.
struct MeanSquare {
  double value = 0, freedom = 1;
  /// That quantile of it which lies `z` normal sd from the middle (Wilson and Hilferty's approximation), with `others`
  /// degrees of freedom more of a factor that is known as a mean of so many squares only.
  double quantile(double z, std::optional<double> others = std::nullopt) const {
    const double spread = 2 / (9 * (others ? 1 / (1 / freedom + 1 / *others) : freedom));
    const double middle = 1 - 2 / (9 * freedom);
    return value * std::pow(std::max(middle + z * std::sqrt(spread), 0.0), 3);
  }
};
MeanSquare mean_square(const std::vector<Eigen::Matrix3Xd>& by_step, const MatrixXd& covariance) {
  MatrixXd effect = MatrixXd::Zero(covariance.rows(), covariance.cols());
  for (const Eigen::Matrix3Xd& J : by_step) effect += J.transpose() * J / static_cast<double>(by_step.size());
  const MatrixXd product = effect * covariance;
  const double trace = product.trace();
  return {trace, trace * trace / (product * product).trace()};
}

std::optional<std::string> cannot_ask(const Question& question) {
  if (question.scans.size() < kScansMin)
    return format("%zu scans are too few: %zu at least, twelve are good", question.scans.size(), kScansMin);
  if (!(question.sphere_radius_mm >= 1)) return "the sphere's diameter must be 2 mm at least";
  return std::nullopt;
}
/// The diameter that the points say, when it is not the one that was said.
std::optional<std::string> other_radius(std::span<const SphereSight> sights, const Question& question,
                                        const Adjusted& adjusted) {
  const double radius = question.sphere_radius_mm;
  RadiusSeen seen = radius_of(sights, adjusted, radius);
  if (std::abs(seen.radius_mm - radius) <= std::max(0.02 * radius, 4 * seen.se_mm)) return std::nullopt;
  // A wrong radius has bent the mount, which bends the radius.
  for (int round = 0; round < 3; ++round)
    seen = radius_of(sights, adjust(sights, question.present, seen.radius_mm), seen.radius_mm);
  return format("the sphere in the scans has a diameter of %.2f mm, not %.4g: say the right one with --sphere-mm",
                2 * seen.radius_mm, 2 * radius);
}
}  // namespace

Expected<Answer, std::string> calibrate(const Question& question) {
  if (const auto trouble = cannot_ask(question)) return unexpected(*trouble);
  const double radius = question.sphere_radius_mm;
  std::vector<SphereSight> sights;
  for (const SphereScan& scan : question.scans) {
    auto sight = find_sphere(scan, question.present.mount, radius);
    if (!sight) return unexpected(sight.error());
    sights.push_back(std::move(*sight));
  }
  const Adjusted adjusted = adjust(sights, question.present, radius);
  const Mount& mount = adjusted.arrangement.mount;
  const std::string missing = missing_poses(sights, adjusted);

  Answer answer{.mount = mount,
                .p_holder_sphere_mm = adjusted.arrangement.p_holder_sphere_mm,
                .point_sd_mm = adjusted.point_sd_mm,
                .place_sd_mm = adjusted.place_sd_mm,
                .poses = {},
                .seen = seen_points(question, mount)};
  if (answer.seen.empty())
    return unexpected(std::string{"the scanner sees no point of any supply: check T_base_supply and the mount"});

  std::vector<Eigen::Matrix3Xd> shifts, turns;
  for (const SeenPoint& seen : answer.seen) {
    shifts.push_back(mount.shift_by_step(seen.T_root_carrier, seen.p_scanner_mm));
    turns.push_back(mount.turn_by_step(seen.T_root_carrier));
  }
  const int m = mount.unknowns();
  const MatrixXd covariance = adjusted.covariance().topLeftCorner(m, m);
  const MeanSquare shift = mean_square(shifts, covariance), turn = mean_square(turns, covariance);
  const auto K = static_cast<double>(sights.size());
  const double measuring = std::reduce(adjusted.measuring_mm2.begin(), adjusted.measuring_mm2.end());
  const double dilution = std::sqrt(shift.value / (measuring / K));
  if (!std::isfinite(dilution))
    return unexpected(
        std::string{"the adjustment of the scans finds no mount: the cell file's may be wrong by more than "
                    "100 mm or 10 degrees"});
  if (dilution > kDilutionMax)
    return unexpected(
        format("the %zu scans do not determine the mount (points of the supply are known %.0f times worse "
               "than one sphere is measured): ",
               sights.size(), dilution) +
        (missing.empty() ? "add scans with the sphere at other places" : missing));
  if (const auto trouble = other_radius(sights, question, adjusted)) return unexpected(*trouble);

  double squares = 0, fourth = 0, expected = measuring;
  for (std::size_t k = 0; k < sights.size(); ++k) {
    const HeldOut held = hold_out(sights, adjusted, k, radius);
    const double square = held.error_mm.squaredNorm();
    squares += square;
    fourth += square * square;
    expected += held.mount_mm2;
    answer.poses.push_back({sights[k].name, sights[k].points, std::sqrt(square)});
  }
  const double freedom = std::max(3 * K - adjusted.arrangement.unknowns(), 1.0);
  const double factor = squares / expected;
  answer.left_out_mm = std::sqrt(squares / K);
  answer.left_out_se_mm =
      std::sqrt(std::max(fourth / K - squares / K * (squares / K), 0.0) / K) / (2 * answer.left_out_mm);
  answer.hold_out_mm = std::sqrt(factor * shift.quantile(0));
  answer.hold_out_se_mm = answer.hold_out_mm * std::sqrt(0.5 / freedom);
  answer.hold_out_95_mm = std::sqrt(factor * shift.quantile(1.645, freedom));
  answer.turn_95_rad = std::sqrt(factor * turn.quantile(1.645, freedom));
  return answer;
}
}  // namespace binpick::vision::calibration
