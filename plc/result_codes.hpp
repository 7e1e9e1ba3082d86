#pragma once

#include <cstdint>

namespace binpick::plc {
/// Result codes as the PLC reads them. Values never change. Cause and cure of each stand in result_table().
enum class ResultCode : std::uint16_t {
  None = 0,
  PickFound = 1,
  SupplyEmpty = 10,
  NothingFound = 11,
  NotReachable = 12,
  UnknownPart = 20,
  UnknownSupply = 21,
  BadSequence = 22,
  ControllerRestarted = 30,
  NotReady = 31,
  Aborted = 32,
  Fault = 40,
};
}  // namespace binpick::plc
