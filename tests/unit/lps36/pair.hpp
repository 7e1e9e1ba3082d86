#pragma once

#include <algorithm>
#include <functional>
#include <gtest/gtest.h>
#include <limits>
#include <string>
#include <vector>

#include "base/log.hpp"
#include "drivers/scanner/lps36/codec.hpp"
#include "drivers/scanner/lps36/session.hpp"
#include "tests/emulators/scanner/lps36_device.hpp"

namespace binpick::drivers::lps36 {
/// Session and emulated device joined in memory; the clock jumps to whoever wants to wake first.
struct Pair {
  using State = Session::State;

  /// x from -150 mm in steps of 0.8, z 412.3 mm; nothing at point 3.
  static emulators::PointLine flat(TimePoint, std::size_t points) {
    emulators::PointLine line{std::vector<float>(points), std::vector<float>(points, 412.3F)};
    for (std::size_t i = 0; i < points; ++i) line.x_mm[i] = -150.F + 0.8F * static_cast<float>(i);
    line.z_mm[3] = std::numeric_limits<float>::quiet_NaN();
    return line;
  }

  TimePoint now = TimePoint{} + std::chrono::hours(1);
  Session session;
  emulators::Lps36 device;
  bool open = false;
  std::optional<TimePoint> reopen_at;
  std::vector<Ready> ready;
  std::vector<Profile> profiles;
  std::vector<Failed> failures;
  int stopped = 0, opens = 0;
  std::vector<std::string> log;
  std::vector<Telegram> sent;                       ///< Commands of the session.
  std::function<void(const Telegram&)> on_arrival;  ///< Each proper telegram that the session gets.
  std::function<bool(const Telegram&)> loses;       ///< True: this command never arrives.

  explicit Pair(const Options& options = {}, const emulators::Lps36::Options& device_options = {})
      : session{options}, device{flat, device_options} {
    log::set_sink([this](log::Level, std::string_view, std::string_view text) { log.emplace_back(text); });
  }
  ~Pair() { log::set_sink({}); }
  Pair(const Pair&) = delete;
  Pair& operator=(const Pair&) = delete;

  void connect() {
    open = true;
    ++opens;
    session.on_connected(now);
    pump();
  }

  void pump() {
    for (bool moved = true; moved;) {
      moved = false;
      if (session.take_reopen()) open = false;
      for (const Bytes& frame : session.take_frames()) {
        moved = true;
        sent.push_back(decode(frame).value());
        if (open && !(loses && loses(sent.back()))) device.on_frame(frame, now);
      }
      for (const Bytes& frame : device.take_frames()) {
        moved = true;
        if (!open) continue;
        if (const auto telegram = decode(frame); telegram && on_arrival) on_arrival(*telegram);
        session.on_frame(frame, now);
      }
      while (auto event = session.take_event()) {
        moved = true;
        if (auto* r = std::get_if<Ready>(&*event)) ready.push_back(*r);
        if (auto* p = std::get_if<ProfileReceived>(&*event)) profiles.push_back(std::move(p->profile));
        if (std::holds_alternative<Stopped>(*event)) ++stopped;
        if (auto* f = std::get_if<Failed>(&*event)) failures.push_back(*f);
      }
    }
  }

  /// Opens the socket again half a second after a failure, as the link would.
  void run_for(Duration duration) {
    const TimePoint end = now + duration;
    while (true) {
      pump();
      if (!open && opens > 0 && !reopen_at) reopen_at = now + std::chrono::milliseconds(500);
      auto next = earlier(earlier(session.deadline(), device.deadline()), reopen_at);
      if (!next || *next > end) break;
      now = std::max(now, *next);
      if (reopen_at && now >= *reopen_at) {
        reopen_at.reset();
        connect();
      }
      device.on_deadline(now);
      if (session.deadline() && now >= *session.deadline()) session.on_deadline(now);
    }
    now = end;
  }
  bool run_until(const std::function<bool()>& done, Duration limit) {
    for (const TimePoint end = now + limit; now < end && !done();) run_for(std::chrono::milliseconds(1));
    return done();
  }
  bool run_until(State state, Duration limit = std::chrono::seconds(20)) {
    return run_until([&] { return session.state() == state; }, limit);
  }
  bool logged(std::string_view part) const {
    return std::ranges::any_of(log, [&](const auto& line) { return line.find(part) != std::string::npos; });
  }
};
}  // namespace binpick::drivers::lps36
