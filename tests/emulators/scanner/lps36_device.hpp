#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <random>
#include <vector>

#include "base/bytes.hpp"
#include "base/clock.hpp"
#include "drivers/scanner/lps36/codec.hpp"
#include "tests/emulators/faults.hpp"

namespace binpick::emulators {
/// What the laser line meets, in the scanner frame: point i lies at (x_mm[i], 0, z_mm[i]).
struct PointLine {
  std::vector<float> x_mm, z_mm;  ///< NaN or z 0: nothing measured.
};

/// What the network or the sensor does to its measured telegrams.
struct DatagramFaults {
  double lost = 0;  ///< Share that never arrives.
  double late = 0;  ///< Share that comes `late_by` after its time, and is overtaken.
  Duration late_by = std::chrono::milliseconds(12);
  double duplicated = 0;    ///< Share of which a copy comes within 5 ms.
  double answers_lost = 0;  ///< Share of the answers to commands that never arrive.
  bool no_z = false, no_x = false;
  bool truncated = false;    ///< The last byte is missing.
  bool wrong_start = false;  ///< The first word is not 0xFFFF.
  bool type_zero = false;    ///< Header word 13 is 0, as in one example of a manual. Not an error.
};

/// A Leuze LPS 36 or LPS 36 HI seen from the network: UDP, one host at a time, measure mode and command mode. All
/// answers and measured telegrams go where the last datagram came from.
class Lps36 {
 public:
  /// Measures one line of `points` points.
  using Measure = std::function<PointLine(TimePoint at, std::size_t points)>;

  /// What no public source tells of the device is chosen here.
  struct Options {
    bool hi = false;  ///< Another model answers an HI connect as if it were the standard one (NODE).
    Duration reply = std::chrono::milliseconds(2);
    Duration exposure = std::chrono::milliseconds(10);  ///< From a trigger to its Z telegram.
    std::uint16_t first_scan = 0;                       ///< At power-up.
    double encoder_per_s = 0;                           ///< Counts; 0: a type without encoder input.
    double clock_error = 0;                             ///< It measures faster than it says by this fraction.
    std::uint64_t seed = 1;                             ///< Of the faults.
  };

  explicit Lps36(Measure measure);
  Lps36(Measure measure, const Options& options);

  void on_frame(ByteView datagram, TimePoint now);
  void on_deadline(TimePoint now);
  std::optional<TimePoint> deadline() const;
  std::vector<Bytes> take_frames();  ///< What is due, one datagram each.

  Faults faults;  ///< Of these: unplugged, silent, delay, garbage, wrong_id, error_code (every command is refused).
  DatagramFaults datagrams;
  bool in_menu = false;           ///< Someone is at the display: nothing is accepted, nothing measured.
  bool permanent_fault = false;   ///< Mode "error", nothing accepted, nothing measured.
  bool warning = false;           ///< Status bit only.
  bool ignores_settings = false;  ///< Acknowledges a parameter and keeps its old value.

  void power_cycle(TimePoint now);  ///< All that was not stored is lost, the connection as well.
  bool connected() const { return connected_; }
  bool in_command_mode() const { return command_mode_; }
  bool measuring() const;  ///< Free running, and someone hears it.
  void skip_scans(std::uint16_t by) { scan_ = static_cast<std::uint16_t>(scan_ + by); }
  std::vector<std::uint16_t> parameter(std::uint16_t id) const;  ///< User or task parameter as it stands.

  std::uint64_t scans_measured() const { return scans_measured_; }
  std::uint64_t scans_spoiled() const { return scans_spoiled_; }        ///< Not all telegrams were sent.
  std::uint64_t scans_halved() const { return scans_halved_; }          ///< Of the spoiled: one telegram was sent.
  std::uint64_t copies_sent() const { return copies_sent_; }            ///< Duplicates.
  std::uint64_t commands_dropped() const { return commands_dropped_; }  ///< No telegram at all.
  std::uint64_t triggers_ignored() const { return triggers_ignored_; }  ///< Too soon, or not in that mode.

 private:
  struct Due {
    TimePoint at;
    Bytes frame;
  };
  struct Stored {
    std::uint16_t type;
    std::int32_t min, max;
    std::vector<std::uint16_t> values;
  };
  drivers::lps36::Status status() const;
  drivers::lps36::Mode mode() const;
  Duration period() const;
  Duration pause() const;
  bool is_triggered() const;
  std::uint32_t encoder(TimePoint at) const;
  void set_defaults();
  void reply(const drivers::lps36::Telegram& asked, drivers::lps36::Id id, TimePoint now,
             std::vector<std::uint16_t> words = {});
  bool on_common(const drivers::lps36::Telegram& telegram, TimePoint now);
  void on_command(const drivers::lps36::Telegram& telegram, TimePoint now);
  bool store(std::map<std::uint16_t, Stored>& all, std::uint16_t id, std::vector<std::uint16_t> values);
  void read_measured(const drivers::lps36::Telegram& telegram, TimePoint now);
  void next_tick(TimePoint now);
  void measure(TimePoint at, bool triggered);
  bool send_measured(const drivers::lps36::Measured& measured, TimePoint at);
  void release(TimePoint now);
  bool happens(double share);

  Measure measure_;
  Options options_;
  bool connected_ = false, hi_connected_ = false, command_mode_ = false, active_ = true;
  std::map<std::uint16_t, Stored> user_, task_;
  std::uint16_t task_number_ = 0, scan_ = 0;
  std::uint32_t encoder_base_ = 0;
  TimePoint encoder_zero_{};
  std::optional<TimePoint> tick_, triggered_at_;
  std::vector<std::uint16_t> once_z_, once_x_;  // of the single measurement in command mode
  std::vector<Due> due_;
  std::vector<Bytes> output_;
  std::vector<TimePoint> triggers_;
  std::uint64_t scans_measured_ = 0, scans_spoiled_ = 0, scans_halved_ = 0, copies_sent_ = 0, commands_dropped_ = 0,
                triggers_ignored_ = 0;
  std::mt19937_64 random_;
};
}  // namespace binpick::emulators
