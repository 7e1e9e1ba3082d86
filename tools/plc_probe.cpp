#include "tools/plc_probe.hpp"

#include <optional>

#include "base/clock.hpp"
#include "drivers/link/tcp.hpp"
#include "plc/modbus_guard.hpp"
#include "plc/modbus_request.hpp"
#include "plc/registers.hpp"

namespace binpick::tools {
namespace link = drivers::link;
namespace modbus = plc::modbus;
namespace {
constexpr Duration kConnectMax = std::chrono::seconds(2);

std::string what_it_holds(const std::vector<std::uint16_t>& words) {
  using plc::at;
  const std::string heartbeat = "its heartbeat is " + std::to_string(words[at("plc_heartbeat")]);
  if (words[at("map_version")] == 0) return heartbeat + ", no cell has written there since it started";
  if (words[at("map_version")] != plc::kMapVersion || words[at("map_length")] != plc::kMapLength)
    return heartbeat + ", but word " + std::to_string(at("map_version")) +
           " is not this map's version: another base address, or words that are not the cell's";
  return heartbeat + ", a cell wrote there before (boot count " + std::to_string(words[at("boot_count")]) + ")";
}
}  // namespace

Answer ask_plc(link::Loop& loop, const config::Config& config) {
  const auto endpoint = link::parse_endpoint(config.plc.address);
  if (!endpoint) return {false, endpoint.error()};
  const modbus::Request request{.transaction = 1,
                                .unit = config.plc.unit_id,
                                .first = config.plc.base_address,
                                .count = plc::kMapLength,
                                .words = {}};
  modbus::FrameBuffer buffer;
  Bytes output;
  std::optional<Answer> answer;
  bool connected = false;
  const auto on_bytes = [&](ByteView bytes, TimePoint) {
    buffer.append(bytes);
    const auto frame = buffer.take_frame();
    if (!frame) {
      answer = Answer{false, "no Modbus comes from there: " + to_string(frame.error())};
    } else if (*frame) {
      const auto words = modbus::parse_reply(**frame, request);
      answer = words ? Answer{true, "unit " + std::to_string(request.unit) + " answers, " + what_it_holds(*words)}
                     : Answer{false, to_string(request) + ": " + to_string(words.error())};
    }
  };
  link::TcpClient client{loop,
                         *endpoint,
                         {.on_connected =
                              [&](TimePoint) {
                                connected = true;
                                output = encode(request);
                              },
                          .on_bytes = on_bytes,
                          .on_disconnected =
                              [&](TimePoint) {
                                if (!answer)
                                  answer = Answer{false, "it closed the connection; is it taken by another client?"};
                              },
                          .take_output = [&] { return std::exchange(output, {}); }}};
  const SystemClock clock;
  TimePoint now = clock.now();
  TimePoint until = now + kConnectMax;
  while (!answer && now < until) {
    client.on_deadline(now);
    client.flush(now);
    const bool before = connected;
    now = loop.wait(earlier(client.deadline(), until));
    if (connected && !before) until = now + config.plc.reply_timeout;
  }
  if (answer) return *answer;
  if (!connected) return {false, "no connection: " + client.last_error()};
  return {false, "no reply to " + to_string(request) + " within plc.reply_timeout_ms"};
}
}  // namespace binpick::tools
