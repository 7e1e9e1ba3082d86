#pragma once

#include <cstdint>
#include <deque>

#include "base/clock.hpp"
#include "base/lower_line.hpp"

namespace binpick::drivers::scanner {
/// When each scan was measured, from when its telegram arrived and from the scan counter. The device gives no time.
///
/// Scan k was measured at t0 + k·T. Telegrams come late by anything from nothing to tens of milliseconds (bursts: many
/// at once), never early. So the straight line that lies under all arrivals of the last second and a half, as close as
/// it can, is the clock: its slope is the true period (kept within 0.2 % of the nominal one), its height the smallest
/// delay. What is constant in the delay cannot be seen from here; the cell file's scanner latency takes it away.
/// After half a second the error is below 1 ms where arrivals jitter by 0 … 20 ms and some of them are in time. (Where
/// each single telegram is late by itself by that much, and none may overtake, hardly one ever is: then about 5 ms.)
class ScanClock {
 public:
  explicit ScanClock(Duration nominal_period = std::chrono::microseconds(2778));
  void restart(Duration nominal_period);

  struct Reading {
    TimePoint measured_at;        ///< Never after received_at.
    std::uint64_t lost = 0;       ///< Scans missing since the one before.
    bool counter_jumped = false;  ///< The counter disagrees with the time passed: the clock has begun anew.
  };
  /// `counter` wraps at 65536. A counter that stands still counts as having gone on by one.
  Reading on_scan(std::uint16_t counter, TimePoint received_at);

 private:
  double lateness() const;

  double period_s_ = 0;
  TimePoint origin_, last_received_at_;
  std::int64_t scan_ = -1;  ///< Of the newest arrival; -1: none yet.
  std::uint16_t counter_ = 0;
  std::deque<Arrival> arrivals_;  ///< By the time that the counter says, at the nominal period.
};
}  // namespace binpick::drivers::scanner
