#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "base/bytes.hpp"
#include "base/clock.hpp"
#include "base/units.hpp"

/// SICK LMS 400 line scanner as a session without I/O.
namespace binpick::drivers::lms400 {
struct Options {
  double frequency_hz = 360;            ///< Profiles per second, 150 … 500.
  Angle resolution = Angle::deg(0.25);  ///< Between points, 0.1 … 1 degree.
  Angle start = Angle::deg(55);         ///< Device angle of the first point; 90 degrees is straight ahead.
  Angle range = Angle::deg(70);
  bool extended_remission = false;  ///< Dark targets (MDblex).
  int filter_mask = 0;              ///< FLsel: 1 median, 2 edge, 4 range, 8 mean.
  std::chrono::milliseconds reply_timeout{1000};
  std::chrono::milliseconds spin_up_timeout{
      10000};  ///< For sAN of setscanconfig and reqdata: the motor may have to settle.
  std::chrono::milliseconds profile_timeout{500};  ///< Silence while measuring before it is a fault.
  std::chrono::milliseconds idle_check{1000};      ///< When idle, a harmless variable is read this often: 0 never.
};

/// One scan line. Point i lies at device angle first + i * step, in the scanner frame at
/// range * (cos angle, 0, sin angle).
struct Profile {
  std::uint16_t counter = 0;  ///< The device's scan counter; a gap means lost profiles.
  Angle first, step;
  std::vector<float> range_mm;  ///< NaN where there is no valid measurement.
  std::vector<std::uint8_t> remission;
  TimePoint received_at;
  TimePoint measured_at;  ///< received_at smoothed by the counter: the device gives no time stamp.
};

struct Ready {
  double frequency_hz;
  Angle resolution;
};  ///< Configured as the device says it was really set.
struct ProfileReceived {
  Profile profile;
};
struct Stopped {};  ///< Answer to stop_measuring.
/// Session is Offline again and the link must be reopened (see take_reopen).
struct Failed {
  enum class Why { NoReply, BadTelegram, Refused, NoProfiles, LinkLost } why = Why::NoReply;
  std::string text;
};
using Event = std::variant<Ready, ProfileReceived, Stopped, Failed>;

/// One connection to one LMS 400: Offline → Starting → Idle ⇄ Measuring.
/// Owns no socket, reads no clock. Not thread-safe: used by the loop's thread only.
class Session {
 public:
  enum class State { Offline, Starting, Idle, Measuring };

  explicit Session(const Options& options);

  void on_connected(TimePoint now);
  void on_bytes(ByteView bytes, TimePoint now);
  void on_disconnected(TimePoint now);
  void on_deadline(TimePoint now);
  std::optional<TimePoint> deadline() const;
  Bytes take_output();
  std::optional<Event> take_event();
  bool take_reopen();  ///< True once when the connection must be dropped and opened again.
  State state() const;

  void start_measuring(TimePoint now);  ///< When Idle; while a stop is under way it follows. Else ignored and logged.
  void stop_measuring(TimePoint now);   ///< Only when Measuring; profiles may still come until Stopped.
  std::uint64_t profiles_lost() const;  ///< By gaps in the counter, since start_measuring.
  std::uint64_t bytes_skipped() const;  ///< That belonged to no frame, since on_connected.

 private:
  struct Impl;
  std::shared_ptr<Impl> impl_;
};
}  // namespace binpick::drivers::lms400
