#include "plc/modbus_server.hpp"

#include <algorithm>

#include "base/log.hpp"
#include "base/peer_address.hpp"

namespace binpick::plc::modbus {
namespace {
/// Addresses told of in the log, per reason; beyond it a flood of addresses is silent.
constexpr std::size_t kToldMax = 256;
}  // namespace

Server::Server(const ServerOptions& options, const Limits& limits, ServerCalls calls)
    : options_{options}, limits_{limits}, calls_{std::move(calls)}, reply_{std::size_t{limits.first} + limits.count} {}

bool Server::allowed(const std::string& address) const { return may_connect(options_.allow, address); }

bool Server::first_time(std::set<std::string>& told, const std::string& address) {
  return told.size() < kToldMax && told.insert(address).second;
}

bool Server::on_accept(ConnectionId id, const std::string& raw_address, std::uint16_t port, TimePoint now) {
  const std::string address = canonical_address(raw_address);
  if (!allowed(address)) {
    if (first_time(told_strangers_, address))
      BINPICK_LOG(Warning, "plc", "stranger %s:%u refused; add it to plc.allow if it is the PLC", address.c_str(),
                  port);
    return false;
  }
  if (connections_.size() >= options_.connections_max) {
    // A peer that lost its power never closes: whoever was silent longest makes room, the writer last of all.
    auto oldest = connections_.end();
    for (auto it = connections_.begin(); it != connections_.end(); ++it) {
      const bool idle = !it->second.closing && it->first != writer_ && now - it->second.last_frame >= kIdleAtCap;
      if (idle && (oldest == connections_.end() || it->second.last_frame < oldest->second.last_frame)) oldest = it;
    }
    if (oldest == connections_.end()) {
      if (first_time(told_full_, address))
        BINPICK_LOG(Warning, "plc", "%s:%u refused: all %zu connections are taken; see plc.connections_max",
                    address.c_str(), port, options_.connections_max);
      return false;
    }
    oldest->second.closing = true;
    if (connections_.size() >= 2 * options_.connections_max) return false;  // closed ones have not gone yet
  }
  connections_[id] = Connection{address, port, now, {}, {}, false, false};
  return true;
}

void Server::on_bytes(ConnectionId id, ByteView bytes, TimePoint now) {
  const auto it = connections_.find(id);
  if (it == connections_.end() || it->second.closing) return;
  it->second.buffer.append(bytes);
  serve(id, it->second, now);
}

void Server::serve(ConnectionId id, Connection& connection, TimePoint now) {
  for (int n = 0; n < kFramesPerTurn; ++n) {
    auto frame = connection.buffer.take_frame();
    if (!frame) {
      if (first_time(told_frames_, connection.address))
        BINPICK_LOG(Warning, "plc", "%s:%u sends no Modbus: %s; connection closed", connection.address.c_str(),
                    connection.port, to_string(frame.error()).c_str());
      connection.closing = true;
      return;
    }
    if (!*frame) return;
    connection.last_frame = now;
    answer(id, connection, **frame, now);
  }
  if (connection.buffer.has_frame() && !waiting_since_) waiting_since_ = now;
}

void Server::answer(ConnectionId id, Connection& connection, ByteView frame, TimePoint now) {
  const Verdict verdict = check(frame, limits_);
  if (verdict.answer) {
    append(connection.output, *verdict.answer);
    return;
  }
  if (verdict.written && !may_write(id, connection, now)) {
    append(connection.output, exception_answer(frame, ExceptionCode::Busy));
    return;
  }
  append(connection.output, reply_.answer(frame));
  if (verdict.written) calls_.on_written(*verdict.written, now);
}

bool Server::may_write(ConnectionId id, Connection& connection, TimePoint now) {
  if (writer_ == id) return true;
  if (writer_) {
    const auto writer = connections_.find(*writer_);
    const bool alive =
        writer != connections_.end() && !writer->second.closing && now - writer->second.last_frame < kWriterSilence;
    if (alive) {
      if (!connection.refused_writes) {
        connection.refused_writes = true;
        calls_.on_second_writer(connection.address, now);
      }
      if (first_time(told_writers_, connection.address))
        BINPICK_LOG(Warning, "plc", "second writer %s:%u refused; %s:%u writes already, others may only read",
                    connection.address.c_str(), connection.port, writer->second.address.c_str(), writer->second.port);
      return false;
    }
    calls_.on_writer_gone(now);
  }
  writer_ = id;
  connection.refused_writes = false;
  BINPICK_LOG(Info, "plc", "%s:%u writes now", connection.address.c_str(), connection.port);
  return true;
}

void Server::on_closed(ConnectionId id, TimePoint now) {
  const auto it = connections_.find(id);
  if (it == connections_.end()) return;
  const bool refused = it->second.refused_writes;
  connections_.erase(it);
  if (writer_ == id) {
    writer_.reset();
    calls_.on_writer_gone(now);
  }
  if (refused && std::ranges::none_of(connections_, [](const auto& other) { return other.second.refused_writes; }))
    calls_.on_second_writer_gone(now);
}

Bytes Server::take_output(ConnectionId id) {
  const auto it = connections_.find(id);
  if (it == connections_.end()) return {};
  return std::exchange(it->second.output, {});
}

bool Server::wants_close(ConnectionId id) const {
  const auto it = connections_.find(id);
  return it != connections_.end() && it->second.closing;
}

void Server::on_deadline(TimePoint now) {
  if (!waiting_since_) return;
  waiting_since_.reset();
  for (auto& [id, connection] : connections_)
    if (!connection.closing && connection.buffer.has_frame()) serve(id, connection, now);
}

std::optional<TimePoint> Server::deadline() const { return waiting_since_; }

void Server::set_options(const ServerOptions& options) {
  options_ = options;
  for (auto& [id, connection] : connections_)
    if (!allowed(connection.address)) connection.closing = true;
}
}  // namespace binpick::plc::modbus
