#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "base/bytes.hpp"
#include "base/clock.hpp"
#include "base/units.hpp"
#include "drivers/scanner/lms400/codec.hpp"
#include "tests/emulators/faults.hpp"

namespace binpick::emulators {
/// What the device's beam meets along one line. Point i lies at device angle first + i · step.
struct ScanLine {
  std::vector<float> range_mm;  ///< NaN or 0: no echo.
  std::vector<std::uint8_t> remission;
};

/// A SICK LMS 400 seen from the network: TCP server side, one client. Text commands and measured telegrams share the
/// stream; lines are measured on the device's own beat, whoever listens.
class Lms400 {
 public:
  /// Measures one line at the middle of its scan.
  using Measure = std::function<ScanLine(TimePoint middle, Angle first, Angle step, std::size_t points)>;

  /// What no public source tells of the device is chosen here.
  struct Options {
    Duration reply = std::chrono::milliseconds(3);       ///< To sRN, sWN, and to sMN's sMA.
    Duration method = std::chrono::milliseconds(8);      ///< From sMA to sAN.
    Duration spin_up = std::chrono::milliseconds(1500);  ///< After a change of frequency, before sAN.
    double frequency_hz = 360, frequency_step_hz = 1;    ///< At power-up; what it rounds to.
    double resolution_deg = 0.25, resolution_step_deg = 0.05;
    double points_per_s_max = 260'000;    ///< A faster pair of frequency and resolution is answered with an error.
    bool checks_checksum = true;          ///< Commands with a wrong one are dropped without a word.
    bool streams_on_after_close = false;  ///< A new client finds the device still measuring.
    std::uint16_t first_counter = 0;      ///< Of scans, at the first on_connected.
    double clock_error = 0;               ///< The motor turns faster than it says by this fraction.
    std::uint64_t seed = 1;               ///< Of the garbage.
  };

  explicit Lms400(Measure measure);
  Lms400(Measure measure, const Options& options);

  void on_connected(TimePoint now);
  void on_bytes(ByteView bytes, TimePoint now);
  void on_disconnected(TimePoint now);
  void on_deadline(TimePoint now);
  std::optional<TimePoint> deadline() const;
  /// What is due. With Faults::split_every_byte one byte per call, and deadline() stays in the past until all is out.
  Bytes take_output();
  /// The device ends the connection (a fault, or after mDCreset). Close it and call on_disconnected.
  bool wants_close() const;

  Faults faults;

  bool measuring() const { return format_.has_value(); }
  bool logged_in() const { return level_ >= 3; }
  std::uint64_t commands_dropped() const { return commands_dropped_; }  ///< Wrong checksum or no frame.
  std::uint64_t telegrams_sent() const { return telegrams_sent_; }
  /// As by a fault of the device: the counter of the next telegram is this much further.
  void skip_counter(std::uint16_t by) { counter_offset_ = static_cast<std::uint16_t>(counter_offset_ + by); }

 private:
  struct Due {
    TimePoint at;
    Bytes frame;
  };
  void answer(const std::string& text, TimePoint at);
  void refuse(std::uint32_t code, TimePoint now);
  void on_command(const std::string& text, TimePoint now);
  void call(const drivers::lms400::Request& request, TimePoint now);
  void write(const drivers::lms400::Request& request, TimePoint now);
  void read(const drivers::lms400::Request& request, TimePoint now);
  void set_scan(const std::string& name, double frequency_hz, double resolution_deg, double start_deg, double range_deg,
                TimePoint now);
  void finish(const std::string& name, const std::string& result, TimePoint now, Duration extra = {});
  void measure_lines(TimePoint now);
  void release(TimePoint now);
  Duration period() const;
  TimePoint middle_of(std::int64_t scan) const;

  Measure measure_;
  Options options_;
  bool connected_ = false, closing_ = false;
  int level_ = 0;
  double frequency_hz_, resolution_deg_, start_deg_ = 55, range_deg_ = 70;
  std::optional<drivers::lms400::Format> format_;  // of the telegrams, while measuring
  std::optional<TimePoint> measures_from_;         // motor ready and command answered
  std::optional<TimePoint> epoch_;                 // of scan 0 at the present frequency
  std::int64_t next_scan_ = 0;
  std::uint16_t counter_offset_ = 0;
  TimePoint motor_ready_at_{}, busy_until_{}, now_{};
  Bytes received_, output_;
  std::deque<Due> due_;
  std::optional<std::size_t> cut_after_;  // the fault as it was last seen
  std::size_t sent_since_ = 0;
  std::uint64_t commands_dropped_ = 0, telegrams_sent_ = 0;
  std::mt19937_64 random_;
};
}  // namespace binpick::emulators
