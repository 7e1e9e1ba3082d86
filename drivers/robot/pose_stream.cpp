#include "drivers/robot/pose_stream.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <utility>

#include "base/check.hpp"
#include "base/log.hpp"
#include "drivers/robot/codec.hpp"
#include "drivers/robot/dialect.hpp"
#include "drivers/robot/pose_intake.hpp"

namespace binpick::drivers::robot {
namespace {
constexpr std::string_view kWord = "pose";
constexpr std::size_t kNumbers = 8;

/// Blanks in front are skipped; more than one number, or none, is none.
std::optional<double> next_number(std::string_view& text) {
  text.remove_prefix(std::min(text.find_first_not_of(' '), text.size()));
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, std::chars_format::fixed);
  const auto length = static_cast<std::size_t>(end - text.data());
  if (error != std::errc{} || (length < text.size() && text[length] != ' ') || !std::isfinite(value))
    return std::nullopt;
  text.remove_prefix(length);
  return value;
}

bool is_blank(std::string_view text) { return text.find_first_not_of(' ') == std::string_view::npos; }
}  // namespace

std::string to_string(const BadPoseLine& error) {
  switch (error.kind) {
    case BadPoseLine::Kind::TooLong:
      return "line longer than " + std::to_string(kLineBytesMax) + " bytes";
    case BadPoseLine::Kind::NotAPose:
      return "line does not begin with the word pose";
    case BadPoseLine::Kind::WrongCount:
      return "not the eight numbers of a pose";
    case BadPoseLine::Kind::BadNumber:
      return "a number outside its range";
  }
  return "?";
}

Expected<PoseLine, BadPoseLine> decode_pose_line(std::string_view line, Dialect dialect) {
  if (line.size() > kLineBytesMax) return unexpected(BadPoseLine{BadPoseLine::Kind::TooLong});
  if (!line.starts_with(kWord) || line.size() == kWord.size() || line[kWord.size()] != ' ')
    return unexpected(BadPoseLine{BadPoseLine::Kind::NotAPose});
  line.remove_prefix(kWord.size());
  std::array<double, kNumbers> numbers{};
  for (double& number : numbers) {
    const auto value = next_number(line);
    if (!value) return unexpected(BadPoseLine{BadPoseLine::Kind::WrongCount});
    number = *value;
  }
  if (!is_blank(line)) return unexpected(BadPoseLine{BadPoseLine::Kind::WrongCount});
  const Format& format = format_of(dialect);
  const bool is_sequence = numbers[0] >= 0 && numbers[0] < kPoseSequences && numbers[0] == std::floor(numbers[0]);
  bool in_range = is_sequence && numbers[1] >= 0 && numbers[1] < kPoseTimeWrap_ms;
  for (std::size_t i = 2; i < kNumbers; ++i)
    in_range &= i < 5 ? std::abs(numbers[i] * format.mm_per_unit) < kLengthMax_mm
                      : std::abs(numbers[i]) <= 2 * format.angle_max;  // a controller may count on beyond half a turn
  if (!in_range) return unexpected(BadPoseLine{BadPoseLine::Kind::BadNumber});
  PoseLine pose{static_cast<std::uint16_t>(numbers[0]), numbers[1], Eigen::Isometry3d::Identity()};
  pose.T_base_sent.translation() = format.mm_per_unit * Eigen::Vector3d{numbers[2], numbers[3], numbers[4]};
  pose.T_base_sent.linear() = format.from_angles({numbers[5], numbers[6], numbers[7]});
  return pose;
}

std::string encode(const PoseLine& line, Dialect dialect) {
  const Format& format = format_of(dialect);
  const Eigen::Vector3d position = line.T_base_sent.translation() / format.mm_per_unit;
  const Eigen::Vector3d angles = format.to_angles(line.T_base_sent.linear());
  char text[kLineBytesMax + 4];
  const int length = std::snprintf(
      text, sizeof text, "pose %u %.1f %.*f %.*f %.*f %.*f %.*f %.*f\r\n", unsigned{line.sequence}, line.time_ms,
      format.length_decimals, position.x(), format.length_decimals, position.y(), format.length_decimals, position.z(),
      format.angle_decimals, angles.x(), format.angle_decimals, angles.y(), format.angle_decimals, angles.z());
  BINPICK_CHECK(length > 0 && static_cast<std::size_t>(length) <= kLineBytesMax + 2);
  return text;
}

struct PoseStream::Impl {
  explicit Impl(const PoseStreamOptions& o) : options{o} {}

  PoseStreamOptions options;
  PoseIntake intake;
  bool reopen = false;
  LineReader lines;
  TimePoint heard_at;
  std::uint64_t lost = 0, bad = 0, bad_before = 0;  // bad_before: this connection
  std::optional<PoseLine> last;                     // of this connection
  std::optional<double> last_ms;                    // of the robot's clock, wrapped
  double wraps_ms = 0;

  bool is_online() const { return intake.state() != PoseState::Offline; }

  void fail(PoseFailed::Why why, const std::string& text) {
    lines.clear();
    reopen = why != PoseFailed::Why::LinkLost;
    intake.fail(why, "pose stream: " + text);
  }

  void on_bad(const std::string& why) {
    if (bad++ == bad_before)
      BINPICK_LOG(Warning, "robot", "pose stream: %s; compare the robot's background program with its manual page",
                  why.c_str());
  }

  /// The robot's clock without its wrap.
  double unwrapped_s(double time_ms) {
    if (last_ms && time_ms < *last_ms - kPoseTimeWrap_ms / 2) wraps_ms += kPoseTimeWrap_ms;
    last_ms = time_ms;
    return 1e-3 * (wraps_ms + time_ms);
  }

  void on_line(const Expected<std::string, BadLine>& text, TimePoint now) {
    if (!text) return on_bad(to_string(text.error()));
    const auto line = decode_pose_line(*text, options.dialect);
    if (!line) return on_bad(to_string(line.error()));
    if (last && line->sequence == last->sequence) return on_bad("the same line number twice");
    heard_at = now;
    if (last)
      lost += static_cast<std::uint64_t>((line->sequence - last->sequence - 1 + 2 * kPoseSequences) % kPoseSequences);
    last = *line;
    const Transform<frame::Base, frame::Tcp> T_base_sent{line->T_base_sent};
    intake.on_pose(unwrapped_s(line->time_ms), T_base_sent * options.T_flange_tcp.inverse(), now);
    if (is_online()) return;  // else its clock stands still, or jumped
    lines.clear();
    reopen = true;
  }
};

PoseStream::PoseStream(const PoseStreamOptions& options) : impl_{std::make_shared<Impl>(options)} {}

void PoseStream::on_connected(TimePoint now) {
  impl_->lines.clear();
  impl_->reopen = false;
  impl_->heard_at = now;
  impl_->last.reset();
  impl_->bad_before = impl_->bad;
  impl_->intake.begin();
}

void PoseStream::on_bytes(ByteView bytes, TimePoint now) {
  if (!impl_->is_online()) return;
  impl_->lines.push(bytes);
  while (impl_->is_online()) {
    const auto line = impl_->lines.next();
    if (!line) return;
    impl_->on_line(*line, now);
  }
}

void PoseStream::on_disconnected(TimePoint) {
  if (impl_->is_online())
    impl_->fail(PoseFailed::Why::LinkLost, "the robot closed the connection; check that its background program runs");
}

void PoseStream::on_deadline(TimePoint now) {
  const auto due = deadline();
  if (!due || now < *due) return;
  const std::uint64_t bad = impl_->bad - impl_->bad_before;
  impl_->fail(PoseFailed::Why::Silent,
              "no pose for " + std::to_string(impl_->options.silence_max.count()) + " ms" +
                  (bad == 0 ? "; check that the robot's background program runs"
                            : ", but " + std::to_string(bad) +
                                  " lines that are none; compare the robot's background program with its manual page"));
}

std::optional<TimePoint> PoseStream::deadline() const {
  if (!impl_->is_online()) return std::nullopt;
  return impl_->heard_at + impl_->options.silence_max;
}

Bytes PoseStream::take_output() { return {}; }
std::optional<PoseEvent> PoseStream::take_event() { return impl_->intake.take_event(); }
bool PoseStream::take_reopen() { return std::exchange(impl_->reopen, false); }
PoseState PoseStream::state() const { return impl_->intake.state(); }
std::optional<Duration> PoseStream::uncertainty() const { return impl_->intake.clock().uncertainty(); }
std::string PoseStream::controller() const { return {}; }
std::string PoseStream::trouble() const { return {}; }
std::uint64_t PoseStream::lines_lost() const { return impl_->lost; }
std::uint64_t PoseStream::bad_lines() const { return impl_->bad; }
}  // namespace binpick::drivers::robot
