#pragma once

#include <limits>

#include "daemon/cycle/record_codec.hpp"

/// A record of which every field says something of its own.
namespace binpick::daemon {
template <class To, class From>
Transform<To, From> transform_of(double seed) {
  Transform<To, From> T;
  T.iso = Eigen::AngleAxisd{seed, Eigen::Vector3d{1, seed, 2}.normalized()};
  T.iso.translation() = Eigen::Vector3d{seed, 2 * seed, -seed};
  return T;
}

inline drivers::sweep::RegisteredProfile profile_of(std::uint16_t counter, drivers::sweep::CarrierPose carrier) {
  drivers::sweep::RegisteredProfile registered;
  registered.profile.counter = counter;
  registered.profile.encoder = 77;
  const float nothing = std::numeric_limits<float>::quiet_NaN();
  registered.profile.x_mm = {1, 2.5F, nothing};
  registered.profile.z_mm = {900, 901.25F, nothing};
  registered.profile.received_at = TimePoint{std::chrono::microseconds(1000 + counter)};
  registered.profile.measured_at = TimePoint{std::chrono::microseconds(900 + counter)};
  registered.carrier = carrier;
  return registered;
}

inline DetectResult result_of_all_fields() {
  DetectResult result;
  result.cycle_id = 42;
  result.loops = "avx2";
  result.fill = {0.25, 1234.5, 0.9};
  result.supply_empty = true;
  vision::Detection detection;
  detection.T_supply_object = transform_of<frame::Supply, frame::Object>(0.5);
  detection.score = 0.875;
  detection.visible_fraction = 0.75;
  for (int i = 0; i < 36; ++i) detection.covariance.reshaped()[i] = i;
  detection.evidence[vision::Clue::Fit] = 0.5F;
  detection.evidence[vision::Clue::Known] = 0.25F;
  result.report.detections = {detection, vision::Detection{}};
  result.report.rejected = {
      {transform_of<frame::Supply, frame::Object>(0.7), 0.1, detection.evidence, "edges missing"}};
  result.report.first = vision::FirstValid{transform_of<frame::Supply, frame::Object>(0.9), 12.5, 17};
  result.report.maxima = 31;
  result.report.hypotheses = 3456;
  result.report.cut_short = true;
  result.report.time_ms = 88.5;
  result.report.stages_ms = {{"maxima", 1.5}, {"surface", 2.5}};
  vision::Reachable reachable{0,
                              1,
                              transform_of<frame::Supply, frame::Tcp>(1.1),
                              transform_of<frame::Supply, frame::Tcp>(1.2),
                              transform_of<frame::Supply, frame::Tcp>(1.3),
                              0.9};
  reachable.covered_mm = 2.5;
  reachable.is_tight = reachable.is_aslant = true;
  result.choice.reachable = {reachable};
  result.choice.unreachable = {{1, vision::Obstacle::Tilt, "tilt 51 deg is over 40 deg"}};
  result.choice.rejected = {{1, 2, 3, vision::Obstacle::Tilt, 0.9, 0.7, ""},
                            {0, 1, 0, vision::Obstacle::Wall, 12, 0, "wall x max"}};
  result.place.T_said_found.translation() = Eigen::Vector3d{3, 4, 0};
  result.place.turn_rad = 0.02;
  result.place.walls = 3;
  result.not_located = "no wall was seen";
  return result;
}

inline Record record_of_all_fields() {
  Record record;
  record.origin = {"0.1.0", 7, 42, 1'700'000'000'123};
  record.cell.cell = {"/etc/binpick/cell.toml", "[cell]\nname = \"test\"\n"};
  record.cell.parts = {{"/etc/binpick/a.toml", "mesh = \"a.stl\"\n"}, {"/etc/binpick/b.toml", "mesh = \"b.stl\"\n"}};
  record.cell.knowledge_bases = {{"/var/lib/binpick/a.kb", 0x0123456789ABCDEF}, {"/var/lib/binpick/b.kb", 2}};
  record.request = RecordedRequest{{9, 1, 2, true}, 1, 0};
  auto& scan = record.scan.emplace();
  scan.profiles = {profile_of(5, Angle::rad(0.25)), profile_of(6, transform_of<frame::Base, frame::Flange>(0.3))};
  scan.figures = {std::chrono::milliseconds(1500), 2, 1, 3};
  record.scan_of_cycle = 41;
  record.result = result_of_all_fields();
  record.answer = RecordedAnswer{plc::ResultCode::PickFound,
                                 plc::Alarm::ScanTimeout,
                                 12,
                                 0,
                                 {1, 2, 65535},
                                 TimePoint{std::chrono::nanoseconds(123'456'789)},
                                 TimePoint{std::chrono::nanoseconds(223'456'789)},
                                 TimePoint{std::chrono::nanoseconds(323'456'789)}};
  return record;
}
}  // namespace binpick::daemon
