#pragma once

#include <algorithm>
#include <functional>
#include <gtest/gtest.h>
#include <string>
#include <vector>

#include "plc/session.hpp"
#include "tests/unit/plc/rig.hpp"

namespace binpick::plc::test {
/// A server in a few lines; its answers are written out by hand and share no encoder with anybody.
class ServerRig {
 public:
  explicit ServerRig(const Options& o = client_options()) : session{o, 7} {}

  void connect() {
    session.on_connected(now);
    connected = true;
    run_for(Duration{0});
  }
  void disconnect() {
    connected = false;
    session.on_disconnected(now);
  }

  /// Serves whatever is due, and answers; a connection that the session drops stays down.
  void run_for(Duration duration, Duration step = std::chrono::milliseconds(5)) {
    const TimePoint end = now + duration;
    while (true) {
      for (int i = 0; i < 20; ++i) {
        if (session.deadline() && *session.deadline() <= now) session.on_deadline(now);
        if (!connected || !exchange()) break;
      }
      if (session.take_reopen()) {
        ++reopened;
        disconnect();
      }
      if (now >= end) return;
      now = std::min(end, now + step);
      if (beating) ++words[0];
    }
  }
  void ready() {
    session.set_not_ready(0, now);
    run_for(std::chrono::milliseconds(50));
  }
  void request(std::uint16_t sequence) {
    words[at("sequence")] = sequence;
    words[at("part_id")] = words[at("supply_id")] = 1;
    words[at("result_ack")] = 0;
    words[at("control")] = control::kRequest | control::kRobotClear;
    run_for(std::chrono::milliseconds(100));
  }
  void drop() {
    words[at("control")] = control::kRobotClear;
    run_for(std::chrono::milliseconds(100));
  }
  std::string events() {
    std::string out;
    while (const auto event = session.take_event()) {
      if (const auto* accepted = std::get_if<RequestAccepted>(&*event))
        out += "A" + std::to_string(accepted->request.sequence) + " ";
      if (std::holds_alternative<PlcLost>(*event)) out += "L ";
      if (std::holds_alternative<PlcBack>(*event)) out += "B ";
      if (std::holds_alternative<CycleAborted>(*event)) out += "a ";
    }
    return out;
  }
  bool has(std::uint16_t flag) const { return (words[at("status")] & flag) != 0; }

  TimePoint now{std::chrono::seconds(1000)};
  Session session;
  std::array<std::uint16_t, kMapLength> words{};  ///< The PLC's.
  bool connected = false, beating = true, mute = false;
  int reopened = 0;
  /// Changes an answer before it is sent; empty: as it is.
  std::function<void(Bytes&)> spoil;
  std::vector<Bytes> requests;  ///< As they came.

 private:
  bool exchange() {
    const Bytes frame = session.take_output();
    if (frame.empty()) return false;
    requests.push_back(frame);
    if (mute) return true;
    const std::size_t first = read_be<std::uint16_t>(frame, 8), count = read_be<std::uint16_t>(frame, 10);
    EXPECT_LE(first + count, kMapLength);
    Bytes reply(frame.begin(), frame.begin() + 4);
    if (frame[7] == std::byte{3}) {
      append_be(reply, static_cast<std::uint16_t>(3 + 2 * count));
      reply.push_back(frame[6]);
      reply.push_back(std::byte{3});
      reply.push_back(static_cast<std::byte>(2 * count));
      for (std::size_t i = 0; i < count; ++i) append_be(reply, words[first + i]);
    } else {
      EXPECT_EQ(frame[7], std::byte{16});
      for (std::size_t i = 0; i < count; ++i) words[first + i] = read_be<std::uint16_t>(frame, 13 + 2 * i);
      append_be<std::uint16_t>(reply, 6);
      reply.insert(reply.end(), frame.begin() + 6, frame.begin() + 12);
    }
    if (spoil) spoil(reply);
    session.on_bytes(reply, now);
    return true;
  }
};
}  // namespace binpick::plc::test
