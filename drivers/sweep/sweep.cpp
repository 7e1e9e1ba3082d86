#include "drivers/sweep/sweep.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "base/overloaded.hpp"

namespace binpick::drivers::sweep {
namespace {
/// The scanner's spin-up may take seconds after a change of frequency; the pivot's drive to the start as well.
constexpr Duration kPrepareMax = std::chrono::seconds(12);
/// After the pivot stands: the scanner says goodbye, and one more pivot sample arrives.
constexpr Duration kDrainMax = std::chrono::milliseconds(300);
/// A scanner that says no goodbye has still measured the whole sweep when its last profile is not older than this at
/// the pivot's end. Else it fell silent before, for too short a time to be missed while measuring.
constexpr Duration kLastProfileAge = std::chrono::milliseconds(50);
/// Allowed on top of the time that the plan itself takes.
constexpr Duration kSweepSlack = std::chrono::seconds(2);
constexpr std::size_t kWaitingMax = 2000;  // 4 s of profiles at the highest rate

}  // namespace

void Sweep::begin(const Plan& plan, TimePoint now) {
  plan_ = plan;
  if (const auto newest = track_.newest()) {
    // The way back is as good as the way there: start where the pivot is.
    const Angle here = *track_.at(*newest);
    if (std::abs((here - plan.end).in_rad()) < std::abs((here - plan.start).in_rad()))
      std::swap(plan_.start, plan_.end);
  }
  waiting_.clear();
  events_.clear();
  done_ = {};
  failure_ = {Failed::Device::None, "the sweep did not come to its end in time"};
  move_began_.reset();
  move_ended_.reset();
  last_profile_at_.reset();
  if (const auto beyond = beyond_limits()) {
    events_.emplace_back(Failed{Failed::Device::Pivot, *beyond});
    return;
  }
  apply(Input::Begin, now);
}

/// A sweep that the module would cut short measures less than the supply, and nobody would know.
std::optional<std::string> Sweep::beyond_limits() const {
  const auto module = pivot_.module();
  if (!module) return std::nullopt;
  const auto [low, high] = std::minmax({plan_.start.in_deg(), plan_.end.in_deg()});
  if (low >= module->position_min.in_deg() && high <= module->position_max.in_deg()) return std::nullopt;
  std::array<char, 200> text{};
  std::snprintf(text.data(), text.size(),
                "the sweep from %.1f to %.1f deg leaves the pivot module's limits of %.1f to %.1f deg; correct "
                "sweep_start_deg and sweep_end_deg, or the module's limits",
                low, high, module->position_min.in_deg(), module->position_max.in_deg());
  return text.data();
}

void Sweep::abort(TimePoint now) { apply(Input::Abort, now); }

void Sweep::on_pivot(const pivot::Event& event, TimePoint now) {
  std::visit(Overloaded{
                 [&](const pivot::Ready&) {},
                 [&](const pivot::Sample& sample) {
                   track_.add(sample.at - plan_.pivot_latency, sample.angle);
                   hand_out_profiles();
                 },
                 [&](const pivot::MoveDone&) {
                   if (state_ == State::Sweeping) move_ended_ = now;
                   apply(state_ == State::Sweeping ? Input::AtEnd : Input::AtStart, now);
                 },
                 [&](const pivot::Failed& failed) {
                   failure_ = {Failed::Device::Pivot, failed.text};
                   apply(Input::DeviceFailed, now);
                   track_.clear();
                 },
             },
             event);
}

void Sweep::on_scanner(const lms400::Event& event, TimePoint now) {
  std::visit(Overloaded{
                 [&](const lms400::Ready&) {},
                 [&](const lms400::ProfileReceived& received) {
                   apply(Input::FirstProfile, now);
                   if (state_ != State::Sweeping && state_ != State::Draining) return;
                   last_profile_at_ = received.profile.measured_at;
                   waiting_.push_back(received.profile);
                   if (waiting_.size() > kWaitingMax) {
                     waiting_.pop_front();
                     ++done_.profiles_without_angle;
                   }
                   hand_out_profiles();
                 },
                 [&](const lms400::Stopped&) {
                   hand_out_profiles();
                   apply(Input::ScannerStopped, now);
                 },
                 [&](const lms400::Failed& failed) {
                   failure_ = {Failed::Device::Scanner, failed.text};
                   apply(Input::DeviceFailed, now);
                 },
             },
             event);
}

void Sweep::on_deadline(TimePoint now) {
  if (!deadline_ || now < *deadline_) return;
  if (state_ == State::Draining && (!last_profile_at_ || *last_profile_at_ < *move_ended_ - kLastProfileAge)) {
    failure_ = {Failed::Device::Scanner,
                "the scanner fell silent before the end of the sweep; check its power and cable"};
    apply(Input::DeviceFailed, now);
    return;
  }
  apply(Input::Deadline, now);
}

std::optional<Event> Sweep::take_event() {
  if (events_.empty()) return std::nullopt;
  Event event = std::move(events_.front());
  events_.pop_front();
  return event;
}

void Sweep::apply(Input input, TimePoint now) {
  const Row* row = find_row(kRows, state_, input);
  if (row == nullptr) return;
  state_ = row->to;
  switch (row->effect) {
    case Effect::None:
      break;
    case Effect::MoveToStartAndMeasure:
      deadline_ = now + kPrepareMax;
      pivot_.move_to(plan_.start, plan_.positioning_speed_rad_s, now);
      scanner_.start_measuring(now);
      break;
    case Effect::MoveToEnd: {
      const double seconds = std::abs((plan_.end - plan_.start).in_rad()) / plan_.speed_rad_s;
      deadline_ = now + from_s(1.5 * seconds) + kSweepSlack;
      move_began_ = now;
      pivot_.move_to(plan_.end, plan_.speed_rad_s, now);
      break;
    }
    case Effect::StopScanner:
      deadline_ = now + kDrainMax;
      scanner_.stop_measuring(now);
      break;
    case Effect::Finish:
      deadline_.reset();
      done_.duration = *move_ended_ - *move_began_;
      done_.profiles_lost = scanner_.profiles_lost();
      done_.profiles_without_angle += waiting_.size();
      waiting_.clear();
      if (done_.profiles > 0)
        events_.emplace_back(done_);
      else
        events_.emplace_back(Failed{Failed::Device::Scanner,
                                    "no profile was measured while the pivot moved; check scanner latency_ms and pivot "
                                    "latency_ms, and that the scanner keeps measuring"});
      break;
    case Effect::StopAndFail:
    case Effect::StopQuietly:
      deadline_.reset();
      waiting_.clear();
      pivot_.stop(now);
      if (scanner_.state() == lms400::Session::State::Measuring) scanner_.stop_measuring(now);
      if (row->effect == Effect::StopAndFail) events_.emplace_back(failure_);
      break;
  }
}

void Sweep::hand_out_profiles() {
  while (!waiting_.empty()) {
    const TimePoint at = waiting_.front().measured_at - plan_.scanner_latency;
    const auto newest = track_.newest();
    if (!newest || *newest < at) return;
    // Before the move the pivot stood at the start and after it at the end: those profiles repeat one line.
    const bool in_sweep = at >= *move_began_ && (!move_ended_ || at <= *move_ended_);
    if (in_sweep) {
      if (const auto angle = track_.at(at)) {
        ++done_.profiles;
        events_.emplace_back(RegisteredProfile{std::move(waiting_.front()), *angle});
      } else {
        ++done_.profiles_without_angle;
      }
    }
    waiting_.pop_front();
  }
}
}  // namespace binpick::drivers::sweep
