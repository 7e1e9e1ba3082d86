#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string>

#include "base/log.hpp"
#include "drivers/pivot/codec.hpp"
#include "drivers/pivot/motion_codec.hpp"
#include "drivers/pivot/session.hpp"
#include "drivers/pivot/state_word.hpp"

/// Arbitrary frames at arbitrary times: both decoders, and a session in either protocol that also gets link changes,
/// moves and stops. (Messages of the Motion Protocol by themselves: motion_fuzz.cpp.)
namespace {
using namespace binpick;
using namespace binpick::drivers::pivot;

struct Input {
  std::span<const std::uint8_t> left;
  std::uint8_t byte() {
    if (left.empty()) return 0;
    const std::uint8_t value = left.front();
    left = left.subspan(1);
    return value;
  }
};

CanFrame frame_from(Input& input, std::uint32_t reply_base) {
  CanFrame frame;
  const std::uint8_t kind = input.byte();
  frame.extended = kind == 0xF0;
  frame.rtr = kind == 0xF1;
  frame.error = (kind & 0xF8) == 0xE0;
  frame.id = frame.error       ? std::uint32_t{input.byte()} << (kind & 3)
             : (kind & 1) != 0 ? reply_base + 12U
                               : reply_base + 12U + input.byte();
  frame.length = std::min<std::uint8_t>(kind >> 4, 8);
  for (std::size_t i = 0; i < frame.length; ++i) frame.payload[i] = input.byte();
  return frame;
}

void require(bool condition) {
  if (!condition) std::abort();
}

/// What we send is always a proper request. Angles may be whole numbers, as the module's unit system says.
bool is_request(Protocol protocol, const CanFrame& frame) {
  if (protocol == Protocol::PowerCube) return static_cast<bool>(decode_request(12, frame));
  motion::Assembler assembler;
  const auto message = assembler.take(frame);
  if (frame.id != motion::kCommandBase + 12 || !message || !*message) return false;
  return decode_request(**message, motion::UnitSystem::Degree) ||
         decode_request(**message, motion::UnitSystem::Millidegree);
}

CanFrame motion_answer_to(const CanFrame& asked, Input& input) {
  CanFrame frame;
  frame.id = motion::kReplyBase + 12;
  frame.payload[1] = asked.payload[1];
  const auto fill = [&](std::size_t from, std::uint8_t length) {
    frame.length = length;
    frame.payload[0] = static_cast<std::uint8_t>(length - 1);
    for (std::size_t i = from; i < length; ++i) frame.payload[i] = input.byte();
  };
  if (asked.payload[1] == 0x95) {
    fill(2, 8);
  } else if (asked.payload[1] == 0x80 && asked.length == 3) {
    frame.payload[2] = asked.payload[2];
    fill(3, asked.payload[2] == 0x06 ? 4 : 7);
  } else if (asked.payload[1] == 0x80) {
    fill(2, 3);
  } else {
    fill(8, 4);
    frame.payload[2] = 'O';
    frame.payload[3] = 'K';
  }
  return frame;
}

/// An answer that fits what was just asked, with a value from the input: so that the session gets past its first steps.
CanFrame answer_to(const CanFrame& asked, Input& input) {
  CanFrame frame;
  frame.id = kReplyBase + 12;
  frame.payload[0] = asked.payload[0];
  frame.payload[1] = asked.payload[1];
  switch (asked.length > 1 ? asked.payload[1] : 0xFF) {
    case 0x1D:
      frame.length = 4;
      break;
    case 0x62:
      frame.length = 8;
      break;
    default:
      frame.length = asked.payload[0] == 0x0A ? 6 : asked.length > 1 ? 2 : 1;
      break;
  }
  for (std::size_t i = 2; i < frame.length; ++i) frame.payload[i] = input.byte();
  return frame;
}
}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  log::set_threshold(log::Level::Error);
  Input input{{data, size}};
  Options options;
  const std::uint8_t first = input.byte();
  options.identify_only = (first & 7) == 7;
  const bool motion = (first & 8) != 0;
  options.protocol = motion ? Protocol::Motion : Protocol::PowerCube;
  Session session{options};
  TimePoint now{std::chrono::hours(1)};
  session.on_link_up(now);
  std::size_t frames = 0;
  while (!input.left.empty()) {
    const std::uint8_t what = input.byte();
    CanFrame last;
    for (const CanFrame& frame : session.take_frames()) {
      ++frames;
      last = frame;
      require(!frame.extended && !frame.rtr && !frame.error && frame.length <= 8);
      require(is_request(options.protocol, frame));
    }
    switch (what & 15) {
      case 0:
        session.on_link_down(what > 128 ? "bus-off" : "down", now);
        break;
      case 1:
        session.on_link_up(now);
        break;
      case 2:
        session.move_to(Angle::deg(input.byte() - 128.0), input.byte() / 50.0, now);
        break;
      case 3:
        session.stop(now);
        break;
      case 4:
      case 5:
      case 6: {
        const CanFrame frame = frame_from(input, motion ? motion::kReplyBase : kReplyBase);
        static_cast<void>(decode_request(12, frame));
        if (const auto reply = decode_reply(12, frame); !reply) static_cast<void>(to_string(reply.error()));
        session.on_frame(frame, now - std::chrono::microseconds(input.byte()));
        break;
      }
      case 7:
      case 8:
        now += std::chrono::milliseconds(input.byte());
        session.on_deadline(now);
        break;
      case 9:
        if (const auto at = session.deadline()) {
          now = std::max(now, *at);
          session.on_deadline(now);
        }
        break;
      default:
        if (last.length > 0) {
          now += std::chrono::microseconds(300);
          session.on_frame(motion ? motion_answer_to(last, input) : answer_to(last, input), now);
        }
        break;
    }
    // A deadline that stays in the past would be a busy loop.
    for (int i = 0; session.deadline() && *session.deadline() <= now; ++i) {
      require(i < 100);
      session.on_deadline(now);
    }
    while (const auto event = session.take_event())
      if (const auto* failed = std::get_if<Failed>(&*event)) require(!failed->text.empty());
    static_cast<void>(session.state_in_words());
  }
  require(frames < 64 + 40 * (size + 8));  // no flood
  return 0;
}
