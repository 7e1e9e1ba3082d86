#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>

#include "base/bytes.hpp"
#include "base/clock.hpp"
#include "base/units.hpp"
#include "drivers/scanner/profile.hpp"

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

using scanner::Event;
using scanner::Failed;
using scanner::Profile;
using scanner::ProfileReceived;
using scanner::Ready;
using scanner::Stopped;

/// One connection to one LMS 400: Offline → Starting → Idle ⇄ Measuring.
/// Owns no socket, reads no clock. Not thread-safe: used by the loop's thread only.
class Session {
 public:
  using State = scanner::State;

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
