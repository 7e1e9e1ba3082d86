#pragma once

#include <optional>
#include <string>
#include <utility>
#include <variant>

#include "drivers/robot/pose_stream.hpp"
#include "drivers/robot/rtde/session.hpp"

namespace binpick::drivers::robot {
/// Where a robot's poses come from, so that a sweep need not know the make. Offline → Starting → Streaming; events
/// PoseReady, PoseSample, PoseFailed.
class PoseSource {
 public:
  using Options = std::variant<rtde::Options, PoseStreamOptions>;
  explicit PoseSource(const Options& options) : session_{make(options)} {}

  /// True: the cell connects to the robot (RTDE, port 30004). False: the robot connects to the cell.
  bool cell_connects() const { return std::holds_alternative<rtde::Session>(session_); }

  void on_connected(TimePoint now) {
    std::visit([&](auto& s) { s.on_connected(now); }, session_);
  }
  void on_bytes(ByteView bytes, TimePoint now) {
    std::visit([&](auto& s) { s.on_bytes(bytes, now); }, session_);
  }
  void on_disconnected(TimePoint now) {
    std::visit([&](auto& s) { s.on_disconnected(now); }, session_);
  }
  void on_deadline(TimePoint now) {
    std::visit([&](auto& s) { s.on_deadline(now); }, session_);
  }
  std::optional<TimePoint> deadline() const {
    return std::visit([](const auto& s) { return s.deadline(); }, session_);
  }
  Bytes take_output() {
    return std::visit([](auto& s) { return s.take_output(); }, session_);
  }
  std::optional<PoseEvent> take_event() {
    return std::visit([](auto& s) { return s.take_event(); }, session_);
  }
  bool take_reopen() {
    return std::visit([](auto& s) { return s.take_reopen(); }, session_);
  }
  PoseState state() const {
    return std::visit([](const auto& s) { return s.state(); }, session_);
  }
  /// Of the samples' times, beside the network's least delay; nullopt: not known yet.
  std::optional<Duration> uncertainty() const {
    return std::visit([](const auto& s) { return s.uncertainty(); }, session_);
  }
  /// "controller software 5.11.0"; empty: the make does not tell, or not yet.
  std::string controller() const {
    return std::visit([](const auto& s) { return s.controller(); }, session_);
  }
  /// Why the arm cannot move, as the controller says; empty: it can, or the make does not tell.
  std::string trouble() const {
    return std::visit([](const auto& s) { return s.trouble(); }, session_);
  }

 private:
  using AnySession = std::variant<rtde::Session, PoseStream>;
  static AnySession make(const Options& options) {
    if (const auto* rtde = std::get_if<rtde::Options>(&options)) return rtde::Session{*rtde};
    return PoseStream{std::get<PoseStreamOptions>(options)};
  }

  AnySession session_;
};
}  // namespace binpick::drivers::robot
