#include "tests/support/sphere_scans.hpp"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>
#include <string>

#include "tests/emulators/scanner/lps36_view.hpp"
#include "tests/emulators/scanner/scanner_view.hpp"
#include "tests/emulators/world/shapes.hpp"

namespace binpick::support {
namespace {
using Eigen::AngleAxisd;
using Eigen::Isometry3d;
using Eigen::Translation3d;
using Eigen::Vector3d;
using vision::calibration::CarriedProfile;
using vision::calibration::Mount;
using vision::calibration::SphereScan;

double rad(double degrees) { return degrees * std::numbers::pi / 180; }

/// A scanner's class as it stands over its supply.
struct Setting {
  Vector3d supply_mm;
  double height_mm, sphere_radius_mm, sweep_deg, sweep_deg_s, path_mm_s, frequency_hz;
  double nearest_mm, farthest_mm, sideways;  ///< Of a robot's paths: the sphere in the scanner's field.
};
Setting setting_of(SphereScanner scanner) {
  if (scanner == SphereScanner::Lms400) return {{1000, 800, 500}, 1860, 100, 18, 34, 250, 360, 1100, 1900, 0.25};
  return {{300, 300, 120}, 560, 30, 22, 10, 100, 100, 330, 620, 0.25};
}

/// Rings of triangles, bulged by half of what their middles fall short.
vision::Mesh sphere_mesh(double radius_mm) {
  constexpr std::uint32_t kRings = 96, kAround = 192;
  const double r = radius_mm * (1 + std::pow(std::numbers::pi / kRings, 2) / 12);
  vision::Mesh mesh;
  for (std::uint32_t i = 0; i <= kRings; ++i)
    for (std::uint32_t k = 0; k < kAround; ++k) {
      const double down = std::numbers::pi * i / kRings, round = 2 * std::numbers::pi * k / kAround;
      mesh.vertices_mm.push_back(
          (r * Vector3d{std::sin(down) * std::cos(round), std::sin(down) * std::sin(round), std::cos(down)})
              .cast<float>());
    }
  for (std::uint32_t i = 0; i < kRings; ++i)
    for (std::uint32_t k = 0; k < kAround; ++k) {
      const std::uint32_t a = i * kAround + k, b = i * kAround + (k + 1) % kAround;
      if (i > 0) mesh.triangles.push_back({a, a + kAround, b});
      if (i + 1 < kRings) mesh.triangles.push_back({b, a + kAround, b + kAround});
    }
  return mesh;
}

class Rig {
 public:
  explicit Rig(const SphereScans& wanted)
      : wanted_{wanted}, setting_{setting_of(wanted.scanner)}, random_{wanted.seed * 7919 + 17} {
    T_base_supply_.iso.translation() = Vector3d{1.2 * setting_.supply_mm.x(), 100, 0};
    ball_ = std::make_shared<emulators::RayMesh>(sphere_mesh(setting_.sphere_radius_mm));
    const auto r = static_cast<float>(setting_.sphere_radius_mm);
    rod_ = std::make_shared<emulators::RayMesh>(emulators::shapes::turn(0, {{3 * r, r / 6, 0}}, 24));
    gripper_ = std::make_shared<emulators::RayMesh>(emulators::box_mesh({2 * r, 1.2 * r, 1.5 * r}));
  }

  EmulatedScans scan() {
    EmulatedScans out;
    out.truth = true_mount();
    auto& question = out.question;
    question.sphere_radius_mm = setting_.sphere_radius_mm;
    question.present.mount = disturbed(out.truth);
    for (int i = 0; i < 5; ++i)
      for (int j = 0; j < 5; ++j)
        for (int k = 0; k < 3; ++k)
          question.places_mm.push_back(T_base_supply_ * Vector3d{(i / 4.0 - 0.5) * setting_.supply_mm.x(),
                                                                 (j / 4.0 - 0.5) * setting_.supply_mm.y(),
                                                                 k / 2.0 * setting_.supply_mm.z()});
    for (int k = 0; k < wanted_.scans; ++k)
      question.scans.push_back(wanted_.carrier == SphereCarrier::Pivot ? held(out.truth, k) : carried(out.truth, k));
    return out;
  }

 private:
  double normal(double sd) { return wanted_.quiet ? 0 : sd * std::normal_distribution<>{}(random_); }
  double within(double limit) { return std::uniform_real_distribution<>{-limit, limit}(random_); }
  Vector3d normals(double sd) { return {normal(sd), normal(sd), normal(sd)}; }
  Isometry3d noise(double mm, double deg) {
    const Vector3d turn = normals(rad(deg));
    const double angle = turn.norm();
    return Translation3d{normals(mm)} * AngleAxisd{angle, angle > 0 ? Vector3d{turn / angle} : Vector3d::UnitX()};
  }

  Mount true_mount() {
    Mount mount;
    mount.on_pivot = wanted_.carrier == SphereCarrier::Pivot;
    if (mount.on_pivot) {
      mount.T_base_root = T_base_supply_.iso * Translation3d{0, 0, setting_.height_mm} *
                          AngleAxisd{rad(90), Vector3d::UnitY()} * AngleAxisd{rad(1), Vector3d::UnitX()};
      mount.T_carrier_scanner =
          Translation3d{60, 5, -3} * AngleAxisd{rad(-90), Vector3d::UnitY()} * AngleAxisd{rad(179), Vector3d::UnitX()};
    } else {
      mount.T_carrier_scanner = Translation3d{10, 80, 120} * AngleAxisd{rad(2), Vector3d{1, 2, 3}.normalized()};
    }
    return mount;
  }

  Mount disturbed(const Mount& truth) {
    const auto off = [&] {
      const auto draw = [&](double sd) { return std::clamp(std::normal_distribution<>{}(random_), -2.5, 2.5) * sd; };
      const Vector3d shift{draw(wanted_.mount_shift_mm), draw(wanted_.mount_shift_mm), draw(wanted_.mount_shift_mm)};
      const double w = rad(wanted_.mount_turn_deg);
      return Isometry3d{Translation3d{shift} * AngleAxisd{draw(w), Vector3d::UnitX()} *
                        AngleAxisd{draw(w), Vector3d::UnitY()} * AngleAxisd{draw(w), Vector3d::UnitZ()}};
    };
    Mount present = truth;
    if (present.on_pivot) present.T_base_root = truth.T_base_root * off();
    present.T_carrier_scanner = truth.T_carrier_scanner * off();
    return present;
  }

  /// Sphere, rod and gripper where the flange holds them: the rod along its z axis.
  emulators::World world_with(const Isometry3d& T_base_flange) const {
    emulators::World world{setting_.supply_mm};
    const Isometry3d T = T_base_supply_.iso.inverse() * T_base_flange;
    world.add("ball", ball_, {T * Translation3d{on_flange_mm()}});
    world.add("rod", rod_, {T * Translation3d{on_flange_mm() - Vector3d{0, 0, 3.9 * setting_.sphere_radius_mm}}}, 0.4);
    world.add("gripper", gripper_,
              {T * Translation3d{on_flange_mm() - Vector3d{0, 0, 4.5 * setting_.sphere_radius_mm}}}, 0.4);
    return world;
  }
  Vector3d on_flange_mm() const { return {8, -5, 5 * setting_.sphere_radius_mm + 20}; }

  /// Where the sphere is held over the supply, and how: the flange beside it, turned.
  SphereScan held(const Mount& truth, int k) {
    const Vector3d half = wanted_.spread_out ? Vector3d{0.33, 0.33, 0.45} : Vector3d{0.01, 0.01, 0.01};
    const Vector3d centre =
        T_base_supply_ * Vector3d{within(half.x()) * setting_.supply_mm.x(), within(half.y()) * setting_.supply_mm.y(),
                                  (0.65 + within(half.z())) * setting_.supply_mm.z()};
    Isometry3d T_base_flange{AngleAxisd{rad(90), Vector3d::UnitY()}};
    if (wanted_.turned)
      T_base_flange = AngleAxisd{within(rad(60)), Vector3d::UnitZ()} * T_base_flange *
                      AngleAxisd{within(rad(25)), Vector3d::UnitY()} * AngleAxisd{within(rad(60)), Vector3d::UnitZ()};
    T_base_flange.translation() = centre - T_base_flange.linear() * on_flange_mm();
    const emulators::World world = world_with(T_base_flange);

    SphereScan scan;
    scan.name = "scan " + std::to_string(k + 1);
    scan.T_base_holder = T_base_flange * noise(wanted_.pose_mm, wanted_.pose_deg);
    const double duration_s = 2 * setting_.sweep_deg / setting_.sweep_deg_s;
    const double from = k % 2 == 0 ? -1 : 1;
    const auto angle_at = [&](double t) { return rad(from * setting_.sweep_deg * (2 * t / duration_s - 1)); };
    const double offset = normal(rad(wanted_.sweep_deg)), quantum = rad(wanted_.angle_step_deg);
    std::vector<double> samples;
    for (double t = 0; t < duration_s + 0.02; t += 0.01) {
      const double told = angle_at(t) + offset + normal(rad(wanted_.angle_deg));
      samples.push_back(wanted_.quiet ? told : quantum * std::round(told / quantum));
    }
    measure(scan, world, duration_s, [&](double t, Isometry3d& told) {
      const auto i = static_cast<std::size_t>(t / 0.01);
      const double part = t / 0.01 - static_cast<double>(i);
      told = vision::calibration::pivot_turned(Angle::rad((1 - part) * samples[i] + part * samples[i + 1]));
      return truth.T_base_scanner(vision::calibration::pivot_turned(Angle::rad(angle_at(t))));
    });
    return scan;
  }

  /// The robot carries the scanner straight past the sphere, looking at it from anywhere above.
  SphereScan carried(const Mount& truth, int k) {
    const double height = std::max(0.5 * setting_.supply_mm.z(), 3 * setting_.sphere_radius_mm);
    Isometry3d T_base_stand{AngleAxisd::Identity()};
    const Vector3d centre = T_base_supply_ * Vector3d{20, -15, height};
    T_base_stand.translation() = centre - on_flange_mm();
    const emulators::World world = world_with(T_base_stand);

    const double middle = (setting_.nearest_mm + setting_.farthest_mm) / 2;
    const double depth =
        middle + (wanted_.spread_out ? within((setting_.farthest_mm - setting_.nearest_mm) / 2) : within(5));
    const double sideways = (wanted_.spread_out ? within(setting_.sideways) : 0) * depth;
    Isometry3d look{AngleAxisd{rad(180), Vector3d::UnitX()}};  // straight down
    if (wanted_.turned)
      look = AngleAxisd{within(rad(180)), Vector3d::UnitZ()} * AngleAxisd{within(rad(35)), Vector3d::UnitX()} *
             AngleAxisd{within(rad(35)), Vector3d::UnitY()} * look;
    const double reach = 2.2 * setting_.sphere_radius_mm, duration_s = 2 * reach / setting_.path_mm_s;
    const auto flange_at = [&](double t) {
      Isometry3d T = look;
      T.translation() = centre - look.linear() * Vector3d{sideways, -reach + setting_.path_mm_s * t, depth};
      return Isometry3d{T * truth.T_carrier_scanner.inverse()};
    };
    SphereScan scan;
    scan.name = "scan " + std::to_string(k + 1);
    const Isometry3d constant = noise(wanted_.pose_mm, wanted_.pose_deg);
    std::vector<Vector3d> samples;
    for (double t = 0; t < duration_s + 0.04; t += 0.02) samples.push_back(normals(wanted_.sample_mm));
    measure(scan, world, duration_s, [&](double t, Isometry3d& told) {
      const auto i = static_cast<std::size_t>(t / 0.02);
      const double part = t / 0.02 - static_cast<double>(i);
      const Isometry3d truly = flange_at(t);
      told = Translation3d{(1 - part) * samples[i] + part * samples[i + 1]} * truly * constant;
      return truth.T_base_scanner(truly);
    });
    return scan;
  }

  /// `where` gives the scanner's true place in the base, and what its carrier says of itself.
  template <class Where>
  void measure(SphereScan& scan, const emulators::World& world, double duration_s, const Where& where) {
    Isometry3d told;
    const emulators::WhereScanner place = [&](TimePoint at) {
      return Transform<frame::Supply, frame::Scanner>{T_base_supply_.iso.inverse() *
                                                      where(in_s(at.time_since_epoch()), told)};
    };
    emulators::RangeNoise range_noise = wanted_.quiet ? emulators::RangeNoise::exact() : emulators::RangeNoise{};
    emulators::LightSection section = wanted_.quiet ? emulators::LightSection{}.exact() : emulators::LightSection{};
    range_noise.seed = section.seed = random_();
    const emulators::ScannerView lms400{world, place, range_noise};
    const emulators::Lps36View lps36{world, place, section};
    for (double t = 0; t < duration_s; t += 1 / setting_.frequency_hz) {
      const TimePoint at{from_s(t)};
      CarriedProfile profile;
      if (wanted_.scanner == SphereScanner::Lms400) {
        const auto line = lms400(at, Angle::deg(70), Angle::deg(0.25), 161);
        for (std::size_t i = 0; i < line.range_mm.size(); ++i) {
          const double angle = rad(70 + 0.25 * static_cast<double>(i));
          profile.x_mm.push_back(static_cast<float>(line.range_mm[i] * std::cos(angle)));
          profile.z_mm.push_back(static_cast<float>(line.range_mm[i] * std::sin(angle)));
        }
      } else {
        auto line = lps36(at, 376);
        for (float& x : line.x_mm) x = 0.1F * std::round(10 * x);
        for (float& z : line.z_mm) z = 0.1F * std::round(10 * z);
        profile.x_mm = std::move(line.x_mm);
        profile.z_mm = std::move(line.z_mm);
      }
      profile.T_root_carrier = told;
      scan.profiles.push_back(std::move(profile));
    }
  }

  SphereScans wanted_;
  Setting setting_;
  std::mt19937_64 random_;
  Transform<frame::Base, frame::Supply> T_base_supply_;
  std::shared_ptr<const emulators::RayMesh> ball_, rod_, gripper_;
};
}  // namespace

EmulatedScans scan_spheres(const SphereScans& wanted) { return Rig{wanted}.scan(); }

double true_error_mm(const EmulatedScans& emulated, const vision::calibration::Answer& answer) {
  if (!emulated.truth.on_pivot) return apart_mm(answer.mount, emulated.truth, answer.seen);
  std::vector<vision::calibration::SeenPoint> seen;
  for (const Vector3d& place : emulated.question.places_mm)
    if (const auto point = seen_from_pivot(emulated.truth, place)) seen.push_back(*point);
  return apart_mm(answer.mount, emulated.truth, seen);
}
}  // namespace binpick::support
