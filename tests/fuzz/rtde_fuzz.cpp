#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "base/check.hpp"
#include "base/log.hpp"
#include "drivers/robot/rtde/codec.hpp"
#include "drivers/robot/rtde/session.hpp"

/// Bytes as a Universal Robots controller, or anybody else, might send them: to the codec first, then to a session.
/// The input is a row of pieces: one byte says what happens; raw bytes follow with their length.
namespace {
using namespace binpick;
using namespace binpick::drivers::rtde;

struct Input {
  ByteView left;
  std::uint8_t byte() {
    if (left.empty()) return 0;
    const auto value = std::to_integer<std::uint8_t>(left.front());
    left = left.subspan(1);
    return value;
  }
  ByteView bytes(std::size_t n) {
    const ByteView front = left.first(std::min(n, left.size()));
    left = left.subspan(front.size());
    return front;
  }
};

void check_codec(ByteView bytes) {
  if (const auto reply = decode_reply(bytes); !reply)
    BINPICK_CHECK(!to_string(reply.error()).empty());
  else if (*reply)
    BINPICK_CHECK((*reply)->consumed <= bytes.size() && decode_reply(encode((*reply)->message)).has_value());
  if (const auto request = decode_request(bytes); request && *request)
    BINPICK_CHECK((*request)->consumed <= bytes.size() && decode_request(encode((*request)->message)).has_value());
}

/// What a controller would say to the last request, mostly.
Bytes answer_to(ByteView requests, Input& input, const Sample& sample) {
  const std::vector<Field> recipe{Field::Timestamp, Field::TcpPose,    Field::TcpOffset,
                                  Field::RobotMode, Field::SafetyMode, Field::RuntimeState};
  const auto request = decode_request(requests);
  if (!request || !*request) return encode(Values{1, encode_sample(recipe, sample)});
  const Request& asked = (*request)->message;
  if (std::holds_alternative<RequestVersion>(asked)) return encode(VersionAnswer{input.byte() != 1});
  if (std::holds_alternative<GetControllerVersion>(asked)) return encode(ControllerVersion{input.byte(), 1, 2, 3});
  if (std::holds_alternative<Start>(asked)) return encode(StartAnswer{input.byte() != 1});
  OutputsAnswer outputs{1, {}};
  for (const Field field : recipe) outputs.types.emplace_back(words_of(field).type);
  if (const std::uint8_t which = input.byte(); which < outputs.types.size()) outputs.types[which] = "NOT_FOUND";
  return encode(outputs);
}
}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  log::set_threshold(log::Level::Error);
  Input input{std::as_bytes(std::span{data, size})};
  check_codec(input.left);
  Options options;
  if (input.byte() & 1) options.T_flange_tcp.emplace();
  Session session{options};
  TimePoint now{std::chrono::hours(1)};
  session.on_connected(now);
  Sample sample;
  sample.timestamp_s = 100;
  sample.tcp_offset.emplace();
  sample.robot_mode = 7;
  while (!input.left.empty()) {
    const Bytes said = session.take_output();
    const std::uint8_t what = input.byte();
    switch (what % 8) {
      case 0: {
        const ByteView bytes = input.bytes(input.byte());
        check_codec(bytes);
        session.on_bytes(bytes, now);
        break;
      }
      case 1:
        now += std::chrono::milliseconds(input.byte());
        break;
      case 2:
        if (session.deadline()) now = std::max(now, *session.deadline());
        break;
      case 3:
        if (what == 3) session.on_disconnected(now);
        if (what == 11) session.on_connected(now);
        break;
      case 4:
        sample.timestamp_s += 0.1 * (input.byte() - 100);
        break;
      case 5:
        sample.tcp_pose[input.byte() % 6] = 0.1 * (input.byte() - 128);
        sample.robot_mode = input.byte() % 10;
        break;
      case 6:  // many samples on time, so that the clock settles
        for (int i = 0; i < 64; ++i) {
          now += std::chrono::milliseconds(100);
          sample.timestamp_s += 0.1;
          session.on_bytes(answer_to({}, input, sample), now);
        }
        break;
      default:
        session.on_bytes(answer_to(said, input, sample), now);
        break;
    }
    for (int i = 0; session.deadline() && *session.deadline() <= now; ++i) {
      BINPICK_CHECK(i < 10);  // a deadline that stays in the past would be a busy loop
      session.on_deadline(now);
    }
    while (const auto event = session.take_event()) {
      if (const auto* got = std::get_if<drivers::robot::PoseSample>(&*event))
        BINPICK_CHECK(got->T_base_flange.iso.matrix().allFinite() && got->at <= now + std::chrono::microseconds(1));
      if (const auto* failed = std::get_if<drivers::robot::PoseFailed>(&*event)) BINPICK_CHECK(!failed->text.empty());
    }
    if (session.take_reopen() || session.state() == drivers::robot::PoseState::Offline) session.on_connected(now);
  }
  return 0;
}
