#include "drivers/robot/pose_intake.hpp"

#include <algorithm>
#include <utility>

#include "base/log.hpp"

namespace binpick::drivers::robot {
namespace {
/// Events that nobody takes: the oldest sample goes first.
constexpr std::size_t kEventsMax = 4096;
}  // namespace

void PoseIntake::begin() {
  state_ = PoseState::Starting;
  is_first_ = true;
}

void PoseIntake::push(PoseEvent event) {
  if (events_.size() >= kEventsMax) {
    const auto oldest =
        std::ranges::find_if(events_, [](const PoseEvent& e) { return std::holds_alternative<PoseSample>(e); });
    events_.erase(oldest == events_.end() ? events_.begin() : oldest);
  }
  events_.push_back(std::move(event));
}

void PoseIntake::fail(PoseFailed::Why why, std::string text) {
  state_ = PoseState::Offline;
  push(PoseFailed{why, std::move(text)});
}

void PoseIntake::on_pose(double sender_s, const std::optional<Transform<frame::Base, frame::Flange>>& T_base_flange,
                         TimePoint now) {
  if (state_ == PoseState::Offline) return;
  const RemoteClock::Reading reading = clock_.add(sender_s, now);
  const bool is_first = std::exchange(is_first_, false);
  if (reading == RemoteClock::Reading::Stopped)
    return fail(PoseFailed::Why::ClockStopped,
                "poses come, but their time stamps stand still; check the program that sends them, or restart the "
                "robot's controller");
  if (reading == RemoteClock::Reading::Jumped) {
    if (!is_first)
      return fail(PoseFailed::Why::ClockJumped,
                  "the time stamps of the poses do not fit the time that passed; they are measured anew. If it comes "
                  "again, look for a clock that does not count in the unit that is sent, for a second program that "
                  "sends poses, or for a network that holds telegrams back for seconds");
    BINPICK_LOG(Notice, "robot", "the robot's clock began anew");
  }
  if (reading == RemoteClock::Reading::Repeated) return;
  if (state_ == PoseState::Starting && clock_.settled()) {
    state_ = PoseState::Streaming;
    push(PoseReady{clock_.uncertainty().value_or(Duration{0})});
  }
  if (state_ == PoseState::Streaming && T_base_flange) push(PoseSample{clock_.at(sender_s), *T_base_flange});
}

std::optional<PoseEvent> PoseIntake::take_event() {
  if (events_.empty()) return std::nullopt;
  PoseEvent event = std::move(events_.front());
  events_.pop_front();
  return event;
}
}  // namespace binpick::drivers::robot
