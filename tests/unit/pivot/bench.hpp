#pragma once

#include <gtest/gtest.h>
#include <string>
#include <vector>

#include "drivers/pivot/codec.hpp"
#include "drivers/pivot/motion_codec.hpp"
#include "drivers/pivot/session.hpp"
#include "tests/emulators/pivot/pivot.hpp"

namespace binpick::drivers::pivot {
/// Both protocols: what the session does must not depend on which one the module speaks.
inline const auto kBothProtocols = testing::Values(Protocol::PowerCube, Protocol::Motion);
inline std::string protocol_name(Protocol protocol) { return protocol == Protocol::Motion ? "Motion" : "PowerCube"; }

class BothProtocols : public testing::TestWithParam<Protocol> {
 protected:
  emulators::PivotOptions fresh() const {
    emulators::PivotOptions options;
    options.protocol = GetParam();
    options.hurry = std::chrono::milliseconds(1);
    return options;
  }
  emulators::PivotOptions referenced() const {
    emulators::PivotOptions options = fresh();
    options.referenced = true;
    options.start = Angle::deg(0);
    return options;
  }
};
#define BOTH_PROTOCOLS(Suite) \
  INSTANTIATE_TEST_SUITE_P(Both, Suite, kBothProtocols, [](const auto& row) { return protocol_name(row.param); })

/// A session and an emulated pivot on one bus, in virtual time: they speak what `module_options` says.
struct Bench {
  explicit Bench(const emulators::PivotOptions& module_options = {}, Options options = {})
      : protocol{module_options.protocol}, module{module_options}, session{[&] {
          options.protocol = module_options.protocol;
          return options;
        }()} {
    session.on_link_up(now);
    pump();
  }

  /// Whether the frame tells the module to go somewhere.
  bool is_setpoint(const CanFrame& frame) const {
    if (protocol == Protocol::Motion) return frame.length > 1 && frame.payload[1] == 0xB0;
    return frame.length == 8;
  }
  CanFrame setpoint_accepted() const {
    if (protocol == Protocol::PowerCube) return encode(12, Reply{MoveAccepted{Motion::Step, std::nullopt}});
    return motion::frames_of(motion::kReplyBase + 12, encode(motion::Reply{motion::Done{motion::Command::MovePosition}},
                                                             motion::UnitSystem::Degree))
        .front();
  }

  void pump() {
    for (;;) {
      bool quiet = true;
      if (driver_alive) {
        for (const CanFrame& frame : session.take_frames()) {
          quiet = false;
          sent.push_back(frame);
          if (lost()) continue;
          if (is_setpoint(frame) && lose_steps) {
            session.on_frame(setpoint_accepted(), now);
          } else {
            module.on_frame(frame, now);
          }
        }
      }
      for (const CanFrame& frame : module.take_frames()) {
        quiet = false;
        if (driver_alive && !lost()) session.on_frame(frame, now);
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

  bool lost() { return lose_frame_in >= 0 && lose_frame_in-- == 0; }

  /// Jumps to the earliest deadline of both, never past `end`.
  bool step(TimePoint end) {
    pump();  // the loop sends before it waits
    auto at = earlier(driver_alive ? session.deadline() : std::nullopt, module.deadline());
    const TimePoint next = std::max(now, std::min(at.value_or(end), end));
    standstill = next == now ? standstill + 1 : 0;
    busy = busy || standstill > 50;
    now = next;
    if (driver_alive && session.deadline() && *session.deadline() <= now) session.on_deadline(now);
    if (module.deadline() && *module.deadline() <= now) module.on_deadline(now);
    pump();
    return now < end && !busy;
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
  Protocol protocol;
  emulators::Pivot module;
  Session session;
  bool driver_alive = true;
  int lose_frame_in = -1;   ///< So many frames pass, either way, then one is lost.
  bool lose_steps = false;  ///< Steps are acknowledged and not done.
  int standstill = 0;       ///< Steps in a row without progress in time.
  bool busy = false;        ///< Too many of them: a busy loop.
  std::vector<Event> events;
  std::vector<Sample> samples;
  std::vector<CanFrame> sent;
};
}  // namespace binpick::drivers::pivot
