#pragma once

#include <array>
#include <gtest/gtest.h>
#include <initializer_list>
#include <string>
#include <vector>

#include "plc/registers.hpp"
#include "plc/session.hpp"

/// A Modbus master in a few lines beside one plc::Session. Its frames are written out by hand: it shares no encoder
/// with the emulated PLC, the guard or libmodbus.
namespace binpick::plc::test {

inline Bytes hex(std::initializer_list<int> values) {
  Bytes out;
  for (const int v : values) out.push_back(static_cast<std::byte>(v));
  return out;
}

inline Options options() {
  Options o;
  o.part_ids = {1, 2};
  o.supply_ids = {1, 3};
  o.allow = {"192.168.0.10"};
  return o;
}

/// The same for a cell that is the client of the PLC's server.
inline Options client_options() {
  Options o = options();
  o.role = LineRole::Client;
  o.address = "192.168.0.10:502";
  return o;
}

class Rig {
 public:
  explicit Rig(const Options& o = options(), std::uint16_t boot_count = 7) : session{o, boot_count} {
    EXPECT_TRUE(session.on_accept(1, "127.0.0.1", 40000, now));
  }

  /// Sends one frame on connection `id`; the answer.
  Bytes exchange(const Bytes& frame, ConnectionId id = 1) {
    session.on_bytes(id, frame, now);
    return session.take_output(id);
  }
  /// FC16 of the whole request block.
  Bytes write(ConnectionId id = 1) {
    Bytes frame = hex({0, 9, 0, 0, 0, 23, 255, 16, 0, 0, 0, 8, 16});
    for (const auto word : block) append_be(frame, word);
    return exchange(frame, id);
  }
  void control(std::uint16_t bits) {
    block[at("control")] = bits;
    EXPECT_EQ(write(), hex({0, 9, 0, 0, 0, 6, 255, 16, 0, 0, 0, 8}));
  }
  void request(std::uint16_t sequence, std::uint16_t part = 1, std::uint16_t supply = 1) {
    block[at("sequence")] = sequence;
    block[at("part_id")] = part;
    block[at("supply_id")] = supply;
    block[at("result_ack")] = 0;
    control(control::kRequest | control::kRobotClear);
  }
  void drop() { control(control::kRobotClear); }
  void acknowledge(std::uint16_t sequence) {
    block[at("result_ack")] = sequence;
    write();
  }
  void beat() {
    ++block[at("plc_heartbeat")];
    write();
  }
  /// Virtual time runs on; the PLC's heartbeat with it.
  void run_for(Duration duration, bool beating = true) {
    const TimePoint end = now + duration;
    while (now < end) {
      now = std::min(end, now + std::chrono::milliseconds(100));
      if (beating) beat();
      while (session.deadline() && *session.deadline() <= now) session.on_deadline(now);
    }
  }

  std::uint16_t word(std::uint16_t offset) const { return session.register_at(offset); }
  std::uint16_t status() const { return word(at("status")); }
  bool has(std::uint16_t bit) const { return (status() & bit) != 0; }
  ResultCode code() const { return static_cast<ResultCode>(word(at("result_code"))); }
  Alarm first_alarm() const { return static_cast<Alarm>(word(at("first_alarm"))); }

  /// Events since last asked, as the letters A(ccepted with its number) a(borted) t(imed out) r(eset) k(acknowledged)
  /// c/C(lear fell, rose) L(ost) B(ack).
  std::string events() {
    std::string out;
    while (const auto event = session.take_event()) {
      if (const auto* accepted = std::get_if<RequestAccepted>(&*event))
        out += "A" + std::to_string(accepted->request.sequence) + " ";
      if (std::holds_alternative<CycleAborted>(*event)) out += "a ";
      if (std::holds_alternative<CycleTimedOut>(*event)) out += "t ";
      if (std::holds_alternative<ResetRaised>(*event)) out += "r ";
      if (const auto* acked = std::get_if<ResultAcknowledged>(&*event))
        out += "k" + std::to_string(acked->sequence) + " ";
      if (const auto* clear = std::get_if<RobotClearChanged>(&*event)) out += clear->clear ? "C " : "c ";
      if (std::holds_alternative<PlcLost>(*event)) out += "L ";
      if (std::holds_alternative<PlcBack>(*event)) out += "B ";
    }
    return out;
  }

  /// Takes the session from the start into `state`; the running or last cycle has number `sequence`.
  void bring_to(State state, std::uint16_t sequence = 5) {
    control(control::kRobotClear);
    session.set_not_ready(state == State::NotReady ? static_cast<std::uint16_t>(NotReady::Scanner) : std::uint16_t{0},
                          now);
    if (state != State::NotReady && state != State::Ready) {
      request(sequence);
      drop();
      if (state == State::Fault) session.fault(Alarm::ScannerNoReply, now);
      if (state == State::Detecting || state == State::ResultValid) session.on_scan_done(now);
      if (state == State::ResultValid) session.publish(pick(), now);
    }
    EXPECT_EQ(session.state(), state);
    events();
  }

  static PickResult pick(std::uint16_t pick_id = 77) {
    PickResult r;
    r.code = ResultCode::PickFound;
    r.pick_id = pick_id;
    r.part_id = 1;
    r.objects_left = 4;
    r.fill_level_percent = 35;
    r.score = 0.875;
    r.T_base_approach.iso.translation() = Eigen::Vector3d{1000, -250, 500};
    r.T_base_grasp.iso.translation() = Eigen::Vector3d{1000, -250, 400};
    r.T_base_retreat.iso.translation() = Eigen::Vector3d{1031.25, -312.5, 468.75};
    r.figures = {1200, 430, 68000, 312, 240};
    return r;
  }

  TimePoint now{std::chrono::seconds(1000)};
  std::array<std::uint16_t, kRequestLength> block{};
  Session session;
};

/// Log lines while it lives, instead of stderr.
class LogLines {
 public:
  LogLines();
  ~LogLines();
  LogLines(const LogLines&) = delete;
  LogLines& operator=(const LogLines&) = delete;
  /// Lines that contain `text`.
  long count(std::string_view text) const;

 private:
  std::vector<std::string> lines_;
};
}  // namespace binpick::plc::test
