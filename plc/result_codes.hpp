#pragma once

#include <cstdint>
#include <span>
#include <string_view>

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

struct ResultText {
  ResultCode code;
  std::string_view name;
  std::string_view cause;
  std::string_view cure;
};
/// All codes in order; None is not among them.
std::span<const ResultText> result_table();
/// The name in result_table(); "none" for None, "unknown result code" for any other number.
std::string_view to_string(ResultCode code);

/// Why objects that were found cannot be taken, as the PLC reads it. Values never change.
enum class Unreachable : std::uint16_t {
  None = 0,
  NoGrasp = 1,
  Tilt = 2,
  Reach = 3,
  Wall = 4,
  GripperHitsPart = 5,
  Covered = 6,
  Floor = 7,
  Neighbour = 8,
  Unmeasured = 9,
};
struct UnreachableText {
  Unreachable reason;
  std::string_view name;
  std::string_view cure;
};
/// All reasons in order; None is not among them.
std::span<const UnreachableText> unreachable_table();
}  // namespace binpick::plc
