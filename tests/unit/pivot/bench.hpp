#pragma once

#include <vector>

#include "drivers/pivot/session.hpp"
#include "tests/emulators/pivot/pivot.hpp"

namespace binpick::drivers::pivot {
/// A session and an emulated pivot on one bus, in virtual time.
struct Bench {
  explicit Bench(const emulators::PivotOptions& module_options = {}, const Options& options = {})
      : module{module_options}, session{options} {
    session.on_link_up(now);
    pump();
  }

  void pump() {
    for (;;) {
      bool quiet = true;
      if (driver_alive) {
        for (const CanFrame& frame : session.take_frames()) {
          quiet = false;
          sent.push_back(frame);
          module.on_frame(frame, now);
        }
      }
      for (const CanFrame& frame : module.take_frames()) {
        quiet = false;
        if (driver_alive) session.on_frame(frame, now);
      }
      if (quiet) break;
    }
    while (auto event = session.take_event()) {
      if (const auto* sample = std::get_if<Sample>(&*event))
        samples.push_back(*sample);
      else
        events.push_back(*event);
    }
  }

  /// Jumps to the earliest deadline of both, never past `end`.
  bool step(TimePoint end) {
    auto at = earlier(driver_alive ? session.deadline() : std::nullopt, module.deadline());
    const TimePoint next = std::max(now, std::min(at.value_or(end), end));
    if (next == now)
      ++stuck;
    else
      stuck = 0;
    now = next;
    if (driver_alive && session.deadline() && *session.deadline() <= now) session.on_deadline(now);
    if (module.deadline() && *module.deadline() <= now) module.on_deadline(now);
    pump();
    return now < end && stuck < 1000;
  }

  void run_for(Duration time) {
    const TimePoint end = now + time;
    while (step(end)) {
    }
  }

  template <class Condition>
  bool run_until(Condition condition, Duration limit) {
    const TimePoint end = now + limit;
    while (!condition())
      if (!step(end)) return condition();
    return true;
  }

  bool run_until_state(Session::State state, Duration limit) {
    return run_until([&] { return session.state() == state; }, limit);
  }

  template <class T>
  int count() const {
    int n = 0;
    for (const Event& event : events) n += std::holds_alternative<T>(event) ? 1 : 0;
    return n;
  }

  const Failed* last_failed() const {
    for (auto event = events.rbegin(); event != events.rend(); ++event)
      if (const auto* failed = std::get_if<Failed>(&*event)) return failed;
    return nullptr;
  }

  TimePoint now{std::chrono::hours(1)};
  emulators::Pivot module;
  Session session;
  bool driver_alive = true;
  int stuck = 0;  ///< Steps without progress in time: a busy loop.
  std::vector<Event> events;
  std::vector<Sample> samples;
  std::vector<CanFrame> sent;
};
}  // namespace binpick::drivers::pivot
