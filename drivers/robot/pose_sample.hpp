#pragma once

#include <string>
#include <variant>

#include "base/clock.hpp"
#include "base/frames.hpp"

/// Where the robot's flange is, as the robot tells it, and what else a source of such poses has to say. The same for
/// all makes (pose_source.hpp).
namespace binpick::drivers::robot {
struct PoseSample {
  TimePoint at;  ///< On our clock: when the robot measured it, but for the least delay of the network.
  Transform<frame::Base, frame::Flange> T_base_flange;
};

/// The robot's clock is known, and samples come from now on (of an arm without power: as soon as it has some).
struct PoseReady {
  Duration uncertainty{0};  ///< Of the samples' times; the least delay of the network is in addition.
};
/// The source is Offline again; where take_reopen says so the connection has to be closed.
struct PoseFailed {
  enum class Why {
    NoReply,       ///< A step of the handshake was not answered.
    BadTelegram,   ///< What came is not of this protocol.
    Refused,       ///< The controller answered, and the answer is no.
    Silent,        ///< Nothing understandable came for too long.
    ClockStopped,  ///< Poses come, but the robot's time stands still.
    ClockJumped,   ///< The robot's time does not fit the one that passed.
    LinkLost
  } why = Why::NoReply;
  std::string text;  ///< What, where, what to do.
};
using PoseEvent = std::variant<PoseReady, PoseSample, PoseFailed>;

enum class PoseState {
  Offline,
  Starting,  ///< Handshake, or the robot's clock is not known well enough yet: no samples.
  Streaming
};
}  // namespace binpick::drivers::robot
