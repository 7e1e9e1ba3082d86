#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "base/bytes.hpp"
#include "drivers/scanner/lms400/session.hpp"
#include "drivers/scanner/lps36/session.hpp"
#include "drivers/scanner/profile.hpp"

/// A line scanner of any make behind one face: whoever sweeps does not ask which it is.
namespace binpick::drivers::scanner {
using Options = std::variant<lms400::Options, lps36::Options>;

/// "SICK LMS 400", "Leuze LPS 36", "Leuze LPS 36 HI".
std::string model_name(const Options& options);

/// One scanner: Offline → Starting → Idle ⇄ Measuring, as its session says (lms400/session.hpp, lps36/session.hpp).
class Scanner {
 public:
  explicit Scanner(const Options& options);

  /// An LPS 36 speaks UDP: its link hands on and takes whole datagrams. An LMS 400 speaks TCP.
  bool by_datagrams() const { return std::holds_alternative<lps36::Session>(device_); }

  void on_connected(TimePoint now);
  void on_bytes(ByteView bytes, TimePoint now);  ///< Of a stream, or one whole datagram.
  void on_disconnected(TimePoint now);
  void on_deadline(TimePoint now);
  std::optional<TimePoint> deadline() const;
  std::vector<Bytes> take_frames();  ///< What to send: datagrams, or the next piece of the stream.
  Bytes take_output();               ///< The same for a stream.
  std::optional<Event> take_event();
  bool take_reopen();
  State state() const;

  void start_measuring(TimePoint now);
  void stop_measuring(TimePoint now);
  std::uint64_t profiles_lost() const;

 private:
  std::variant<lms400::Session, lps36::Session> device_;
};
}  // namespace binpick::drivers::scanner
