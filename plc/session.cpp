#include "plc/session.hpp"

#include <algorithm>
#include <vector>

#include "base/check.hpp"
#include "plc/core.hpp"
#include "plc/modbus_client.hpp"
#include "plc/modbus_server.hpp"

namespace binpick::plc {
namespace {
modbus::Limits limits_of(const Options& options) {
  const auto base = options.base_address;
  return {base, kMapLength, static_cast<std::uint16_t>(base + kRequestFirst), kRequestLength};
}

modbus::ClientOptions client_options(const Options& options) {
  return {options.address, options.unit_id, options.base_address, options.poll, options.reply_timeout};
}
}  // namespace

/// One core and the one role that carries its words.
struct Session::Impl {
  Impl(const Options& options, std::uint16_t boot_count)
      : base{options.base_address},
        server{options.role == LineRole::Server ? serve(options) : nullptr},
        own_words(server ? 0 : kMapLength),
        client{server ? nullptr : poll(options)},
        core{options, boot_count, server ? server->words().subspan(base) : std::span{own_words}} {
    BINPICK_CHECK(std::size_t{base} + kMapLength <= 65536);  // the cell file's key table sees to it
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  std::unique_ptr<modbus::Server> serve(const Options& options) {
    return std::make_unique<modbus::Server>(
        modbus::ServerOptions{options.allow, options.connections_max}, limits_of(options),
        modbus::ServerCalls{
            [this](modbus::WrittenRange range, TimePoint now) {
              core.on_written(static_cast<std::uint16_t>(range.first - base), range.count, now);
            },
            [this](TimePoint now) { core.on_writer_gone(now); },
            [this](const std::string&, TimePoint now) { core.on_second_writer(true, now); },
            [this](TimePoint now) { core.on_second_writer(false, now); },
        });
  }

  std::unique_ptr<modbus::Client> poll(const Options& options) {
    return std::make_unique<modbus::Client>(client_options(options), own_words,
                                            modbus::ClientCalls{
                                                [this](TimePoint now) { core.set_connected(true, now); },
                                                [this](std::span<const std::uint16_t> request, TimePoint) {
                                                  if ((request[at("control")] & control::kRequest) == 0)
                                                    core.on_request_seen_low();
                                                },
                                                [this](std::span<const std::uint16_t> request, TimePoint now) {
                                                  std::ranges::copy(request, own_words.begin() + kRequestFirst);
                                                  core.on_written(kRequestFirst, kRequestLength, now);
                                                },
                                                [this](TimePoint now) {
                                                  core.set_connected(false, now);
                                                  core.on_writer_gone(now);
                                                },
                                            });
  }

  modbus::Server& as_server() {
    BINPICK_CHECK(server != nullptr);
    return *server;
  }
  modbus::Client& as_client() {
    BINPICK_CHECK(client != nullptr);
    return *client;
  }

  std::uint16_t base;
  std::unique_ptr<modbus::Server> server;
  std::vector<std::uint16_t> own_words;  // the map, when no server has it
  std::unique_ptr<modbus::Client> client;
  Core core;
};

Session::Session(const Options& options, std::uint16_t boot_count)
    : impl_{std::make_unique<Impl>(options, boot_count)} {}
Session::~Session() = default;
Session::Session(Session&&) noexcept = default;
Session& Session::operator=(Session&&) noexcept = default;

bool Session::on_accept(ConnectionId id, const std::string& address, std::uint16_t port, TimePoint now) {
  impl_->core.begin(now);
  const bool accepted = impl_->as_server().on_accept(id, address, port, now);
  impl_->core.set_connected(impl_->server->connections() > 0, now);
  return accepted;
}

void Session::on_bytes(ConnectionId id, ByteView bytes, TimePoint now) {
  impl_->core.begin(now);
  impl_->as_server().on_bytes(id, bytes, now);
}

void Session::on_closed(ConnectionId id, TimePoint now) {
  impl_->core.begin(now);
  impl_->as_server().on_closed(id, now);
  impl_->core.set_connected(impl_->server->connections() > 0, now);
}

Bytes Session::take_output(ConnectionId id) { return impl_->as_server().take_output(id); }
bool Session::wants_close(ConnectionId id) const { return impl_->as_server().wants_close(id); }

void Session::on_connected(TimePoint now) {
  impl_->core.begin(now);
  impl_->as_client().on_connected(now);
}

void Session::on_bytes(ByteView bytes, TimePoint now) {
  impl_->core.begin(now);
  impl_->as_client().on_bytes(bytes, now);
}

void Session::on_disconnected(TimePoint now) {
  impl_->core.begin(now);
  impl_->as_client().on_disconnected(now);
}

Bytes Session::take_output() { return impl_->as_client().take_output(); }
bool Session::take_reopen() { return impl_->as_client().take_reopen(); }

void Session::on_deadline(TimePoint now) {
  impl_->core.begin(now);
  if (impl_->server) impl_->server->on_deadline(now);
  if (impl_->client) impl_->client->on_deadline(now);
  impl_->core.on_deadline(now);
}

std::optional<TimePoint> Session::deadline() const {
  return earlier(impl_->core.deadline(), impl_->server ? impl_->server->deadline() : impl_->client->deadline());
}

std::optional<Event> Session::take_event() { return impl_->core.take_event(); }

void Session::set_not_ready(std::uint16_t device_reasons, TimePoint now) {
  impl_->core.set_not_ready(device_reasons, now);
}
bool Session::robot_clear() const { return impl_->core.robot_clear(); }
void Session::on_scan_done(TimePoint now) { impl_->core.on_scan_done(now); }
void Session::publish(const PickResult& result, TimePoint now) { impl_->core.publish(result, now); }
void Session::fault(Alarm alarm, TimePoint now) { impl_->core.fault(alarm, now); }
void Session::raise(Alarm alarm, TimePoint now) { impl_->core.raise(alarm, now); }
void Session::clear(Alarm alarm, TimePoint now) { impl_->core.clear(alarm, now); }

void Session::reconfigure(const Options& options, TimePoint now) {
  if (impl_->server) impl_->server->set_options({options.allow, options.connections_max});
  impl_->core.reconfigure(options, now);
}

State Session::state() const { return impl_->core.state(); }
bool Session::told() const { return !impl_->client || impl_->client->told(); }

std::uint16_t Session::register_at(std::uint16_t offset) const {
  BINPICK_CHECK(offset < kMapLength);
  return impl_->core.word(offset);
}
}  // namespace binpick::plc
