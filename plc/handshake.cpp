#include "plc/handshake.hpp"

namespace binpick::plc {
std::string_view to_string(State state) {
  switch (state) {
    case State::NotReady:
      return "NotReady";
    case State::Ready:
      return "Ready";
    case State::Scanning:
      return "Scanning";
    case State::Detecting:
      return "Detecting";
    case State::ResultValid:
      return "ResultValid";
    case State::Fault:
      return "Fault";
  }
  return "?";
}

std::string_view to_string(Signal signal) {
  switch (signal) {
    case Signal::DevicesReady:
      return "DevicesReady";
    case Signal::DevicesMissing:
      return "DevicesMissing";
    case Signal::NewRequest:
      return "NewRequest";
    case Signal::BadRequest:
      return "BadRequest";
    case Signal::RepeatedRequest:
      return "RepeatedRequest";
    case Signal::StandingRequest:
      return "StandingRequest";
    case Signal::RequestDropped:
      return "RequestDropped";
    case Signal::ScanComplete:
      return "ScanComplete";
    case Signal::DetectionDone:
      return "DetectionDone";
    case Signal::ResultAcked:
      return "ResultAcked";
    case Signal::AbortRaised:
      return "AbortRaised";
    case Signal::ResetRaised:
      return "ResetRaised";
    case Signal::FaultRaised:
      return "FaultRaised";
    case Signal::Deadline:
      return "Deadline";
  }
  return "?";
}

std::string_view to_string(Effect effect) {
  switch (effect) {
    case Effect::None:
      return "None";
    case Effect::AcceptAndScan:
      return "AcceptAndScan";
    case Effect::Refuse:
      return "Refuse";
    case Effect::RefuseNotReady:
      return "RefuseNotReady";
    case Effect::RepeatResult:
      return "RepeatResult";
    case Effect::AckAgain:
      return "AckAgain";
    case Effect::DropAck:
      return "DropAck";
    case Effect::StartDetection:
      return "StartDetection";
    case Effect::PublishResult:
      return "PublishResult";
    case Effect::ClearResult:
      return "ClearResult";
    case Effect::StopAndClear:
      return "StopAndClear";
    case Effect::RaiseFault:
      return "RaiseFault";
    case Effect::TimeOut:
      return "TimeOut";
    case Effect::ClearFault:
      return "ClearFault";
  }
  return "?";
}
}  // namespace binpick::plc
