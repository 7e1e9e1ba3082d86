#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/bytes.hpp"
#include "base/clock.hpp"
#include "base/units.hpp"
#include "drivers/scanner/lps36/pairing.hpp"
#include "drivers/scanner/profile.hpp"

/// Leuze LPS 36 and LPS 36 HI line scanners as a session without I/O.
namespace binpick::drivers::lps36 {
/// Normal 261 µs, bright 97 µs, dark 655 µs, normal to bright 328 µs, manual.
enum class Exposure : std::uint16_t { Normal, Bright, Dark, NormalToBright, Manual };
struct FieldOfView {
  Length x_min, x_max, z_min, z_max;
};

struct Options {
  /// FreeRunning: 100 profiles a second. Ethernet: one for each trigger(). Input: one for each pulse on the device's
  /// input; how many come is not known, so silence is no fault.
  enum class Trigger { FreeRunning, Ethernet, Input } trigger = Trigger::FreeRunning;
  bool hi = false;  ///< LPS 36 HI: 240 points in hundredths of a millimetre, else 376 in tenths.
  // What is not given stays as the device has it. Nothing is stored in the device.
  std::optional<Exposure> exposure;
  std::optional<std::chrono::microseconds> manual_exposure;  ///< 98 … 1310 (HI from 74); with Exposure::Manual.
  std::optional<FieldOfView> field_of_view;
  int pause_steps = 0;                             ///< Between the Z and the X telegram: 0 … 9 are 0.1 … 1.0 ms.
  std::chrono::milliseconds reply_timeout{500};    ///< Then a command is sent again: datagrams may be lost.
  int tries = 5;                                   ///< Of each command, before the device counts as gone.
  std::chrono::milliseconds busy_timeout{10000};   ///< Someone else is connected, or at its display.
  std::chrono::milliseconds profile_timeout{500};  ///< Without a profile while measuring, before it is a fault.
  std::chrono::milliseconds idle_check{1000};      ///< When idle, a harmless value is read this often: 0 never.
  std::chrono::milliseconds hold{30};              ///< A profile is waited for so long after a newer one came.
};

using scanner::Event;
using scanner::Failed;
using scanner::Profile;
using scanner::ProfileReceived;
using scanner::Ready;
using scanner::Stopped;

/// One LPS 36: Offline → Starting → Idle ⇄ Measuring. Idle is the device's command mode: no data flow.
/// Owns no socket, reads no clock. Not thread-safe: used by the loop's thread only.
class Session {
 public:
  using State = scanner::State;

  explicit Session(const Options& options);

  void on_connected(TimePoint now);  ///< The socket is open. Nobody has answered yet: UDP knows no connection.
  void on_frame(ByteView datagram, TimePoint now);  ///< One whole datagram.
  void on_disconnected(TimePoint now);
  void on_deadline(TimePoint now);
  std::optional<TimePoint> deadline() const;
  std::vector<Bytes> take_frames();  ///< Datagrams to send, oldest first.
  std::optional<Event> take_event();
  bool take_reopen();  ///< True once when the socket must be closed and opened again.
  State state() const;

  void start_measuring(TimePoint now);  ///< When Idle; while a stop is under way it follows. Else ignored and logged.
  void stop_measuring(TimePoint now);   ///< Only when Measuring; profiles may still come until Stopped.
  /// With Trigger::Ethernet and while measuring: asks for one profile. False, and nothing is sent, when it is not the
  /// time: the device needs 18 ms between two (LXSD). A trigger whose datagram is lost gives no profile and no gap in
  /// the scan numbers.
  bool trigger(TimePoint now);

  std::uint64_t profiles_lost() const;     ///< By gaps in the scan number, since start_measuring.
  Pairing::Counts telegrams() const;       ///< What the network did to them, since start_measuring.
  std::uint64_t frames_discarded() const;  ///< Datagrams that were no proper telegram, since on_connected.
  Status status() const;                   ///< As the device last said: its warning and fault bits are its health.

 private:
  struct Impl;
  std::shared_ptr<Impl> impl_;
};
}  // namespace binpick::drivers::lps36
