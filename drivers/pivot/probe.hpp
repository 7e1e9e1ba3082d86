#pragma once

#include <optional>
#include <string>
#include <vector>

#include "drivers/pivot/session.hpp"

namespace binpick::drivers::pivot {
/// A session, and where it only looks (identify_only) and its module stays silent, a second one that asks in the other
/// protocol: which of the two does the module speak? The same face as a session's.
///
/// Why the frames of the one do no harm to a module of the other: PowerCube modules listen to 0x0C0 and 0x0E0 + number
/// (numbers up to 31) and to 0x100, modules of the Motion Protocol to 0x500 + number; neither takes the other's frames
/// for its own. And what is asked are reads in both (GET PARAMETER; GET STATE without parameters and GET CONFIG). One
/// thing may change: a report that another program has left on can end with GET STATE. CANopen drives do share these
/// identifiers (0x500 + number is a PDO of theirs); on a bus with one of the same number, do not probe.
class Probe {
 public:
  explicit Probe(const Options& options);

  std::vector<link::CanFilter> filters() const;
  void on_link_up(TimePoint now);
  void on_link_down(const std::string& why, TimePoint now);
  void on_frame(const CanFrame& frame, TimePoint received_at);
  void on_deadline(TimePoint now);
  std::optional<TimePoint> deadline() const;
  std::vector<CanFrame> take_frames();

  Session& session() { return session_; }
  /// The module has answered, and not in the protocol of the options but in this one.
  std::optional<Protocol> answers_in_other() const;

 private:
  Session session_;
  Protocol other_protocol_;
  std::optional<Session> other_;  ///< Absent: the other is not asked.
  std::optional<TimePoint> ask_other_at_;
};
}  // namespace binpick::drivers::pivot
