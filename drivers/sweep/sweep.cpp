#include "drivers/sweep/sweep.hpp"

#include "base/overloaded.hpp"

namespace binpick::drivers::sweep {
namespace {
/// After the carrier stands: the scanner says goodbye, and one more pose of the carrier arrives.
constexpr Duration kDrainMax = std::chrono::milliseconds(300);
/// A scanner that says no goodbye has still measured the whole sweep when its last profile is not older than this at
/// the carrier's end. Else it fell silent before, for too short a time to be missed while measuring.
constexpr Duration kLastProfileAge = std::chrono::milliseconds(50);
constexpr std::size_t kWaitingMax = 2000;  // 4 s of profiles at the highest rate
/// Of the profiles of a sweep. What is left out is a strip of the supply that looks empty.
constexpr double kWithoutPoseMax = 0.1;
}  // namespace

void Sweep::begin(const Plan& plan, TimePoint now) {
  plan_ = plan;
  waiting_.clear();
  events_.clear();
  done_ = {};
  failure_ = {};
  move_began_.reset();
  move_ended_.reset();
  last_profile_at_.reset();
  if (const auto refusal = carrier_.plan(plan_.motion)) {
    events_.emplace_back(Failed{Failed::Device::Carrier, *refusal});
    return;
  }
  apply(Input::Begin, now);
}

void Sweep::abort(TimePoint now) { apply(Input::Abort, now); }

void Sweep::on_carrier(const CarrierNews& news, TimePoint now) {
  switch (news.kind) {
    case CarrierNews::Kind::Moved:
      hand_out_profiles();
      return finish_drained(now);
    case CarrierNews::Kind::Arrived:
      if (state_ == State::Sweeping) move_ended_ = now;
      return apply(state_ == State::Sweeping ? Input::AtEnd : Input::AtStart, now);
    case CarrierNews::Kind::Failed:
      failure_ = {Failed::Device::Carrier, news.text};
      return apply(Input::DeviceFailed, now);
  }
}

void Sweep::on_scanner(const scanner::Event& event, TimePoint now) {
  std::visit(Overloaded{
                 [&](const scanner::Ready&) {},
                 [&](const scanner::ProfileReceived& received) {
                   apply(Input::FirstProfile, now);
                   if (state_ != State::Sweeping && state_ != State::Draining) return;
                   last_profile_at_ = received.profile.measured_at;
                   waiting_.push_back(received.profile);
                   if (waiting_.size() > kWaitingMax) {
                     waiting_.pop_front();
                     ++done_.profiles_without_pose;
                   }
                   hand_out_profiles();
                 },
                 [&](const scanner::Stopped&) {
                   scanner_stopped_ = true;
                   hand_out_profiles();
                   finish_drained(now);
                 },
                 [&](const scanner::Failed& failed) {
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
  failure_ = {Failed::Device::None, carrier_.overdue()};
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
      deadline_ = now + carrier_.prepare_max();
      carrier_.go_to_start(now);
      scanner_.start_measuring(now);
      break;
    case Effect::MoveToEnd:
      deadline_ = now + carrier_.path_max();
      move_began_ = now;
      carrier_.go_to_end(now);
      break;
    case Effect::StopScanner:
      deadline_ = now + kDrainMax;
      scanner_stopped_ = false;  // what it said before is of an earlier sweep
      scanner_.stop_measuring(now);
      break;
    case Effect::Finish:
      deadline_.reset();
      done_.duration = *move_ended_ - *move_began_;
      done_.profiles_lost = scanner_.profiles_lost();
      report_end();
      break;
    case Effect::StopAndFail:
    case Effect::StopQuietly:
      deadline_.reset();
      waiting_.clear();
      carrier_.stop(now);
      if (scanner_.state() == scanner::State::Measuring) scanner_.stop_measuring(now);
      if (row->effect == Effect::StopAndFail) events_.emplace_back(failure_);
      break;
  }
}

/// The carrier's poses may come later than the scanner's goodbye.
void Sweep::finish_drained(TimePoint now) {
  if (state_ == State::Draining && scanner_stopped_ && !waits_for_pose()) apply(Input::ScannerStopped, now);
}

bool Sweep::waits_for_pose() const {
  return !waiting_.empty() && waiting_.front().measured_at - plan_.scanner_latency <= *move_ended_;
}

void Sweep::report_end() {
  for (; waits_for_pose(); waiting_.pop_front()) ++done_.profiles_without_pose;
  waiting_.clear();
  const std::size_t measured = done_.profiles + done_.profiles_without_pose;
  if (measured == 0) {
    events_.emplace_back(Failed{Failed::Device::Scanner,
                                "no profile was measured while the scanner was moved; check the latency_ms of scanner "
                                "and carrier, and that the scanner keeps measuring"});
  } else if (static_cast<double>(done_.profiles_without_pose) > kWithoutPoseMax * static_cast<double>(measured)) {
    events_.emplace_back(Failed{Failed::Device::Poses,
                                "where the scanner was is not known of " + std::to_string(done_.profiles_without_pose) +
                                    " of the sweep's " + std::to_string(measured) +
                                    " profiles; check the network or bus to what carries it, and the latency_ms of "
                                    "both"});
  } else {
    events_.emplace_back(done_);
  }
}

void Sweep::hand_out_profiles() {
  while (!waiting_.empty()) {
    const TimePoint at = waiting_.front().measured_at - plan_.scanner_latency;
    const auto newest = carrier_.newest();
    if (!newest || *newest < at) return;
    // Before the move the carrier stood at the start and after it at the end: those profiles repeat one line.
    const bool in_sweep = at >= *move_began_ && (!move_ended_ || at <= *move_ended_);
    if (in_sweep) {
      if (const auto pose = carrier_.at(at)) {
        ++done_.profiles;
        events_.emplace_back(RegisteredProfile{std::move(waiting_.front()), *pose});
      } else {
        ++done_.profiles_without_pose;
      }
    }
    waiting_.pop_front();
  }
}
}  // namespace binpick::drivers::sweep
