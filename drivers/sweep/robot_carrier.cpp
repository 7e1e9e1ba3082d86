#include "drivers/sweep/robot_carrier.hpp"

#include "base/overloaded.hpp"

namespace binpick::drivers::sweep {
namespace {
using News = std::optional<CarrierNews>;
using Kind = CarrierNews::Kind;
}  // namespace

News RobotCarrier::on(const robot::Event& event) {
  return std::visit(Overloaded{
                        [](const robot::PathBegun&) -> News {
                          return CarrierNews{Kind::Arrived, {}};
                        },
                        [this](const robot::PathEnded&) -> News {
                          under_way_ = false;
                          return CarrierNews{Kind::Arrived, {}};
                        },
                        [this](const robot::PathBroken&) -> News {
                          under_way_ = false;
                          const std::string why = poses_.trouble();
                          return CarrierNews{Kind::Failed,
                                             "the robot broke its scan path off" +
                                                 (why.empty() ? "" : " (" + why + ")") +
                                                 "; clear its stop, move it out of the bin and start its program"};
                        },
                        [this](const robot::Lost& lost) -> News {
                          if (!under_way_) return std::nullopt;
                          return CarrierNews{Kind::Failed, "the robot was lost on its scan path: " + lost.text +
                                                               "; move it out of the bin and start its program"};
                        },
                        [](const auto&) -> News { return std::nullopt; },
                    },
                    event);
}

News RobotCarrier::on(const robot::PoseEvent& event) {
  return std::visit(Overloaded{
                        [](const robot::PoseReady&) -> News { return std::nullopt; },
                        [this](const robot::PoseSample& sample) -> News {
                          track_.add({sample.at - latency_, sample.T_base_flange});
                          return CarrierNews{Kind::Moved, {}};
                        },
                        [this](const robot::PoseFailed& failed) -> News {
                          track_.clear();
                          return CarrierNews{Kind::Failed, failed.text};
                        },
                    },
                    event);
}

std::optional<std::string> RobotCarrier::plan(const Motion& motion) {
  path_ = std::get<RobotPath>(motion);
  if (!robot_.connected()) return "the robot is not connected, so it cannot carry the scanner; start its program";
  if (poses_.state() != robot::PoseState::Streaming)
    return "the robot's poses do not come, so its scan could not be placed; check [robot] pose_address or pose_listen";
  return std::nullopt;
}

void RobotCarrier::go_to_start(TimePoint) {
  scan_ = scan_ == 65535 ? 1 : static_cast<std::uint16_t>(scan_ + 1);
  under_way_ = true;
  robot_.ask_path(scan_, path_.number);
}

void RobotCarrier::go_to_end(TimePoint) { robot_.let_go(); }

void RobotCarrier::stop(TimePoint) {
  under_way_ = false;
  robot_.forget_path();
}

std::string RobotCarrier::overdue() const {
  const std::string why = poses_.trouble();
  return "the robot did not come to the end of its scan path in time" + (why.empty() ? "" : " (" + why + ")") +
         "; look for a stop on its panel, or allow the path more time with path_timeout_ms of the supply";
}

std::optional<CarrierPose> RobotCarrier::at(TimePoint at) const {
  if (const auto pose = track_.at(at)) return *pose;
  return std::nullopt;
}
}  // namespace binpick::drivers::sweep
