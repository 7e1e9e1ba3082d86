#include "vision/registration.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <gtest/gtest.h>
#include <numbers>
#include <vector>

#include "drivers/scanner/lms400/session.hpp"
#include "tests/emulators/scanner/scanner_view.hpp"

/// Scanner session, emulated scanner and registration together: a known block, scanned while the pivot turns.
namespace binpick::emulators {
namespace {
using namespace std::chrono_literals;
using Eigen::Vector3d;
constexpr double kDeg = std::numbers::pi / 180;

/// As in the example cell file: pivot 1.86 m above the floor, its axis along base x, lines along x, sweep along y.
ScannerPlace example_place() {
  ScannerPlace place;
  place.T_base_pivot.iso = Eigen::Translation3d{1200, 0, 1860} * Eigen::AngleAxisd{90 * kDeg, Vector3d::UnitY()};
  place.T_pivot_scanner.iso = Eigen::Translation3d{60, 0, 0} * Eigen::AngleAxisd{-90 * kDeg, Vector3d::UnitY()} *
                              Eigen::AngleAxisd{180 * kDeg, Vector3d::UnitX()};
  place.T_base_supply.iso = Eigen::Translation3d{1200, 0, 0};
  return place;
}

const Vector3d kBlock_mm{300, 200, 150};
constexpr double kBlockY_mm = 60;

/// Points of one sweep over ±16 degrees. Profiles get the pivot's angle of their own time less `latency_error`.
std::vector<Eigen::Vector3f> sweep(double speed_deg_s, Duration latency_error, const RangeNoise& noise) {
  World world{{1000, 800, 500}};
  Transform<frame::Supply, frame::Object> T;
  T.iso = Eigen::Translation3d{-40, kBlockY_mm, kBlock_mm.z() / 2};
  world.add("block", std::make_shared<RayMesh>(box_mesh(kBlock_mm)), T);
  const ScannerPlace place = example_place();
  const TimePoint begin = TimePoint{} + 100s;
  const auto pivot = [&](TimePoint t) {
    return Angle::deg(std::clamp(-16 + speed_deg_s * in_s(t - begin), -16., 16.));
  };
  Lms400 device{ScannerView{world, on_pivot(place, pivot), noise}};
  drivers::lms400::Options options;
  options.start = Angle::deg(70);
  options.range = Angle::deg(40);
  drivers::lms400::Session session{options};
  TimePoint now = begin - 500ms;
  device.on_connected(now);
  session.on_connected(now);
  const vision::ScannerMount mount{place.T_base_pivot, place.T_pivot_scanner};
  std::vector<Eigen::Vector3f> points;
  const TimePoint end = begin + from_s(32 / speed_deg_s);
  while (now < end) {
    for (bool moved = true; moved;) {
      const Bytes to_device = session.take_output(), to_session = device.take_output();
      moved = !to_device.empty() || !to_session.empty();
      if (!to_device.empty()) device.on_bytes(to_device, now);
      if (!to_session.empty()) session.on_bytes(to_session, now);
    }
    if (session.state() == drivers::lms400::Session::State::Idle) {
      session.start_measuring(now);
      device.on_bytes(session.take_output(), now);
    }
    while (auto event = session.take_event()) {
      const auto* received = std::get_if<drivers::lms400::ProfileReceived>(&*event);
      if (received == nullptr || received->profile.measured_at < begin) continue;
      const auto& profile = received->profile;
      vision::register_profile(
          profile.x_mm, profile.z_mm,
          place.T_base_supply.inverse() * vision::scanner_at(mount, pivot(profile.measured_at - latency_error)),
          points);
    }
    if (session.state() == drivers::lms400::Session::State::Offline) {
      ADD_FAILURE() << "scanner session failed";
      break;
    }
    now = *earlier(device.deadline(), session.deadline());
    device.on_deadline(now);
    session.on_deadline(now);
  }
  return points;
}

struct Planes {
  double top_mm, floor_mm;           ///< Mean heights.
  double low_side_mm, high_side_mm;  ///< y where the block's top begins and ends.
};
Planes planes_of(const std::vector<Eigen::Vector3f>& points) {
  Planes planes{0, 0, 1e9, -1e9};
  double tops = 0, floors = 0;
  std::vector<double> ys;
  for (const auto& f : points) {
    const Vector3d p = f.cast<double>();
    if (std::abs(p.x() + 40) > 100) continue;
    if (std::abs(p.z() - 150) < 15 && std::abs(p.y()) < 350) ys.push_back(p.y());
    if (std::abs(p.y() - kBlockY_mm) < 70) planes.top_mm += p.z(), ++tops;
    if (p.y() < -100 && p.y() > -350) planes.floor_mm += p.z(), ++floors;
  }
  planes.top_mm /= tops;
  planes.floor_mm /= floors;
  // A few mixed points lie beyond the edges.
  std::ranges::sort(ys);
  planes.low_side_mm = ys[ys.size() / 200];
  planes.high_side_mm = ys[ys.size() - 1 - ys.size() / 200];
  return planes;
}

TEST(Registration, BlockIsWhereItIsAtTwoSpeeds) {
  for (const double speed : {17.0, 34.0}) {
    const Planes planes = planes_of(sweep(speed, Duration{0}, RangeNoise{}));
    std::printf("  %.0f deg/s: top %.2f mm, floor %.2f mm, top from y = %.1f to %.1f mm\n", speed, planes.top_mm,
                planes.floor_mm, planes.low_side_mm, planes.high_side_mm);
    EXPECT_NEAR(planes.top_mm, kBlock_mm.z(), 1);
    EXPECT_NEAR(planes.floor_mm, 0, 1);
    // One line's distance is 3 mm at the higher speed.
    EXPECT_NEAR(planes.low_side_mm, kBlockY_mm - 100, 4);
    EXPECT_NEAR(planes.high_side_mm, kBlockY_mm + 100, 4);
  }
}

TEST(Registration, LatencyWrongByTwentyMillisecondsShiftsTheBlockAlongTheSweep) {
  const Planes right = planes_of(sweep(34, Duration{0}, RangeNoise{}));
  const Planes wrong = planes_of(sweep(34, 20ms, RangeNoise{}));
  const double shift = ((wrong.low_side_mm - right.low_side_mm) + (wrong.high_side_mm - right.high_side_mm)) / 2;
  // 20 ms at 34 degrees a second are 0.68 degrees, at 1.65 m from the scanner's axis 19.6 mm.
  std::printf("  20 ms at 34 deg/s: block shifted by %.1f mm, top by %.1f mm\n", shift, wrong.top_mm - right.top_mm);
  EXPECT_NEAR(std::abs(shift), 0.68 * kDeg * 1710, 3);
}
}  // namespace
}  // namespace binpick::emulators
