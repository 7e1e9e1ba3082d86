#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "base/check.hpp"
#include "base/log.hpp"
#include "drivers/scanner/lps36/codec.hpp"
#include "drivers/scanner/lps36/session.hpp"

/// Datagrams as an LPS 36, or anybody else, might send them: to the codec first and then to a session that is started,
/// asked to measure and stopped on the way. The input is a row of pieces: one byte says what happens, datagrams follow
/// with their length (two bytes) and their bytes.
namespace {
using namespace binpick;
using namespace binpick::drivers::lps36;

struct Input {
  ByteView left;
  std::uint8_t byte() {
    if (left.empty()) return 0;
    const auto value = std::to_integer<std::uint8_t>(left.front());
    left = left.subspan(1);
    return value;
  }
  std::uint16_t word() {
    const unsigned low = byte();
    return static_cast<std::uint16_t>(low | static_cast<unsigned>(byte()) << 8);
  }
  ByteView bytes(std::size_t n) {
    const ByteView front = left.first(std::min(n, left.size()));
    left = left.subspan(front.size());
    return front;
  }
};

void check_codec(ByteView datagram) {
  const auto telegram = decode(datagram);
  if (!telegram) {
    BINPICK_CHECK(telegram.error().at <= datagram.size() && !to_string(telegram.error()).empty());
    return;
  }
  // What was understood is written back bit by bit.
  BINPICK_CHECK(std::ranges::equal(encode(*telegram), datagram));
  if (const auto measured = measured_of(*telegram)) {
    const Telegram again = telegram_of(*measured);
    BINPICK_CHECK(again.words == telegram->words && again.scan == telegram->scan);
  }
  if (const auto parameter = parameter_of(*telegram))
    BINPICK_CHECK(telegram_of(*parameter, telegram->status).words == telegram->words);
}

/// An answer that fits what was just asked, so that the session gets past its first steps.
Bytes answer_to(const Telegram& asked, Input& input) {
  const Status status{input.word()};
  switch (asked.id) {
    case Id::GetTask:
      return encode(answer(Id::Task, asked.id, status, {0}));
    case Id::GetUserParameter:
      return encode(answer(Id::UserParameter, asked.id, status, {input.byte()}));
    case Id::GetTaskParameter:
      return encode(telegram_of(Parameter{asked.words.at(0), 2, 0, 1, 0, {input.byte()}}, status));
    default:
      return encode(answer(input.byte() == 255 ? Id::Nack : Id::Ack, asked.id, status));
  }
}

Bytes measured(std::uint8_t what, Input& input) {
  using Part = Measured::Part;
  Measured m;
  m.part = what % 3 == 0 ? Part::Z : what % 3 == 1 ? Part::X : Part::Both;
  m.status.bits = 0x0111;
  m.scan = what < 200 ? input.byte() : input.word();
  const std::size_t points = m.part == Part::Both ? kPointsHi : kPoints;
  if (m.part != Part::X) m.z.assign(points, input.byte());
  if (m.part != Part::Z) m.x.assign(points, input.byte());
  return encode(telegram_of(m));
}
}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  log::set_threshold(log::Level::Error);
  Input input{std::as_bytes(std::span{data, size})};
  check_codec(input.left);
  Options options;
  const std::uint8_t kind = input.byte();
  options.hi = (kind & 1) != 0;
  options.trigger = static_cast<Options::Trigger>((kind >> 1) % 3);
  Session session{options};
  TimePoint now{std::chrono::hours(1)};
  session.on_connected(now);
  std::size_t frames = 0;
  while (!input.left.empty()) {
    Telegram last;
    for (const Bytes& frame : session.take_frames()) {
      ++frames;
      const auto telegram = decode(frame);  // what we send is always a proper telegram
      BINPICK_CHECK(telegram.has_value());
      last = *telegram;
    }
    const std::uint8_t what = input.byte();
    switch (what % 8) {
      case 0: {
        const ByteView datagram = input.bytes(input.word() % 1024);
        check_codec(datagram);
        session.on_frame(datagram, now);
        break;
      }
      case 1:
        now += std::chrono::milliseconds(input.byte());
        break;
      case 2:
        if (session.deadline()) now = std::max(now, *session.deadline());
        break;
      case 3:
        session.start_measuring(now);
        break;
      case 4:
        if (what > 128) session.stop_measuring(now);
        if (what == 4) session.on_disconnected(now);
        if (what == 12) (void)session.trigger(now);
        break;
      case 5:
        session.on_frame(measured(input.byte(), input), now);
        break;
      default:
        if (last.id != Id::Ack) session.on_frame(answer_to(last, input), now);
        break;
    }
    // A deadline that stays in the past would be a busy loop.
    for (int i = 0; session.deadline() && *session.deadline() <= now; ++i) {
      BINPICK_CHECK(i < 100);
      session.on_deadline(now);
    }
    while (const auto event = session.take_event()) {
      if (const auto* failed = std::get_if<Failed>(&*event)) BINPICK_CHECK(!failed->text.empty());
      if (const auto* got = std::get_if<ProfileReceived>(&*event)) {
        BINPICK_CHECK(got->profile.x_mm.size() == got->profile.z_mm.size());
        BINPICK_CHECK(got->profile.measured_at <= now);
      }
    }
    if (session.take_reopen() || session.state() == Session::State::Offline) session.on_connected(now);
  }
  BINPICK_CHECK(frames < 64 + 64 * (size + 8));  // no flood
  return 0;
}
