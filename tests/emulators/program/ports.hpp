#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "base/clock.hpp"
#include "config/config.hpp"
#include "drivers/link/can.hpp"
#include "drivers/link/loop.hpp"
#include "drivers/link/tcp.hpp"
#include "drivers/link/udp_link.hpp"
#include "tests/emulators/pivot/pivot.hpp"
#include "tests/emulators/plc/plc.hpp"
#include "tests/emulators/robot/robot.hpp"
#include "tests/emulators/scanner/lms400_device.hpp"
#include "tests/emulators/scanner/lps36_device.hpp"
#include "tests/emulators/scanner/scanner_place.hpp"
#include "tests/emulators/world/world.hpp"

/// The emulated devices on real sockets. The devices are the same objects that tests run in memory.
namespace binpick::emulators {
/// The pivot on its CAN bus. It has a thread and a loop of its own: its answers must not wait while the scanner's rays
/// are being cast, or the daemon would see a pivot whose clock stumbles.
class PivotPort {
 public:
  /// `can` is what the daemon's pivot.can says: "cannelloni://HOST:PORT" (we listen there and answer whoever speaks) or
  /// a CAN interface. Throws std::runtime_error.
  PivotPort(const std::string& can, const PivotOptions& options);
  ~PivotPort();
  PivotPort(const PivotPort&) = delete;
  PivotPort& operator=(const PivotPort&) = delete;

  Angle angle_at(TimePoint at) const;
  /// Runs `what` on the pivot, safe against its thread.
  template <class What>
  auto with(What what) {
    const std::lock_guard lock{mutex_};
    return what(pivot_);
  }
  void wake() { loop_.wake(); }

 private:
  void run();

  mutable std::mutex mutex_;
  Pivot pivot_;
  drivers::link::Loop loop_;
  std::unique_ptr<drivers::link::CanLink> link_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

/// A server of which one connection counts, the newest; `connection` is its number, 0: none.
template <class Device>
drivers::link::ServerPeer serve_one(Device& device, drivers::link::ConnectionId& connection) {
  using drivers::link::ConnectionId;
  return {
      .on_accept =
          [&](ConnectionId id, const std::string&, std::uint16_t, TimePoint now) {
            if (device.faults.unplugged) return false;
            if (connection != 0) device.on_disconnected(now);
            connection = id;
            device.on_connected(now);
            return true;
          },
      .on_bytes =
          [&](ConnectionId id, ByteView bytes, TimePoint now) {
            if (id == connection) device.on_bytes(bytes, now);
          },
      .on_closed =
          [&](ConnectionId id, TimePoint now) {
            if (id != connection) return;
            connection = 0;
            device.on_disconnected(now);
          },
      .take_output = [&](ConnectionId id) { return id == connection ? device.take_output() : Bytes{}; },
      .wants_close =
          [&](ConnectionId id) {
            if constexpr (requires { device.wants_close(); })
              return id != connection || device.wants_close();
            else
              return id != connection;
          },
  };
}

/// The scanner on its socket, whatever it speaks.
class ScannerPort {
 public:
  virtual ~ScannerPort() = default;
  virtual void turn(TimePoint now) = 0;
  virtual std::optional<TimePoint> deadline() const = 0;
  virtual Faults& faults() = 0;
};

/// An LMS 400: TCP server with one client.
class Lms400Port final : public ScannerPort {
 public:
  Lms400Port(drivers::link::Loop& loop, const std::string& listen, Lms400::Measure measure, std::uint64_t seed);
  void turn(TimePoint now) override;
  std::optional<TimePoint> deadline() const override { return scanner.deadline(); }
  Faults& faults() override { return scanner.faults; }

  Lms400 scanner;

 private:
  drivers::link::ConnectionId connection_ = 0;
  drivers::link::TcpServer server_;
};

/// An LPS 36: UDP, answers whoever spoke last.
class Lps36Port final : public ScannerPort {
 public:
  Lps36Port(drivers::link::Loop& loop, const std::string& listen, Lps36::Measure measure,
            const Lps36::Options& options);
  void turn(TimePoint now) override;
  std::optional<TimePoint> deadline() const override { return earlier(scanner.deadline(), link_.deadline()); }
  Faults& faults() override { return scanner.faults; }

  Lps36 scanner;

 private:
  drivers::link::UdpLink link_;
};

/// Plays the scanner of a cell file, looking at `world` from where `where` says.
std::unique_ptr<ScannerPort> open_scanner(drivers::link::Loop& loop, const config::Config& config, const World& world,
                                          WhereScanner where, std::uint64_t seed);

/// A device that is a TCP client of the daemon: robot or PLC. `wants_link` false: no connection is tried.
template <class Client>
class ClientPort {
 public:
  ClientPort(drivers::link::Loop& loop, drivers::link::Endpoint daemon, Client client)
      : device{std::move(client)}, loop_{loop}, daemon_{std::move(daemon)} {}

  void turn(TimePoint now) {
    if (wants_link() != (link_ != nullptr)) {
      if (link_) {
        if (link_->connected()) device.on_disconnected(now);
        link_.reset();
      } else {
        link_ = std::make_unique<drivers::link::TcpClient>(loop_, daemon_, peer());
      }
    }
    if (device.deadline() && *device.deadline() <= now) device.on_deadline(now);
    if (!link_) return;
    link_->on_deadline(now);
    link_->flush(now);
    if constexpr (requires { device.take_reopen(); }) {
      if (device.take_reopen()) link_->reopen(now);
    } else if (link_->connected() && device.wants_close()) {
      link_->reopen(now);
    }
  }
  std::optional<TimePoint> deadline() const {
    return earlier(device.deadline(), link_ ? link_->deadline() : std::nullopt);
  }
  bool connected() const { return link_ && link_->connected(); }
  std::string last_error() const { return link_ ? link_->last_error() : "unplugged"; }

  Client device;

 private:
  bool wants_link() const {
    if constexpr (requires { device.wants_link(); }) {
      return device.wants_link();
    } else {
      return !device.faults.unplugged;
    }
  }
  drivers::link::StreamPeer peer() {
    return {[this](TimePoint now) { device.on_connected(now); },
            [this](ByteView bytes, TimePoint now) { device.on_bytes(bytes, now); },
            [this](TimePoint now) { device.on_disconnected(now); }, [this] { return device.take_output(); }};
  }

  drivers::link::Loop& loop_;
  drivers::link::Endpoint daemon_;
  std::unique_ptr<drivers::link::TcpClient> link_;
};
using RobotPort = ClientPort<Robot>;

/// The PLC: a client of the daemon, or a server with one connection that the daemon opens.
class PlcPort : public ClientPort<Plc> {
 public:
  /// `endpoint` is the daemon's, or where the PLC listens. Throws std::runtime_error when it cannot listen there.
  PlcPort(drivers::link::Loop& loop, const drivers::link::Endpoint& endpoint, Plc plc);
  void turn(TimePoint now);
  bool connected() const { return server_ ? connection_ != 0 : ClientPort::connected(); }
  std::string last_error() const { return server_ ? "no daemon polls it" : ClientPort::last_error(); }

 private:
  drivers::link::ConnectionId connection_ = 0;
  std::optional<drivers::link::TcpServer> server_;
};
}  // namespace binpick::emulators
