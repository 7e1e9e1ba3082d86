#include <cstddef>
#include <cstdint>

#include "base/check.hpp"
#include "base/log.hpp"
#include "drivers/scanner/lms400/codec.hpp"
#include "drivers/scanner/lms400/session.hpp"

/// The first byte says how the rest is cut into segments; the rest is what an LMS 400 might send, to the codec first
/// and then to a session that is started, asked to measure and stopped on the way.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace binpick;
  using namespace binpick::drivers::lms400;
  log::set_threshold(log::Level::Error);
  if (size == 0) return 0;
  const ByteView bytes = std::as_bytes(std::span{data + 1, size - 1});

  for (std::size_t at = 0; at < bytes.size();) {
    const auto result = decode(bytes.subspan(at));
    if (!result) {
      BINPICK_CHECK(result.error().skip >= 1 && result.error().skip <= bytes.size() - at);
      at += result.error().skip;
      continue;
    }
    if (!*result) break;
    // What was understood is written back bit by bit.
    const Bytes again = encode((*result)->message);
    BINPICK_CHECK(again.size() == (*result)->consumed);
    BINPICK_CHECK(std::equal(again.begin(), again.end(), bytes.begin() + static_cast<std::ptrdiff_t>(at)));
    at += (*result)->consumed;
  }
  if (const auto request = parse_request(as_text(bytes))) BINPICK_CHECK(to_text(*request) == as_text(bytes));
  if (const auto reply = parse_reply(as_text(bytes))) BINPICK_CHECK(to_text(*reply) == as_text(bytes));

  Session session{Options{}};
  TimePoint now{};
  session.on_connected(now);
  const std::size_t segment = 1 + data[0];
  for (std::size_t at = 0; at < bytes.size(); at += segment) {
    now += std::chrono::milliseconds(7);
    session.on_bytes(bytes.subspan(at, std::min(segment, bytes.size() - at)), now);
    if (session.deadline() && *session.deadline() <= now) session.on_deadline(now);
    if (session.state() == Session::State::Idle) session.start_measuring(now);
    if (session.state() == Session::State::Measuring && at % 5 == 0) session.stop_measuring(now);
    (void)session.take_output();
    while (session.take_event()) {
    }
    if (session.take_reopen()) session.on_connected(now);
  }
  return 0;
}
