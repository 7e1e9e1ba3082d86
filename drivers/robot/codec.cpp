#include "drivers/robot/codec.hpp"

#include <charconv>
#include <cmath>
#include <cstdio>
#include <vector>

#include "base/check.hpp"
#include "base/rotation.hpp"

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

void append_pose(std::string& out, const Transform<frame::Base, frame::Tcp>& T_base_tcp) {
  const Eigen::Vector3d position = T_base_tcp.iso.translation();
  const Eigen::Vector3d turn = to_rotation_vector(T_base_tcp.iso.linear());
  // A robot must never see "nan" or a kilometre; poses come from our own detector and transforms.
  BINPICK_CHECK(position.allFinite() && position.cwiseAbs().maxCoeff() < 1e6 && turn.allFinite());
  const auto add = [&out](double v, int decimals) {
    char text[32];
    std::snprintf(text, sizeof text, ",%.*f", decimals, v);
    out += text;
  };
  for (int i = 0; i < 3; ++i) add(position[i] * 1e-3, 6);
  for (int i = 0; i < 3; ++i) add(turn[i], 7);
}
}  // namespace

std::string to_string(const BadLine& error) {
  switch (error.kind) {
    case BadLine::Kind::TooLong:
      return "line longer than " + std::to_string(kLineBytesMax) + " bytes";
    case BadLine::Kind::NotText:
      return "bytes that are no text";
    case BadLine::Kind::UnknownWord:
      return "unknown request; known: hello, fetch, done ID, failed ID";
    case BadLine::Kind::BadNumber:
      return "pick id is missing or outside 1 ... 65535";
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
  const bool report = words[0] == "done" || words[0] == "failed";
  if (!report && words[0] != "hello" && words[0] != "fetch") return unexpected(BadLine{BadLine::Kind::UnknownWord});
  if (words.size() > (report ? 2U : 1U)) return unexpected(BadLine{BadLine::Kind::TooManyWords});
  if (!report) return Request{words[0] == "hello" ? Request::Kind::Hello : Request::Kind::Fetch, 0};
  const auto id = words.size() == 2 ? read_id(words[1]) : std::nullopt;
  if (!id) return unexpected(BadLine{BadLine::Kind::BadNumber});
  return Request{words[0] == "done" ? Request::Kind::Done : Request::Kind::Failed, *id};
}

std::string encode(const Request& request) {
  switch (request.kind) {
    case Request::Kind::Hello:
      return "hello\n";
    case Request::Kind::Fetch:
      return "fetch\n";
    case Request::Kind::Done:
      return "done " + std::to_string(request.pick_id) + "\n";
    case Request::Kind::Failed:
      return "failed " + std::to_string(request.pick_id) + "\n";
  }
  return "\n";
}

void LineReader::push(ByteView bytes) {
  pending_.erase(pending_.begin(), pending_.begin() + static_cast<std::ptrdiff_t>(at_));
  at_ = 0;
  append(pending_, bytes);
}

std::optional<Expected<std::string, BadLine>> LineReader::next() {
  while (at_ < pending_.size()) {
    const char c = static_cast<char>(pending_[at_++]);
    if (c != '\n') {
      // One more than the longest line is kept: a CR that belongs to the line end.
      if (line_.size() <= kLineBytesMax)
        line_.push_back(c);
      else
        too_long_ = true;
      continue;
    }
    std::string line = std::exchange(line_, {});
    bool too_long = std::exchange(too_long_, false);
    if (!too_long && !line.empty() && line.back() == '\r') line.pop_back();
    too_long = too_long || line.size() > kLineBytesMax;
    if (too_long) return Expected<std::string, BadLine>{tl::unexpect, BadLine{BadLine::Kind::TooLong}};
    if (!line.empty()) return Expected<std::string, BadLine>{std::move(line)};
  }
  return std::nullopt;
}

void LineReader::clear() { *this = {}; }

std::string encode(const Reply& reply) {
  const auto number = [](auto value) { return std::to_string(static_cast<unsigned>(value)); };
  std::string out = "(" + number(kProtocolVersion) + "," + number(reply.status) + "," + number(reply.pick.pick_id) +
                    "," + number(reply.pick.sequence) + "," + number(reply.pick.part_id) + "," +
                    number(reply.pick.objects_left);
  append_pose(out, reply.pick.T_base_approach);
  append_pose(out, reply.pick.T_base_grasp);
  return out + "," + number(reply.reported_id) + "," + number(reply.outcome) + ")\n";
}

Expected<std::optional<DecodedReply>, BadReply> decode_reply(std::string_view text) {
  const auto bad = [](const std::string& why) { return unexpected(BadReply{why}); };
  const std::size_t start = text.find_first_not_of("\r\n ");
  if (start == std::string_view::npos) return std::optional<DecodedReply>{};
  if (text[start] != '(') return bad("no parenthesis at the start of an answer");
  const std::size_t end = text.find(')', start);
  if (end == std::string_view::npos) {
    if (text.size() - start > kReplyBytesMax) return bad("no closing parenthesis");
    return std::optional<DecodedReply>{};
  }
  std::array<double, kReplyFields> fields{};
  std::size_t count = 0;
  const char* at = text.data() + start + 1;
  const char* const stop = text.data() + end;
  while (true) {
    if (count == kReplyFields) return bad("more than " + std::to_string(kReplyFields) + " numbers");
    const auto [next, error] = std::from_chars(at, stop, fields[count], std::chars_format::fixed);
    if (error != std::errc{} || !std::isfinite(fields[count]))
      return bad("no number in field " + std::to_string(count + 1));
    ++count;
    at = next;
    if (at == stop) break;
    if (*at++ != ',') return bad("no comma behind field " + std::to_string(count));
  }
  if (count != kReplyFields) return bad(std::to_string(count) + " numbers instead of " + std::to_string(kReplyFields));
  for (const std::size_t i : {0U, 1U, 2U, 3U, 4U, 5U, 18U, 19U})
    if (fields[i] < 0 || fields[i] > 65535 || fields[i] != std::floor(fields[i]))
      return bad("field " + std::to_string(i + 1) + " is no number of 0 ... 65535");
  if (fields[0] != kProtocolVersion) return bad("protocol version is not " + std::to_string(kProtocolVersion));
  const auto word = [&](std::size_t i) { return static_cast<std::uint16_t>(fields[i]); };
  const auto pose = [&](std::size_t i) {
    Transform<frame::Base, frame::Tcp> T_base_tcp;
    T_base_tcp.iso.translation() = 1e3 * Eigen::Vector3d{fields[i], fields[i + 1], fields[i + 2]};
    T_base_tcp.iso.linear() = from_rotation_vector({fields[i + 3], fields[i + 4], fields[i + 5]});
    return T_base_tcp;
  };
  DecodedReply decoded;
  decoded.reply = {static_cast<Status>(word(1)),
                   {word(2), word(3), word(4), word(5), pose(6), pose(12)},
                   word(18),
                   static_cast<Outcome>(word(19))};
  decoded.consumed = end + 1;
  return std::optional{decoded};
}
}  // namespace binpick::drivers::robot
