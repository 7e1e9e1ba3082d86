#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "base/bytes.hpp"
#include "base/expected.hpp"
#include "drivers/robot/pose_sample.hpp"
#include "drivers/robot/session.hpp"

/// Poses that a robot's background program sends as lines, for makes without a real-time interface of their own: codec
/// and session. The robot is the client, the cell the server; the cell says nothing. For integrators: docs/robots/.
namespace binpick::drivers::robot {
/// "pose SEQ T_MS X Y Z A B C", plain decimals, ended by CR LF (CR or LF alone will do), at most kLineBytesMax.
struct PoseLine {
  std::uint16_t sequence = 0;  ///< 0 … 9999, then 0 again; a gap means lost lines.
  double time_ms = 0;          ///< The robot's clock, 0 … 9 999 999, then 0 again: single precision holds it whole.
  /// In the units and angles of the make (dialect.hpp). Of the flange, or of the tcp that the cell file names.
  Eigen::Isometry3d T_base_sent = Eigen::Isometry3d::Identity();
};
inline constexpr int kPoseSequences = 10'000;
inline constexpr double kPoseTimeWrap_ms = 1e7;

struct BadPoseLine {
  enum class Kind { TooLong, NotAPose, WrongCount, BadNumber } kind = Kind::NotAPose;
};
std::string to_string(const BadPoseLine& error);
/// One line without its line end.
Expected<PoseLine, BadPoseLine> decode_pose_line(std::string_view line, Dialect dialect);
/// With CR LF.
std::string encode(const PoseLine& line, Dialect dialect);

struct PoseStreamOptions {
  Dialect dialect = Dialect::Fanuc;
  /// The tcp whose pose is sent; identity: the flange itself.
  Transform<frame::Flange, frame::Tcp> T_flange_tcp{};
  std::chrono::milliseconds silence_max{500};  ///< Without a line that is understood.
};

/// One robot that sends lines. A new connection replaces the old one. Same face as rtde::Session.
class PoseStream {
 public:
  explicit PoseStream(const PoseStreamOptions& options);

  void on_connected(TimePoint now);
  void on_bytes(ByteView bytes, TimePoint now);
  void on_disconnected(TimePoint now);
  void on_deadline(TimePoint now);
  std::optional<TimePoint> deadline() const;
  Bytes take_output();  ///< Never anything.
  std::optional<PoseEvent> take_event();
  bool take_reopen();  ///< True once when the connection must be closed.
  PoseState state() const;

  std::optional<Duration> uncertainty() const;
  std::string controller() const;    ///< Never anything.
  std::string trouble() const;       ///< Never anything: lines do not tell it.
  std::uint64_t lines_lost() const;  ///< By gaps in the sequence, since the start.
  std::uint64_t bad_lines() const;   ///< Not understood, since the start.

 private:
  struct Impl;
  std::shared_ptr<Impl> impl_;
};
}  // namespace binpick::drivers::robot
