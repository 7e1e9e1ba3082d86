#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "base/log.hpp"
#include "plc/modbus_guard.hpp"
#include "plc/modbus_request.hpp"
#include "plc/registers.hpp"
#include "plc/session.hpp"

/// The cell as a Modbus client: any bytes for replies, whole or cut or under the right header, with connections, the
/// cell and the clock at work in between. What it sends are whole requests for words of the map, and it never gets
/// stuck: a deadline is always ahead, or the connection is given up.
namespace {
using namespace binpick;
using namespace binpick::plc;

constexpr std::uint16_t kBase = 300;

void check_request(ByteView frame) {
  if (frame.size() < 12 || read_be<std::uint16_t>(frame, 2) != 0 || frame[6] != std::byte{9}) std::abort();
  if (6 + std::size_t{read_be<std::uint16_t>(frame, 4)} != frame.size()) std::abort();
  const std::size_t first = read_be<std::uint16_t>(frame, 8), count = read_be<std::uint16_t>(frame, 10);
  const bool write = frame[7] == std::byte{16};
  if (!write && frame[7] != std::byte{3}) std::abort();
  if (first < std::size_t{kBase} + (write ? kStatusFirst : 0) || first + count > std::size_t{kBase} + kMapLength)
    std::abort();
  if (frame.size() != (write ? 13 + 2 * count : 12)) std::abort();
}
}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  log::set_threshold(log::Level::Error);
  Options options;
  options.role = LineRole::Client;
  options.address = "plc:502";
  options.unit_id = 9;
  options.base_address = kBase;
  options.part_ids = {0, 1};
  options.supply_ids = {0, 1};
  Session session{options, 1};
  TimePoint now{std::chrono::seconds(1)};
  bool connected = false;
  Bytes asked;
  while (size > 0) {
    const std::uint8_t step = data[0];
    std::size_t length = 0;
    switch (step >> 4) {
      case 0:
        session.set_not_ready(step & 2, now);
        break;
      case 1:
        session.on_scan_done(now);
        break;
      case 2: {
        PickResult result;
        result.code = (step & 2) != 0 ? ResultCode::PickFound : ResultCode::SupplyEmpty;
        result.pick_id = step;
        session.publish(result, now);
        break;
      }
      case 3:
        session.fault(Alarm::ScannerNoReply, now);
        break;
      case 4:
        if (connected) session.on_disconnected(now);
        connected = !connected;
        if (connected) session.on_connected(now);
        asked.clear();
        break;
      case 5:
        now += std::chrono::milliseconds(5 << (step & 7));
        break;
      case 6:
      case 7:  // any bytes
        length = std::min<std::size_t>(size - 1, (step & 0x1F) + 1);
        if (connected) session.on_bytes(std::as_bytes(std::span{data + 1, length}), now);
        break;
      default: {  // an answer under the header of the request, with any words, now and then cut or too long
        if (!connected || asked.size() < 12) break;
        const bool write = asked[7] == std::byte{16};
        const std::size_t words = read_be<std::uint16_t>(asked, 10);
        Bytes reply(asked.begin(), asked.begin() + (write ? 12 : 8));
        const std::size_t content = write ? 4 : 1 + 2 * words;
        if (!write) {
          reply.push_back(static_cast<std::byte>(2 * words));
          length = std::min<std::size_t>({size - 1, 2 * words, 16});
          reply.resize(reply.size() + 2 * words);
          std::ranges::copy(std::as_bytes(std::span{data + 1, length}), reply.begin() + 9);
        }
        reply[4] = std::byte{0};
        reply[5] = static_cast<std::byte>(2 + content);
        if (step == 0xF0) reply.pop_back();
        if (step == 0xF1) reply.push_back(std::byte{0});
        session.on_bytes(reply, now);
        break;
      }
    }
    data += 1 + length;
    size -= 1 + length;
    if (session.deadline() && *session.deadline() <= now) session.on_deadline(now);
    if (connected) {
      if (const Bytes output = session.take_output(); !output.empty()) {
        check_request(output);
        asked = output;
      }
      if (session.take_reopen()) {
        session.on_disconnected(now);
        connected = false;
      }
    }
    if (!session.deadline() || *session.deadline() > now + std::chrono::seconds(2)) std::abort();
    while (session.take_event()) continue;
    if (session.register_at(at("result_sequence")) != session.register_at(at("result_sequence_tail"))) std::abort();
  }
  return 0;
}
