#include "drivers/robot/codec.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <vector>

#include "base/check.hpp"
#include "drivers/robot/dialect.hpp"

namespace binpick::drivers::robot {
namespace {
std::vector<std::string_view> split(std::string_view line) {
  std::vector<std::string_view> words;
  while (true) {
    const std::size_t start = line.find_first_not_of(' ');
    if (start == std::string_view::npos) return words;
    line.remove_prefix(start);
    const std::size_t end = std::min(line.find(' '), line.size());
    words.push_back(line.substr(0, end));
    line.remove_prefix(end);
  }
}

std::optional<std::uint16_t> read_id(std::string_view word) {
  std::uint16_t id = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), id);
  if (error != std::errc{} || end != word.data() + word.size() || id == 0) return std::nullopt;
  return id;
}

void append_integer(std::string& out, const Format& format, unsigned value) {
  char text[16];
  std::snprintf(text, sizeof text, "%0*u", format.integer_width, value);
  out += text;
}

void append_real(std::string& out, const Format& format, double value, int decimals) {
  if (std::abs(value) < 0.5 * std::pow(10.0, -decimals)) value = 0.0;  // no "-0.000"
  char text[32];
  std::snprintf(text, sizeof text, "%0*.*f", format.real_width, decimals, value);
  out += text;
}

// A robot must never see "nan" or a kilometre; poses come from our own detector and transforms.
void append_position(std::string& out, const Format& format, const Transform<frame::Base, frame::Tcp>& T_base_tcp) {
  const Eigen::Vector3d position_mm = T_base_tcp.iso.translation();
  BINPICK_CHECK(position_mm.allFinite() && position_mm.cwiseAbs().maxCoeff() < kLengthMax_mm);
  for (int i = 0; i < 3; ++i) {
    if (i > 0) out += ',';
    append_real(out, format, position_mm[i] / format.mm_per_unit, format.length_decimals);
  }
}

void append_pose(std::string& out, const Format& format, const Transform<frame::Base, frame::Tcp>& T_base_tcp) {
  append_position(out, format, T_base_tcp);
  const Eigen::Vector3d angles = format.to_angles(T_base_tcp.iso.linear());
  BINPICK_CHECK(angles.allFinite());
  for (const double angle : angles) {
    out += ',';
    append_real(out, format, angle, format.angle_decimals);
  }
}

// Fields of an answer, from 0.
constexpr std::size_t kApproach = 6, kGrasp = 12, kRetreat = 18, kReported = 21;
static_assert(kReported + 2 == kReplyFields);

/// What stands behind field i of an answer.
std::string_view separator(const Format& format, std::size_t i) {
  if (i + 1 == kReplyFields) return format.close;
  return i + 1 == kApproach || i + 1 == kGrasp ? format.pose_break : std::string_view{","};
}

struct Word {
  std::string_view text;
  Request::Kind kind;
};
constexpr std::array kWords{Word{"hello", Request::Kind::Hello},  Word{"fetch", Request::Kind::Fetch},
                            Word{"done", Request::Kind::Done},    Word{"failed", Request::Kind::Failed},
                            Word{"begin", Request::Kind::Begin},  Word{"end", Request::Kind::End},
                            Word{"broken", Request::Kind::Broken}};

constexpr bool is_integer(std::size_t i) { return i < kApproach || i >= kReported; }
constexpr bool is_length(std::size_t i) {
  return (i >= kApproach && i < kApproach + 3) || (i >= kGrasp && i < kGrasp + 3) || (i >= kRetreat && i < kReported);
}

/// A whole number of 0 … 65535, or a decimal fraction; nullopt for anything else.
std::optional<double> read_number(std::string_view word, const Format& format, std::size_t i) {
  const auto width = static_cast<std::size_t>(is_integer(i) ? format.integer_width : format.real_width);
  if (width != 0 && word.size() != width) return std::nullopt;
  double value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value, std::chars_format::fixed);
  if (error != std::errc{} || end != word.data() + word.size() || !std::isfinite(value)) return std::nullopt;
  if (is_integer(i)) {
    if (value < 0 || value > 65535 || value != std::floor(value)) return std::nullopt;
  } else if (is_length(i) ? std::abs(value * format.mm_per_unit) >= kLengthMax_mm
                          : std::abs(value) > format.angle_max) {
    return std::nullopt;
  }
  return value;
}
}  // namespace

std::string to_string(const BadLine& error) {
  switch (error.kind) {
    case BadLine::Kind::TooLong:
      return "line longer than " + std::to_string(kLineBytesMax) + " bytes";
    case BadLine::Kind::NotText:
      return "bytes that are no text";
    case BadLine::Kind::UnknownWord:
      return "unknown request; known: hello, fetch, done ID, failed ID, begin ID, end ID, broken ID";
    case BadLine::Kind::BadNumber:
      return "the number is missing or outside 1 ... 65535";
    case BadLine::Kind::TooManyWords:
      return "words behind the request";
  }
  return "?";
}

Expected<Request, BadLine> decode_request(std::string_view line) {
  if (line.size() > kLineBytesMax) return unexpected(BadLine{BadLine::Kind::TooLong});
  for (const char c : line)
    if (c < ' ' || c > '~') return unexpected(BadLine{BadLine::Kind::NotText});
  const auto words = split(line);
  if (words.empty()) return unexpected(BadLine{BadLine::Kind::UnknownWord});
  const auto word = std::ranges::find(kWords, words[0], &Word::text);
  if (word == kWords.end()) return unexpected(BadLine{BadLine::Kind::UnknownWord});
  Request request{word->kind, 0};
  const bool has_id = request.is_report() || request.is_of_scan();
  if (words.size() > (has_id ? 2U : 1U)) return unexpected(BadLine{BadLine::Kind::TooManyWords});
  if (!has_id) return request;
  const auto id = words.size() == 2 ? read_id(words[1]) : std::nullopt;
  if (!id) return unexpected(BadLine{BadLine::Kind::BadNumber});
  request.pick_id = *id;
  return request;
}

std::string encode(const Request& request, Dialect dialect) {
  std::string line{std::ranges::find(kWords, request.kind, &Word::kind)->text};
  if (request.is_report() || request.is_of_scan()) line += ' ' + std::to_string(request.pick_id);
  return line.append(format_of(dialect).request_end);
}

void LineReader::push(ByteView bytes) {
  pending_.erase(pending_.begin(), pending_.begin() + static_cast<std::ptrdiff_t>(at_));
  at_ = 0;
  append(pending_, bytes);
}

std::optional<Expected<std::string, BadLine>> LineReader::next() {
  while (at_ < pending_.size()) {
    const char c = static_cast<char>(pending_[at_++]);
    if (c != '\n' && c != '\r') {
      if (line_.size() < kLineBytesMax)
        line_.push_back(c);
      else
        too_long_ = true;
      continue;
    }
    std::string line = std::exchange(line_, {});
    if (std::exchange(too_long_, false))
      return Expected<std::string, BadLine>{tl::unexpect, BadLine{BadLine::Kind::TooLong}};
    if (!line.empty()) return Expected<std::string, BadLine>{std::move(line)};
  }
  return std::nullopt;
}

void LineReader::clear() { *this = {}; }

std::string encode(const Reply& reply, Dialect dialect) {
  const Format& format = format_of(dialect);
  const Pick& pick = reply.pick;
  std::string out{format.open};
  const auto add = [&](std::string_view before, unsigned value) {
    out += before;
    append_integer(out, format, value);
  };
  add("", static_cast<unsigned>(kProtocolVersion));
  for (const unsigned value : {static_cast<unsigned>(reply.status), unsigned{pick.pick_id}, unsigned{pick.sequence},
                               unsigned{pick.part_id}, unsigned{pick.objects_left}})
    add(",", value);
  for (const auto* T_base_tcp : {&pick.T_base_approach, &pick.T_base_grasp}) {
    out += format.pose_break;
    append_pose(out, format, *T_base_tcp);
  }
  out += ',';
  append_position(out, format, pick.T_base_retreat);
  add(",", reply.reported_id);
  add(",", static_cast<unsigned>(reply.outcome));
  return out.append(format.close).append(format.end);
}

Expected<std::optional<DecodedReply>, BadReply> decode_reply(std::string_view text, Dialect dialect) {
  using Result = Expected<std::optional<DecodedReply>, BadReply>;
  const Format& format = format_of(dialect);
  const auto bad = [](const std::string& why) { return Result{tl::unexpect, BadReply{why}}; };
  std::size_t at = std::min(text.find_first_not_of("\r\n "), text.size());
  const auto incomplete = [&, start = at] {
    if (text.size() - start > kReplyBytesMax) return bad("an answer without an end");
    return Result{std::optional<DecodedReply>{}};
  };
  // One piece of punctuation: true when it stands at `at`, false when something else does; nullopt when it may still
  // come.
  const auto take = [&](std::string_view mark) -> std::optional<bool> {
    const std::string_view there = text.substr(at, mark.size());
    if (there != mark.substr(0, there.size())) return false;
    if (there.size() < mark.size()) return std::nullopt;
    at += mark.size();
    return true;
  };
  const auto opened = take(format.open);
  if (!opened) return incomplete();
  if (!*opened) return bad("no parenthesis at the start of an answer");
  std::array<double, kReplyFields> fields{};
  for (std::size_t i = 0; i < kReplyFields; ++i) {
    const std::size_t end = text.find_first_of(",)\r\n", at);
    if (end == std::string_view::npos) return incomplete();
    const auto number = read_number(text.substr(at, end - at), format, i);
    if (!number) return bad("field " + std::to_string(i + 1) + " is no number of its kind and range");
    if (i == 0 && *number != kProtocolVersion)
      return bad("protocol version is not " + std::to_string(kProtocolVersion));
    fields[i] = *number;
    at = end;
    const auto separated = take(separator(format, i));
    if (!separated) return incomplete();
    if (!*separated) return bad("not the " + std::to_string(kReplyFields) + " numbers of this dialect");
  }
  const auto word = [&](std::size_t i) { return static_cast<std::uint16_t>(fields[i]); };
  const auto pose = [&](std::size_t position, std::size_t angles) {
    const auto three = [&](std::size_t i) { return Eigen::Vector3d{fields[i], fields[i + 1], fields[i + 2]}; };
    Transform<frame::Base, frame::Tcp> T_base_tcp;
    T_base_tcp.iso.translation() = format.mm_per_unit * three(position);
    T_base_tcp.iso.linear() = format.from_angles(three(angles));
    return T_base_tcp;
  };
  DecodedReply decoded;
  decoded.reply = {static_cast<Status>(word(1)),
                   {word(2), word(3), word(4), word(5), pose(kApproach, kApproach + 3), pose(kGrasp, kGrasp + 3),
                    pose(kRetreat, kGrasp + 3)},
                   word(kReported),
                   static_cast<Outcome>(word(kReported + 1))};
  decoded.consumed = at;
  return std::optional{decoded};
}
}  // namespace binpick::drivers::robot
