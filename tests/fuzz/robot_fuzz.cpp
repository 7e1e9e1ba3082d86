#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "base/log.hpp"
#include "drivers/robot/codec.hpp"
#include "drivers/robot/session.hpp"

/// The robot's socket: any bytes, cut anywhere, with offers and broken connections in between. Whatever comes out is
/// one answer per line that a robot can read. The first byte chooses the dialect; each reads any bytes as an answer.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace binpick;
  using namespace binpick::drivers::robot;
  log::set_threshold(log::Level::Error);
  if (size == 0) return 0;
  constexpr Dialect kDialects[] = {Dialect::UniversalRobots, Dialect::Fanuc, Dialect::Kawasaki};
  const Dialect dialect = kDialects[*data++ % 3];
  --size;
  const std::string_view text{reinterpret_cast<const char*>(data), size};
  if (const auto decoded = decode_reply(text, dialect); decoded && *decoded) {
    if ((*decoded)->consumed > size) std::abort();
    // What was read can be said again, and is read the same.
    const std::string again = encode((*decoded)->reply, dialect);
    const auto second = decode_reply(again, dialect);
    if (!second || !*second || (*second)->reply.pick.pick_id != (*decoded)->reply.pick.pick_id) std::abort();
  }
  if (const auto request = decode_request(text)) {
    std::string line = encode(*request, dialect);
    while (line.back() < ' ') line.pop_back();
    if (!decode_request(line)) std::abort();
  }

  Session session{{.dialect = dialect}};
  TimePoint now{};
  session.on_connected(now);
  while (size > 0) {
    const std::uint8_t step = data[0];
    const std::size_t length = std::min<std::size_t>(size - 1, step & 0x3F);
    now += std::chrono::seconds(step >> 6);
    if (step == 0x40) session.on_disconnected(now);
    if (step == 0x41) session.on_connected(now);
    if (step == 0x42) session.offer({static_cast<std::uint16_t>(size | 1), 1, 1, 1, {}, {}, {}});
    if (step == 0x43) session.withdraw(NoPick::SupplyEmpty);
    session.on_bytes(std::as_bytes(std::span{data + 1, length}), now);
    data += 1 + length;
    size -= 1 + length;
    if (session.deadline() && *session.deadline() <= now) session.on_deadline(now);
    session.take_reopen();
    while (session.take_event()) continue;
    const Bytes output = session.take_output();
    std::string_view answers = as_text(output);
    while (!answers.empty() && answers != "\n") {
      const auto decoded = decode_reply(answers, dialect);
      if (!decoded || !*decoded) std::abort();
      answers.remove_prefix((*decoded)->consumed);
    }
  }
  return 0;
}
