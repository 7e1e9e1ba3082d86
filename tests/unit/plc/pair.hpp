#pragma once

#include <functional>
#include <map>
#include <optional>

#include "plc/session.hpp"
#include "tests/emulators/plc/plc.hpp"
#include "tests/unit/plc/rig.hpp"

namespace binpick::plc::test {
/// Session, in either role, and emulated PLC joined in memory, in virtual time, with a cell that answers picks by
/// itself: the scan takes 1 s, the detection 0.2 s.
class Pair {
 public:
  explicit Pair(const Options& cell_options, const emulators::PlcOptions& plc_options = {})
      : plc{in_role(plc_options, cell_options)},
        options_{cell_options},
        session{std::make_unique<Session>(cell_options, boot_count_)} {
    session->set_not_ready(0, now);
  }

  void restart_cell() {
    disconnect();
    published.clear();
    session = std::make_unique<Session>(options_, ++boot_count_);
    session->set_not_ready(0, now);
    scan_done_at.reset();
    result_at.reset();
  }

  void run_for(Duration duration) {
    const TimePoint end = now + duration;
    while (true) {
      settle();
      std::optional<TimePoint> next =
          earlier(earlier(plc.deadline(), session->deadline()), earlier(scan_done_at, result_at));
      if (!connected_ && !plc.faults.unplugged) next = earlier(next, reconnect_at_);
      if (!next || *next > end) break;
      now = std::max(now, *next);
      step();
    }
    now = end;
  }
  bool run_until(const std::function<bool()>& condition, Duration at_most = std::chrono::seconds(60)) {
    const TimePoint end = now + at_most;
    while (!condition() && now < end) run_for(std::chrono::milliseconds(10));
    return condition();
  }

  void cut_line() { disconnect(); }
  bool connected() const { return connected_; }

  TimePoint now{std::chrono::seconds(1000)};
  emulators::Plc plc;

 private:
  static emulators::PlcOptions in_role(emulators::PlcOptions options, const Options& cell) {
    options.cell_role = cell.role;
    return options;
  }
  bool is_client() const { return options_.role == LineRole::Client; }

  Options options_;
  std::uint16_t boot_count_ = 1;

 public:
  std::unique_ptr<Session> session;
  std::vector<std::uint16_t> accepted;               ///< Sequence numbers in order.
  std::map<std::uint16_t, std::uint16_t> published;  ///< Pick ids by sequence number, since the cell's start.
  unsigned aborted = 0, resets = 0, lost = 0, back = 0;
  std::optional<TimePoint> scan_done_at, result_at;
  PickResult next_result = Rig::pick(1);

 private:
  void disconnect() {
    if (!connected_) return;
    connected_ = false;
    is_client() ? session->on_disconnected(now) : session->on_closed(id_, now);
    plc.on_disconnected(now);
    reconnect_at_ = now + std::chrono::milliseconds(200);
  }

  void step() {
    if (!connected_ && !plc.faults.unplugged && now >= reconnect_at_) {
      connected_ = is_client() || session->on_accept(++id_, "192.168.0.10", 4000, now);
      if (connected_) {
        plc.on_connected(now);
        if (is_client()) session->on_connected(now);
      } else {
        reconnect_at_ = now + std::chrono::milliseconds(200);
      }
    }
    if (const auto at = plc.deadline(); at && *at <= now) plc.on_deadline(now);
    if (const auto at = session->deadline(); at && *at <= now) session->on_deadline(now);
    if (scan_done_at && *scan_done_at <= now) {
      scan_done_at.reset();
      session->on_scan_done(now);
      result_at = now + std::chrono::milliseconds(200);
    }
    if (result_at && *result_at <= now) {
      result_at.reset();
      published[running_] = next_result.pick_id;
      session->publish(next_result, now);
      ++next_result.pick_id;
    }
  }

  void settle() {
    if (plc.faults.unplugged) disconnect();
    bool any = true;
    while (any) {
      any = false;
      if (connected_) {
        if (const Bytes to_cell = plc.take_output(); !to_cell.empty()) {
          is_client() ? session->on_bytes(to_cell, now) : session->on_bytes(id_, to_cell, now);
          any = true;
        }
        const Bytes to_plc = is_client() ? session->take_output() : session->take_output(id_);
        if (!to_plc.empty()) plc.on_bytes(to_plc, now), any = true;
        const bool close = is_client() ? session->take_reopen() : session->wants_close(id_);
        if (close || plc.take_reopen()) disconnect(), any = true;
      }
      while (const auto event = session->take_event()) on(*event), any = true;
    }
  }

  void on(const Event& event) {
    if (const auto* request = std::get_if<RequestAccepted>(&event)) {
      accepted.push_back(request->request.sequence);
      running_ = request->request.sequence;
      scan_done_at = now + std::chrono::seconds(1);
      next_result.part_id = request->request.part_id;
    }
    if (std::holds_alternative<CycleAborted>(event) || std::holds_alternative<CycleTimedOut>(event)) {
      ++aborted;
      scan_done_at.reset();
      result_at.reset();
    }
    resets += std::holds_alternative<ResetRaised>(event);
    lost += std::holds_alternative<PlcLost>(event);
    back += std::holds_alternative<PlcBack>(event);
  }

  std::uint16_t running_ = 0;  // the last one accepted
  ConnectionId id_ = 0;
  bool connected_ = false;
  TimePoint reconnect_at_{};
};
}  // namespace binpick::plc::test
