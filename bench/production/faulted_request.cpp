#include "bench/production/faulted_request.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>

namespace binpick::bench {
namespace {
using namespace std::chrono_literals;
using support::CyclePhase;
using support::DeviceFault;
using support::EmulatedCell;

constexpr Duration kResetEvery = 500ms;
constexpr Duration kSettled = 1s;     // what the PLC reads is some polls old
constexpr Duration kAnswerMax = 30s;  // scan and detection have 25 s by default
constexpr Duration kRobotMax = 20s;   // reconnects, goes there and back
constexpr Duration kIdleMax = 60s;    // a reference run of the pivot among it

DeviceFault chosen(const PlannedFault& planned) {
  std::vector<DeviceFault> of_device;
  for (const auto& faults : {support::standing_faults(), support::passing_faults()})
    for (const DeviceFault& fault : faults)
      if (fault.device == planned.device) of_device.push_back(fault);
  return of_device.at(static_cast<std::size_t>(planned.which * static_cast<double>(of_device.size())));
}

class FaultedRequest {
 public:
  FaultedRequest(EmulatedCell& cell, const PlannedFault& planned, Duration picking)
      : cell_{cell},
        planned_{planned},
        picking_{picking},
        fault_{chosen(planned)},
        lasts_{std::min(from_s(planned.lasts_s), fault_.lasts_max)} {
    answer_.fault.device = planned.device;
    answer_.fault.name = fault_.name;
    answer_.fault.phase = to_text(planned.phase);
    answer_.fault.lasted_s = in_s(lasts_);
  }

  FaultedAnswer run() {
    // What is left of earlier alarms is not this fault's.
    tend([&] { return cell_.plc.first_alarm() == plc::Alarm::None; }, kSettled);
    alarms_.clear();
    while (cell_.plc.take_result()) {
    }
    if (planned_.phase == CyclePhase::Ready) {
      inject();
      tend([] { return false; }, from_s(0.3 * planned_.where));
    } else if (planned_.phase < CyclePhase::ResultPending) {
      // There is a sweep only when the last one is too old.
      cell_.run_for(cell_.cell().data().config.picks.scan_valid + 1s);
    }
    tend([&] { return is_idle(); }, kIdleMax);
    const std::uint64_t reports = picks_reported();
    cell_.plc.raise_request();
    is_asked_ = true;
    if (planned_.phase != CyclePhase::Ready) {
      if (!support::reach(cell_, planned_.phase, kAnswerMax)) {
        answer_.fault.reached = false;
        healed_ = true;
      } else {
        cell_.run_for(from_s(planned_.where * length_s()));
        inject();
      }
    }
    const bool is_answered = tend([&] { return healed_ && this->is_answered(); }, lasts_ + kAnswerMax);
    const bool is_pick = answer_.result && answer_.result->code == plc::ResultCode::PickFound;
    tend([&] { return cell_.robot.clear_of_view() && (!is_pick || picks_reported() > reports); }, kRobotMax);
    const bool is_idle_again = tend([&] { return has_settled(); }, kIdleMax);
    auto& fault = answer_.fault;
    fault.handshake_lost = !is_answered || !is_idle_again;
    if (idle_since_ && fault.reached) fault.recovered_s = std::max(0.0, in_s(*idle_since_ - healed_at_));
    for (const plc::Alarm alarm : alarms_)
      fault.alarms += (fault.alarms.empty() ? "" : " ") + std::to_string(static_cast<int>(alarm));
    return std::move(answer_);
  }

 private:
  void inject() {
    fault_.set(cell_, true);
    heal_at_ = cell_.now() + lasts_;
  }

  std::uint64_t picks_reported() const { return cell_.robot.picks_done() + cell_.robot.picks_failed(); }

  /// How long the phase lasts, that the fault may come anywhere in it.
  double length_s() const {
    const auto& supply = cell_.cell().data().config.supplies.front();
    switch (planned_.phase) {
      case CyclePhase::Ready:
      case CyclePhase::ResultPending:
        return 0;
      case CyclePhase::Positioning:
        return 0.3;
      case CyclePhase::Sweeping:
        return std::abs((supply.sweep_end - supply.sweep_start).in_rad()) / supply.sweep_speed_rad_s;
      case CyclePhase::Detecting:
        return in_s(cell_.detection_time);
      case CyclePhase::Picking:
        return in_s(picking_);
    }
    return 0;
  }

  /// A request would be accepted, and none is under way.
  bool is_idle() const {
    const auto pending = static_cast<std::uint16_t>(plc::NotReady::ResultPending);
    return cell_.plc.connected() && cell_.plc.idle() && !cell_.plc.fault() &&
           (cell_.plc.ready() || cell_.plc.not_ready() == pending);
  }
  /// By a result or a fault; or it was forgotten by the PLC itself, or dropped.
  bool is_answered() const { return answer_.result || answer_.alarm || has_settled(); }
  bool has_settled() const { return idle_since_ && cell_.now() - *idle_since_ >= kSettled; }

  /// What the PLC's program does in each of its turns (resets, also what is past), and whoever heals the device.
  void take_turn() {
    const TimePoint now = cell_.now();
    if (heal_at_ && now >= *heal_at_) {
      fault_.set(cell_, false);
      heal_at_.reset();
      healed_ = true;
      healed_at_ = now;
    }
    if (is_asked_ && !answer_.result) answer_.result = cell_.plc.take_result();
    for (const plc::Alarm alarm : cell_.plc.alarms()) alarms_.insert(alarm);
    if (cell_.plc.fault() && is_asked_ && !answer_.result && !answer_.alarm) answer_.alarm = cell_.plc.first_alarm();
    const bool is_past = cell_.plc.first_alarm() != plc::Alarm::None && !cell_.plc.alarm_active();
    if ((cell_.plc.fault() || is_past) && now >= next_reset_) {
      cell_.plc.raise_reset();
      next_reset_ = now + kResetEvery;
    }
    if (!is_idle() || !healed_)
      idle_since_.reset();
    else if (!idle_since_)
      idle_since_ = now;
  }

  bool tend(const std::function<bool()>& done, Duration limit) {
    const TimePoint until = cell_.now() + limit;
    for (bool is_done = false;;) {
      const TimePoint next = heal_at_ ? std::min(*heal_at_, until) : until;
      cell_.run_until(
          [&] {
            take_turn();
            return (is_done = done());
          },
          std::max(next - cell_.now(), Duration{0}));
      if (is_done || cell_.now() >= until) return is_done;
    }
  }

  EmulatedCell& cell_;
  const PlannedFault& planned_;
  const Duration picking_;
  const DeviceFault fault_;
  const Duration lasts_;
  FaultedAnswer answer_;
  std::set<plc::Alarm> alarms_;  // that the PLC read
  bool is_asked_ = false, healed_ = false;
  std::optional<TimePoint> heal_at_, idle_since_;
  TimePoint healed_at_{}, next_reset_{};
};
}  // namespace

FaultedAnswer ask_with_fault(EmulatedCell& cell, const PlannedFault& planned, Duration picking) {
  return FaultedRequest{cell, planned, picking}.run();
}
}  // namespace binpick::bench
