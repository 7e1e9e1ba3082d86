#pragma once

#include <algorithm>
#include <functional>
#include <gtest/gtest.h>
#include <string>
#include <vector>

#include "base/log.hpp"
#include "drivers/scanner/lms400/codec.hpp"
#include "drivers/scanner/lms400/session.hpp"
#include "tests/emulators/scanner/lms400_device.hpp"

namespace binpick::drivers::lms400 {
/// Session and emulated device joined in memory; the clock jumps to whoever wants to wake first.
struct Pair {
  using State = Session::State;

  static emulators::ScanLine flat(TimePoint, Angle, Angle, std::size_t points) {
    return {std::vector<float>(points, 1800.F), std::vector<std::uint8_t>(points, 120)};
  }

  TimePoint now = TimePoint{} + std::chrono::hours(1);
  Session session;
  emulators::Lms400 device;
  bool connected = false;
  std::optional<TimePoint> reconnect_at;
  std::vector<Ready> ready;
  std::vector<Profile> profiles;
  std::vector<Failed> failures;
  int stopped = 0, connects = 0;
  std::vector<std::string> log;
  std::vector<std::string> sent;  ///< Commands of the session.

  explicit Pair(const Options& options = {}, const emulators::Lms400::Options& device_options = {})
      : session{options}, device{flat, device_options} {
    log::set_sink([this](log::Level, std::string_view, std::string_view text) { log.emplace_back(text); });
  }
  ~Pair() { log::set_sink({}); }

  void connect() {
    if (device.faults.unplugged) return;
    connected = true;
    ++connects;
    device.on_connected(now);
    session.on_connected(now);
    pump();
  }
  void disconnect() {
    if (!connected) return;
    connected = false;
    device.on_disconnected(now);
    session.on_disconnected(now);
    pump();
  }

  void pump() {
    for (bool moved = true; moved;) {
      moved = false;
      if (connected && device.wants_close()) {
        disconnect();
        moved = true;
      }
      if (session.take_reopen()) {
        disconnect();
        moved = true;
      }
      if (Bytes out = session.take_output(); !out.empty() && connected) {
        for (ByteView rest = out; !rest.empty();) {
          const auto one = decode(rest);
          if (const Text* text = std::get_if<Text>(&one.value().value().message)) sent.push_back(text->text);
          rest = rest.subspan((*one)->consumed);
        }
        device.on_bytes(out, now);
        moved = true;
      }
      if (Bytes out = device.take_output(); !out.empty() && connected) {
        session.on_bytes(out, now);
        moved = true;
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

  /// Reconnects half a second after a loss, as the link would.
  void run_for(Duration duration) {
    const TimePoint end = now + duration;
    while (true) {
      pump();
      if (!connected && !reconnect_at) reconnect_at = now + std::chrono::milliseconds(500);
      if (connected) reconnect_at.reset();
      auto next = earlier(earlier(session.deadline(), device.deadline()), reconnect_at);
      if (!next || *next > end) break;
      now = std::max(now, *next);
      if (reconnect_at && now >= *reconnect_at) {
        reconnect_at.reset();
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
}  // namespace binpick::drivers::lms400
