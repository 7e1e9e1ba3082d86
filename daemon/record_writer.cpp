#include "daemon/record_writer.hpp"

#include <exception>
#include <utility>

#include "base/log.hpp"
#include "daemon/cycle/record_codec.hpp"

namespace binpick::daemon {
RecordWriter::RecordWriter(std::function<void()> wake_loop)
    : wake_loop_{std::move(wake_loop)}, thread_{[this] { work(); }} {}

RecordWriter::~RecordWriter() { orders_.close(); }

void RecordWriter::post(Record record, const config::Records& place) {
  ++pending_;
  if (orders_.try_push({std::move(record), place})) {
    if (dropped_ > 0)
      BINPICK_LOG(Notice, "record", "the disk keeps pace again; %llu record(s) were dropped",
                  static_cast<unsigned long long>(dropped_));
    dropped_ = 0;
    return;
  }
  --pending_;
  if (++dropped_ == 1)
    BINPICK_LOG(Warning, "record", "the disk of %s is too slow for the records; they are dropped until it keeps pace",
                place.dir.c_str());
}

std::optional<bool> RecordWriter::take_change() {
  const bool well = !failing_ && dropped_ == 0;
  if (std::exchange(told_, well) == well) return std::nullopt;
  return well;
}

Expected<void, std::string> RecordWriter::write(const Order& order) {
  try {
    if (!ring_ || ring_->dir() != order.place.dir) ring_.emplace(order.place.dir);
    return ring_->write(record_name(order.record.origin), encode(order.record),
                        static_cast<std::uint64_t>(order.place.size_max_mb * 1e6));
  } catch (const std::exception& failure) {
    return unexpected(std::string{failure.what()});
  }
}

void RecordWriter::work() {
  for (;;) {
    auto order = orders_.pop_for(std::chrono::hours(1));
    if (!order && orders_.closed()) return;
    if (!order) continue;
    if (const auto done = write(*order)) {
      ++written_;
      if (lost_ > 0)
        BINPICK_LOG(Notice, "record", "records are written again; %llu lost", static_cast<unsigned long long>(lost_));
      lost_ = 0;
    } else if (++lost_ == 1) {
      BINPICK_LOG(Warning, "record", "%s; picking goes on without records", done.error().c_str());
    }
    failing_ = lost_ > 0;
    order.reset();  // its memory goes before it counts as done
    --pending_;
    wake_loop_();
  }
}
}  // namespace binpick::daemon
