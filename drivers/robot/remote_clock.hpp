#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "base/clock.hpp"
#include "base/lower_line.hpp"

namespace binpick::drivers::robot {
/// A sender's clock, from its time stamps (seconds from an epoch of its own) and when they arrived here.
///
/// A message comes late by anything, never early. So the least of arrival - stamp in each half second counts, and the
/// straight line under those of the last three minutes is the difference of the clocks: its slope is their drift, its
/// height offset and least delay of the network. The least delay cannot be told from the offset.
/// Bounded: one point for each half second of three minutes, whatever the rate. Pure: no clock of its own.
class RemoteClock {
 public:
  enum class Reading {
    Good,
    Repeated,  ///< The stamp before once more: nothing is learned from it.
    Stopped,   ///< For half a second now the stamps stand still. Once.
    Jumped     ///< The stamps do not fit the time that passed (a restart, a wrap): the estimate begins anew with this.
  };
  Reading add(double sender_s, TimePoint arrival);

  /// When the sender's clock showed `sender_s`. Of a stamp that was added never after its arrival. Needs one add().
  TimePoint at(double sender_s) const;
  /// By how much the sender's clock is faster than ours; 0 while it is not known.
  double drift_ppm() const;
  /// Of at(), beside the least delay; nullopt while there is hardly anything to judge it by.
  std::optional<Duration> uncertainty() const;
  bool settled() const;  ///< The drift is known: some five seconds of stamps.
  void restart();

 private:
  void begin(double sender_s, TimePoint arrival);
  void close_window(double at_s);

  bool begun_ = false;
  bool drift_known_ = false;
  double origin_s_ = 0;  ///< The sender's; at_s and late_s count from both origins.
  TimePoint origin_;
  double last_s_ = 0;
  TimePoint last_arrival_;
  TimePoint moved_at_;  ///< Arrival of the last stamp that was another than the one before.
  bool stop_told_ = false;
  std::optional<TimePoint> late_since_;  ///< Each stamp since then was much too late.
  double window_begin_s_ = 0;
  std::optional<Arrival> least_;    ///< Of the window under way.
  std::deque<Arrival> least_late_;  ///< Of the windows of the last minutes.
  LowerLine line_;
};
}  // namespace binpick::drivers::robot
