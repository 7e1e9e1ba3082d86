#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "base/log.hpp"
#include "plc/registers.hpp"
#include "plc/session.hpp"

/// The Modbus guard, libmodbus's modbus_reply behind it, and the handshake behind that: any bytes on several
/// connections, cut anywhere, with the cell and the clock at work in between. Whatever comes out is whole Modbus
/// frames, and what the map says of itself is consistent.
namespace {
using namespace binpick;
using namespace binpick::plc;

void check_frames(ByteView output) {
  while (!output.empty()) {
    if (output.size() < 9 || read_be<std::uint16_t>(output, 2) != 0) std::abort();
    const std::size_t length = 6 + std::size_t{read_be<std::uint16_t>(output, 4)};
    if (length > 260 || length > output.size()) std::abort();
    output = output.subspan(length);
  }
}

void check_map(const Session& session) {
  if (session.register_at(at("map_version")) != kMapVersion || session.register_at(at("test_f32")) != 0x47F1)
    std::abort();
  if (session.register_at(at("result_sequence")) != session.register_at(at("result_sequence_tail"))) std::abort();
  const bool valid = (session.register_at(at("status")) & status::kResultValid) != 0;
  if (valid != (session.register_at(at("result_sequence")) != 0)) std::abort();
}
}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  log::set_threshold(log::Level::Error);
  if (size == 0) return 0;
  Options options;
  options.part_ids = {0, 1};
  options.supply_ids = {0, 1};
  options.connections_max = 3;
  options.base_address = (data[0] & 1) != 0 ? 65536 - kMapLength : 0;
  Session session{options, 1};
  TimePoint now{std::chrono::seconds(1)};
  for (ConnectionId id = 1; id <= 3; ++id) session.on_accept(id, "127.0.0.1", 1, now);
  ++data, --size;
  while (size > 0) {
    const std::uint8_t step = data[0];
    const ConnectionId id = 1 + (step & 1);
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
        session.on_closed(id, now);
        session.on_accept(id, "127.0.0.1", 1, now);
        break;
      case 5:
        now += std::chrono::milliseconds(100 << (step & 7));
        break;
      default:
        length = std::min<std::size_t>(size - 1, (step & 0x0F) * 8 + 1);
        session.on_bytes(id, std::as_bytes(std::span{data + 1, length}), now);
        break;
    }
    data += 1 + length;
    size -= 1 + length;
    if (session.deadline() && *session.deadline() <= now) session.on_deadline(now);
    for (ConnectionId each = 1; each <= 3; ++each) {
      const Bytes output = session.take_output(each);
      check_frames(output);
      if (session.wants_close(each)) {
        session.on_closed(each, now);
        session.on_accept(each, "127.0.0.1", 1, now);
      }
    }
    while (session.take_event()) continue;
    check_map(session);
  }
  return 0;
}
