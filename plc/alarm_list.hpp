#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "plc/alarms.hpp"
#include "plc/registers.hpp"

namespace binpick::plc {
/// Alarms since the last reset, in the order in which they came (first-out). One whose cause has gone stays listed
/// until the PLC resets, so that an alarm that came while the PLC was away is seen once it is back.
class AlarmList {
 public:
  /// Listed until clear() and reset(). Again while listed: nothing new.
  void raise(Alarm alarm);
  /// The cause has gone; still listed until reset().
  void clear(Alarm alarm);
  /// An alarm of one moment: listed until reset().
  void note(Alarm alarm);
  /// Forgets all whose cause has gone.
  void reset();

  bool active() const;  ///< The cause of one at least is still there.
  std::uint16_t count() const { return static_cast<std::uint16_t>(entries_.size()); }
  std::array<Alarm, kAlarmListLength> listed() const;  ///< The first eight, the rest None.
  Alarm first() const { return entries_.empty() ? Alarm::None : entries_.front().alarm; }
  Alarm last() const { return last_; }
  std::uint16_t total() const { return total_; }

 private:
  struct Entry {
    Alarm alarm;
    bool active;
  };
  void add(Alarm alarm, bool active);
  std::vector<Entry> entries_;  // each alarm once: bounded by their number
  Alarm last_ = Alarm::None;
  std::uint16_t total_ = 0;
};
}  // namespace binpick::plc
