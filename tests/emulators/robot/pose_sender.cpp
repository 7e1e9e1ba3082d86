#include "tests/emulators/robot/pose_sender.hpp"

#include <cmath>

namespace binpick::emulators {
using namespace drivers::robot;

PoseSender::PoseSender(FlangeMotion motion, const Options& options)
    : motion_{std::move(motion)}, options_{options}, line_{options.delay_min, options.delay_max, options.seed} {}

void PoseSender::on_connected(TimePoint now) {
  now_ = now;
  wants_close_ = false;
  line_.clear();
  next_ = now;
  bytes_sent_ = 0;
}

void PoseSender::on_bytes(ByteView, TimePoint now) { now_ = now; }

void PoseSender::on_disconnected(TimePoint now) {
  now_ = now;
  next_.reset();
  line_.clear();
}

void PoseSender::restart(bool restarts_clock, TimePoint now) {
  sequence_ = 0;
  if (restarts_clock) {
    options_.clock.first_s = 0;
    options_.clock.started = now;
  }
  cut();
}

void PoseSender::on_deadline(TimePoint now) {
  now_ = now;
  while (next_ && *next_ <= now) {
    const double time_ms = 1e3 * options_.clock.at(*next_);
    PoseLine line{sequence_,
                  std::fmod(std::floor(time_ms / options_.clock_step_ms) * options_.clock_step_ms, kPoseTimeWrap_ms),
                  (motion_(*next_) * options_.T_flange_tcp).iso};
    sequence_ = static_cast<std::uint16_t>((sequence_ + 1) % kPoseSequences);
    const std::string text = encode(line, options_.dialect);
    if (lose_ > 0)
      --lose_;
    else
      line_.send(Bytes(as_bytes(text).begin(), as_bytes(text).end()), *next_, faults);
    *next_ += options_.period;
  }
}

std::optional<TimePoint> PoseSender::deadline() const { return earlier(next_, line_.deadline()); }

Bytes PoseSender::take_output() {
  if (wants_close()) return {};
  Bytes out = line_.take(now_, faults);
  bytes_sent_ += out.size();
  if (faults.disconnect_after_bytes && bytes_sent_ >= *faults.disconnect_after_bytes) {
    out.resize(out.size() - (bytes_sent_ - *faults.disconnect_after_bytes));
    faults.disconnect_after_bytes.reset();
    cut();
  }
  return out;
}
}  // namespace binpick::emulators
