#include "daemon/cell.hpp"
#include "plc/registers.hpp"

/// What a cycle leaves behind. Nothing is written here: whoever owns the Cell takes the records and has them written.
namespace binpick::daemon {
void Cell::begin_record() {
  record_.reset();
  if (data_->config.record.dir.empty()) return;
  record_ = begun_record(*data_, boot_count_, cycle_id_);
  record_->request =
      RecordedRequest{request_, static_cast<std::uint32_t>(supply_), static_cast<std::uint32_t>(recipe_)};
}

void Cell::end_record(RecordedAnswer answer, TimePoint now) {
  if (!record_) return;
  for (std::uint16_t offset = 0; offset < plc::kMapLength; ++offset)
    answer.registers.push_back(plc_.register_at(offset));
  answer.requested_at = request_at_;
  if (record_->scan) answer.last_profile_at = last_profile_at_;
  answer.answered_at = now;
  record_->answer = std::move(answer);
  records_.push_back(std::move(*std::exchange(record_, std::nullopt)));
}

std::optional<Record> Cell::take_record() {
  if (records_.empty()) return std::nullopt;
  Record record = std::move(records_.front());
  records_.pop_front();
  return record;
}

void Cell::on_records_written(bool written, TimePoint now) {
  if (written) {
    plc_.clear(plc::Alarm::RecordsNotWritten, now);
  } else {
    plc_.raise(plc::Alarm::RecordsNotWritten, now);
  }
}
}  // namespace binpick::daemon
