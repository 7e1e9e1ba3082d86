#include <algorithm>

#include "base/check.hpp"
#include "base/log.hpp"
#include "base/overloaded.hpp"
#include "daemon/cell.hpp"

/// What the sessions say, as inputs of the cycle's table.
namespace binpick::daemon {
namespace {
plc::Alarm alarm_of(const drivers::pivot::Failed& failed) {
  using Why = drivers::pivot::Failed::Why;
  switch (failed.why) {
    case Why::NoReply:
      return plc::Alarm::PivotNoReply;
    case Why::BusDown:
      return plc::Alarm::PivotNoReply;
    case Why::BusOff:
      return plc::Alarm::PivotBusOff;
    case Why::ModuleError:
      return plc::Alarm::PivotModuleError;
    case Why::PowerFault:
      return plc::Alarm::PivotPowerFault;
    case Why::ReferenceFailed:
      return plc::Alarm::PivotReferenceFailed;
    case Why::MoveRefused:
      return plc::Alarm::PivotModuleError;
  }
  return plc::Alarm::PivotModuleError;
}

plc::Alarm alarm_of(const drivers::scanner::Failed& failed) {
  using Why = drivers::scanner::Failed::Why;
  switch (failed.why) {
    case Why::NoReply:
      return plc::Alarm::ScannerNoReply;
    case Why::BadTelegram:
      return plc::Alarm::ScannerBadTelegrams;
    case Why::Refused:
      return plc::Alarm::ScannerRefused;
    case Why::NoProfiles:
      return plc::Alarm::ScannerNoProfiles;
    case Why::LinkLost:
      return plc::Alarm::ScannerNoReply;
  }
  return plc::Alarm::ScannerNoReply;
}
}  // namespace

void Cell::on(const plc::Event& event, TimePoint now) {
  std::visit(Overloaded{
                 [&](const plc::RequestAccepted& accepted) {
                   if (stopping_) return;  // accepted in the turn of the loop that brought the stop
                   const auto& config = data_->config;
                   request_ = accepted.request;
                   const auto recipe = std::ranges::find(config.recipes, request_.part_id, &config::Recipe::id);
                   const auto supply = std::ranges::find(config.supplies, request_.supply_id, &config::Supply::id);
                   BINPICK_CHECK(recipe != config.recipes.end() && supply != config.supplies.end());
                   recipe_ = static_cast<std::size_t>(recipe - config.recipes.begin());
                   supply_ = static_cast<std::size_t>(supply - config.supplies.begin());
                   ++cycle_id_;
                   request_at_ = now;
                   begin_record();
                   robot_.withdraw(drivers::robot::NoPick::NotReady);
                   BINPICK_LOG(Info, "cell", "cycle %llu: request %u for part %u in supply %u",
                               static_cast<unsigned long long>(cycle_id_), request_.sequence, request_.part_id,
                               request_.supply_id);
                   if (request_.new_scan) memory_.forget(request_.supply_id);
                   if (memory_.next(place(), data_->config.picks, now)) {
                     plc_.on_scan_done(now);
                     return apply(CellInput::KnownRequest, now);
                   }
                   apply(CellInput::Request, now);
                   // A robot that carries the scanner is where it has to be.
                   if (plc_.robot_clear() || robot_carrier_) {
                     apply(CellInput::RobotClear, now);
                   } else {
                     BINPICK_LOG(Info, "cell", "cycle %llu waits: the robot is not clear of the view",
                                 static_cast<unsigned long long>(cycle_id_));
                   }
                 },
                 [&](const plc::CycleAborted&) {
                   BINPICK_LOG(Notice, "cell", "cycle %llu aborted by the PLC",
                               static_cast<unsigned long long>(cycle_id_));
                   apply(CellInput::Cancelled, now);
                 },
                 [&](const plc::AnswerWithdrawn&) { robot_.withdraw(drivers::robot::NoPick::NotReady); },
                 [&](const plc::CycleTimedOut&) {
                   const bool sweeps = sweep_.state() != drivers::sweep::State::Idle;
                   BINPICK_LOG(Warning, "cell", "cycle %llu took too long and is given up%s%s",
                               static_cast<unsigned long long>(cycle_id_), sweeps ? ": " : "",
                               sweeps ? carrier().overdue().c_str() : "");
                   apply(CellInput::Cancelled, now);
                 },
                 [&](const plc::ResetRaised&) { BINPICK_LOG(Notice, "cell", "reset by the PLC"); },
                 [&](const plc::ResultAcknowledged&) {},
                 [&](const plc::RobotClearChanged& changed) {
                   if (robot_carrier_) return;
                   if (!changed.clear) cycle_alarm_ = plc::Alarm::RobotNotClear;
                   apply(changed.clear ? CellInput::RobotClear : CellInput::RobotEntered, now);
                 },
                 [&](const plc::PlcLost&) {
                   BINPICK_LOG(Warning, "plc", "the PLC is gone; check its program and the network");
                   if (state_ == CellState::Idle) return;
                   stop_cycle(now);
                   state_ = CellState::Idle;
                   plc_.fault(plc::Alarm::PlcLost, now);
                   end_record({.alarm = plc::Alarm::PlcLost}, now);
                 },
                 [&](const plc::PlcBack&) { BINPICK_LOG(Notice, "plc", "the PLC is there"); },
             },
             event);
}

void Cell::on(const drivers::pivot::Event& event, TimePoint now) {
  if (const auto* ready = std::get_if<drivers::pivot::Ready>(&event)) {
    module_ = ready->module;
    BINPICK_LOG(Notice, "pivot", "ready: module %u, firmware %04x, serial %u, %.1f … %.1f deg, %.1f deg/s at most",
                started_with_.pivot.module_id, module_->firmware, module_->serial, module_->position_min.in_deg(),
                module_->position_max.in_deg(), Angle::rad(module_->velocity_max_rad_s).in_deg());
    alarm_off(pivot_trouble_, now);
  }
  if (const auto news = pivot_carrier_.on(event); news && !robot_carrier_) sweep_.on_carrier(*news, now);
  if (const auto* failed = std::get_if<drivers::pivot::Failed>(&event))
    device_failed(pivot_trouble_, {alarm_of(*failed), "pivot: " + failed->text}, now);
}

void Cell::on(const drivers::scanner::Event& event, TimePoint now) {
  if (const auto* ready = std::get_if<drivers::scanner::Ready>(&event)) {
    BINPICK_LOG(Notice, "scanner", "ready: %s", drivers::scanner::in_words(*ready).c_str());
    alarm_off(scanner_trouble_, now);
  }
  sweep_.on_scanner(event, now);
  if (const auto* failed = std::get_if<drivers::scanner::Failed>(&event))
    device_failed(scanner_trouble_, {alarm_of(*failed), "scanner: " + failed->text}, now);
}

void Cell::on(const drivers::robot::PoseEvent& event, TimePoint now) {
  if (const auto* ready = std::get_if<drivers::robot::PoseReady>(&event)) {
    BINPICK_LOG(Notice, "robot", "its poses come; their times are known within %.1f ms", in_ms(ready->uncertainty));
    alarm_off(poses_trouble_, now);
  }
  if (const auto news = robot_carrier_->on(event)) sweep_.on_carrier(*news, now);
  if (const auto* failed = std::get_if<drivers::robot::PoseFailed>(&event))
    device_failed(poses_trouble_, {plc::Alarm::RobotPosesLost, "robot: " + failed->text}, now);
}

void Cell::on(const drivers::robot::Event& event, TimePoint now) {
  if (robot_carrier_)
    if (const auto news = robot_carrier_->on(event)) sweep_.on_carrier(*news, now);
  std::visit(Overloaded{
                 [&](const drivers::robot::Connected&) {
                   BINPICK_LOG(Notice, "robot", "connected");
                   if (robot_lost_) plc_.clear(plc::Alarm::RobotLost, now);
                   robot_lost_ = false;
                 },
                 [&](const drivers::robot::Fetched& fetched) {
                   if (const auto from = std::exchange(unfetched_since_, std::nullopt);
                       from && fetched.pick_id == pick_id_)
                     BINPICK_LOG(Info, "robot", "pick %u fetched, %.0f ms after the last profile", fetched.pick_id,
                                 in_ms(now - *from));
                   else
                     BINPICK_LOG(Info, "robot", "pick %u fetched", fetched.pick_id);
                 },
                 [&](const drivers::robot::Reported& reported) {
                   BINPICK_LOG(Info, "robot", "pick %u %s", reported.pick_id, reported.done ? "done" : "failed");
                   memory_.on_report(reported.pick_id, reported.done, data_->config.picks);
                   // A late report must not take back the pick that was answered meanwhile.
                   if (reported.pick_id == pick_id_) robot_.withdraw(drivers::robot::NoPick::NotReady);
                 },
                 [&](const drivers::robot::Lost& lost) {
                   memory_.forget_scans();
                   BINPICK_LOG(Warning, "robot", "lost: %s; start the robot's program and check the network",
                               lost.text.c_str());
                   robot_lost_ = true;
                   plc_.raise(plc::Alarm::RobotLost, now);
                 },
                 [](const auto&) {},  // of the scan path: the carrier's
             },
             event);
}

void Cell::on(drivers::sweep::Event& event, TimePoint now) {
  std::visit(Overloaded{
                 [&](drivers::sweep::RegisteredProfile& registered) {
                   if (state_ != CellState::Sweeping) return;
                   picture_->add(registered);
                   if (record_) record_->scan->profiles.push_back(std::move(registered));
                 },
                 [&](const drivers::sweep::Done& done) {
                   sweep_done_ = done;
                   if (record_) record_->scan->figures = done;
                   if (done.profiles_lost > 0) {
                     BINPICK_LOG(Warning, "scanner",
                                 "%llu profiles lost in the sweep; check the network to the scanner",
                                 static_cast<unsigned long long>(done.profiles_lost));
                     plc_.raise(plc::Alarm::ScannerProfilesLost, now);
                   } else {
                     plc_.clear(plc::Alarm::ScannerProfilesLost, now);
                   }
                   if (done.profiles_without_pose > 0)
                     BINPICK_LOG(Warning, "cell",
                                 "cycle %llu: %zu profiles left out, where the scanner was is not known of them",
                                 static_cast<unsigned long long>(cycle_id_), done.profiles_without_pose);
                   apply(CellInput::SweepDone, now);
                 },
                 [&](const drivers::sweep::Failed& failed) {
                   using Device = drivers::sweep::Failed::Device;
                   const auto of = [](const std::optional<Trouble>& trouble, plc::Alarm otherwise) {
                     return trouble ? trouble->alarm : otherwise;
                   };
                   cycle_alarm_ = failed.device == Device::Poses
                                      ? (robot_carrier_ ? plc::Alarm::RobotPosesLost : plc::Alarm::PivotNoReply)
                                  : failed.device == Device::Carrier && robot_carrier_
                                      ? of(poses_trouble_, plc::Alarm::RobotPathBroken)
                                  : failed.device == Device::Carrier ? of(pivot_trouble_, plc::Alarm::PivotModuleError)
                                  : failed.device == Device::Scanner ? of(scanner_trouble_, plc::Alarm::ScannerNoReply)
                                  : robot_carrier_                   ? plc::Alarm::RobotPathBroken
                                                                     : plc::Alarm::ScanTimeout;
                   BINPICK_LOG(Warning, "cell", "cycle %llu: sweep failed: %s",
                               static_cast<unsigned long long>(cycle_id_), failed.text.c_str());
                   apply(CellInput::SweepFailed, now);
                 },
             },
             event);
}
}  // namespace binpick::daemon
