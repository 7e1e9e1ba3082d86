#pragma once

#include <algorithm>
#include <functional>
#include <vector>

#include "base/rotation.hpp"
#include "drivers/robot/pose_sample.hpp"
#include "tests/emulators/robot/pose_clock.hpp"

/// A source of poses and its emulated sender on one wire, in virtual time.
namespace binpick::drivers::robot {
inline constexpr TimePoint kLinkStart{std::chrono::hours(100)};

/// Sweeps 200 mm to and fro in 2 s at up to 314 mm/s, turning by half a radian on the way.
inline Transform<frame::Base, frame::Flange> swing(TimePoint at) {
  const double phase = 3.14159265358979 * in_s(at - kLinkStart);
  Transform<frame::Base, frame::Flange> T;
  T.iso.translation() = Eigen::Vector3d{600 + 100 * std::sin(phase), -200, 900 + 20 * std::cos(phase)};
  T.iso.linear() = from_wpr_deg({180, 15 * std::sin(phase), 30});
  return T;
}

template <class Source, class Sender>
struct PoseLink {
  Source source;
  Sender sender;
  TimePoint now = kLinkStart;
  bool linked = false;
  TimePoint link_again = kLinkStart;
  int connections = 0;
  std::vector<PoseReady> ready{};
  std::vector<PoseSample> samples{};
  std::vector<PoseFailed> failed{};

  void cut() {
    linked = false;
    link_again = now + std::chrono::milliseconds(500);
    sender.on_disconnected(now);
    source.on_disconnected(now);
  }

  void pump() {
    if (!linked && sender.wants_link() && now >= link_again) {
      linked = true;
      ++connections;
      sender.on_connected(now);
      source.on_connected(now);
    }
    sender.on_deadline(now);
    while (linked) {
      const Bytes to_cell = sender.take_output();
      if (!to_cell.empty()) source.on_bytes(to_cell, now);
      const Bytes to_robot = source.take_output();
      if (!to_robot.empty()) sender.on_bytes(to_robot, now);
      if (source.take_reopen() || sender.wants_close()) cut();
      if (to_cell.empty() && to_robot.empty()) break;
    }
    if (source.deadline() && *source.deadline() <= now) {
      source.on_deadline(now);
      if (linked && source.take_reopen()) cut();
    }
    while (auto event = source.take_event()) {
      if (const auto* r = std::get_if<PoseReady>(&*event)) ready.push_back(*r);
      if (const auto* s = std::get_if<PoseSample>(&*event)) samples.push_back(*s);
      if (const auto* f = std::get_if<PoseFailed>(&*event)) failed.push_back(*f);
    }
  }

  void run_for(Duration time) {
    const TimePoint end = now + time;
    while (true) {
      pump();
      auto next = earlier(linked ? sender.deadline() : std::optional{link_again}, source.deadline());
      if (!sender.wants_link() && !linked) next = source.deadline();
      if (now >= end) return;
      now = std::clamp(next.value_or(end), now + std::chrono::microseconds(1), end);
    }
  }

  /// Largest distance between a sample and where the flange was at the time that it says, in mm.
  double worst_mm(std::size_t from = 0) const {
    double worst = 0;
    for (std::size_t i = from; i < samples.size(); ++i)
      worst =
          std::max(worst, (samples[i].T_base_flange.iso.translation() - swing(samples[i].at).iso.translation()).norm());
    return worst;
  }
};
}  // namespace binpick::drivers::robot
