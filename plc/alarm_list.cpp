#include "plc/alarm_list.hpp"

#include <algorithm>

namespace binpick::plc {
void AlarmList::add(Alarm alarm, bool active) {
  const auto entry = std::ranges::find(entries_, alarm, &Entry::alarm);
  if (entry != entries_.end()) {
    // A cause that goes and comes again is a new alarm.
    if (active && !entry->active) ++total_, last_ = alarm;
    entry->active = entry->active || active;
    return;
  }
  entries_.push_back({alarm, active});
  last_ = alarm;
  ++total_;
}

void AlarmList::raise(Alarm alarm) { add(alarm, true); }
void AlarmList::note(Alarm alarm) { add(alarm, false); }

void AlarmList::clear(Alarm alarm) {
  const auto entry = std::ranges::find(entries_, alarm, &Entry::alarm);
  if (entry != entries_.end()) entry->active = false;
}

void AlarmList::reset() {
  std::erase_if(entries_, [](const Entry& entry) { return !entry.active; });
}

bool AlarmList::active() const { return std::ranges::any_of(entries_, &Entry::active); }

std::array<Alarm, kAlarmListLength> AlarmList::listed() const {
  std::array<Alarm, kAlarmListLength> out{};
  for (std::size_t i = 0; i < std::min(out.size(), entries_.size()); ++i) out[i] = entries_[i].alarm;
  return out;
}
}  // namespace binpick::plc
