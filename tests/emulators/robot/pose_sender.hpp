#pragma once

#include <cstdint>
#include <optional>

#include "drivers/robot/pose_stream.hpp"
#include "tests/emulators/robot/pose_clock.hpp"

namespace binpick::emulators {
/// The background program of a Fanuc or Kawasaki (docs/robots/) that sends the flange's pose as lines: the client of
/// the cell. It never reads.
///
/// Faults: silent, delay, garbage (one byte of each line), split_every_byte, disconnect_after_bytes, unplugged.
class PoseSender {
 public:
  struct Options {
    drivers::robot::Dialect dialect = drivers::robot::Dialect::Fanuc;
    Duration period = std::chrono::milliseconds(20);
    double clock_step_ms = 2;  ///< In which the controller's clock counts.
    PoseClock clock;
    Duration delay_min = std::chrono::microseconds(200), delay_max = std::chrono::milliseconds(5);
    Transform<frame::Flange, frame::Tcp> T_flange_tcp;  ///< Its pose is sent.
    std::uint64_t seed = 1;
  };
  PoseSender(FlangeMotion motion, const Options& options);

  void on_connected(TimePoint now);
  void on_bytes(ByteView bytes, TimePoint now);
  void on_disconnected(TimePoint now);
  void on_deadline(TimePoint now);
  std::optional<TimePoint> deadline() const;
  Bytes take_output();
  bool wants_close() const { return wants_close_ || faults.unplugged; }
  bool wants_link() const { return !faults.unplugged; }

  /// The program is started again: its line numbers begin anew, and its clock with `restarts_clock`.
  void restart(bool restarts_clock, TimePoint now);
  void cut() { wants_close_ = true; }
  void lose(int lines) { lose_ += lines; }  ///< The next ones are numbered but not sent.

  Faults faults;

 private:
  FlangeMotion motion_;
  Options options_;
  DelayLine line_;
  TimePoint now_{};
  bool wants_close_ = false;
  std::optional<TimePoint> next_;  // connected
  std::uint16_t sequence_ = 0;
  int lose_ = 0;
  std::size_t bytes_sent_ = 0;
};
}  // namespace binpick::emulators
