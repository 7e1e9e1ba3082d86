#pragma once

#include <cstdint>
#include <variant>

#include "base/frames.hpp"
#include "plc/result_codes.hpp"

/// What the cell hears from the PLC, and what it answers.
namespace binpick::plc {
struct PickRequest {
  std::uint16_t sequence = 0;  ///< 1 … 65535.
  std::uint16_t part_id = 0;
  std::uint16_t supply_id = 0;
  bool new_scan = false;  ///< What is known of the supply does not hold any more.
};

/// How the cycle went, in numbers; they stand in the result block for whoever wants to draw them.
struct CycleFigures {
  std::uint16_t sweep_ms = 0;
  std::uint16_t profiles = 0;
  std::uint32_t points = 0;
  std::uint32_t hypotheses = 0;
  std::uint16_t detection_ms = 0;
};

struct PickResult {
  ResultCode code = ResultCode::None;
  std::uint16_t pick_id = 0;
  std::uint16_t part_id = 0;
  std::uint16_t objects_left = 0;  ///< Found and not yet picked, this one not counted.
  std::uint16_t fill_level_percent = 0;
  Unreachable unreachable = Unreachable::None;  ///< With NotReachable: of most objects.
  double score = 0;                             ///< 0 … 1.
  Transform<frame::Base, frame::Tcp> T_base_approach;
  Transform<frame::Base, frame::Tcp> T_base_grasp;
  Transform<frame::Base, frame::Tcp> T_base_retreat;  ///< Turned as at the grasp.
  CycleFigures figures;
};

/// Bits of the not-ready word: why `ready` is 0.
enum class NotReady : std::uint16_t {
  Pivot = 1 << 0,
  Scanner = 1 << 1,
  Robot = 1 << 2,
  Vision = 1 << 3,
  Configuration = 1 << 4,
  Alarm = 1 << 5,
  CycleRunning = 1 << 6,
  ResultPending = 1 << 7,
  Starting = 1 << 8,
  Stopping = 1 << 9,
};

struct RequestAccepted {
  PickRequest request;
};                          ///< Start a cycle for it.
struct CycleAborted {};     ///< Abort by the PLC: stop what moves, forget the cycle.
struct AnswerWithdrawn {};  ///< Abort by the PLC, no cycle running: what was answered last is not wanted any more.
struct CycleTimedOut {};    ///< The handshake's own deadline passed: same, and a fault stands.
struct ResetRaised {};      ///< The PLC wants to go on after a fault: try the devices again.
struct ResultAcknowledged {
  std::uint16_t sequence;
};
struct RobotClearChanged {
  bool clear;
};
struct PlcLost {};  ///< No connection, or its heartbeat stopped.
struct PlcBack {};
using Event = std::variant<RequestAccepted, CycleAborted, AnswerWithdrawn, CycleTimedOut, ResetRaised,
                           ResultAcknowledged, RobotClearChanged, PlcLost, PlcBack>;
}  // namespace binpick::plc
