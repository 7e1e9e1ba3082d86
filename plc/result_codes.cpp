#include "plc/result_codes.hpp"

#include <algorithm>
#include <array>

namespace binpick::plc {
namespace {
constexpr std::array kResults{
    ResultText{ResultCode::PickFound, "pick found", "An object was found and the gripper can reach it.",
               "Take approach and grasp pose, or let the robot fetch the pick of this pick_id."},
    ResultText{ResultCode::SupplyEmpty, "supply empty", "The scan shows the floor of the supply and nothing on it.",
               "Exchange the supply."},
    ResultText{ResultCode::NothingFound, "nothing found",
               "Something lies in the supply, but no object of this part was recognised.",
               "Check that the right part is in the supply, and little else; stir or tilt it, then request again."},
    ResultText{ResultCode::NotReachable, "found but not reachable",
               "Objects were found, but each grasp is too steep, too far away, or hits something; unreachable_reason "
               "tells what.",
               "Stir the supply, then request again; the table of reasons says what to look at if it happens often."},
    ResultText{ResultCode::UnknownPart, "unknown part", "No [[part]] of the cell file has this id.",
               "Correct part_id in the PLC, or add the recipe to the cell file and reload."},
    ResultText{ResultCode::UnknownSupply, "unknown supply", "No [[supply]] of the cell file has this id.",
               "Correct supply_id in the PLC, or add the supply to the cell file and reload."},
    ResultText{ResultCode::BadSequence, "bad sequence",
               "The sequence number of the last accepted request came again with another part or supply.",
               "Count sequence up for every new request; only a retry of the very same request keeps its number."},
    ResultText{ResultCode::ControllerRestarted, "controller restarted",
               "The request already stood when the cell controller came up; it was not carried out.",
               "Set request to 0, then request again with a new sequence number."},
    ResultText{ResultCode::NotReady, "not ready",
               "The cell cannot start a cycle now; not_ready tells why. The sequence number is not used up.",
               "Wait for the status bit ready, then request again."},
    ResultText{ResultCode::Aborted, "aborted",
               "The PLC raised abort during this request's cycle, or requested while abort was still raised.",
               "Set abort to 0, then request with a new sequence number."},
    ResultText{ResultCode::Fault, "ended by a fault",
               "A fault ended this request's cycle. Seen only when the same sequence number is requested again.",
               "Read first_alarm, remove its cause, raise reset, request with a new sequence number."},
};
static_assert(std::ranges::is_sorted(kResults, {}, &ResultText::code));

constexpr std::array kUnreachable{
    UnreachableText{Unreachable::NoGrasp, "no grasp", "Add a [[grasp]] to the part file."},
    UnreachableText{Unreachable::Tilt, "too steep",
                    "Stir the supply; check reach.tilt_max_deg, add grasps from other "
                    "sides."},
    UnreachableText{Unreachable::Reach, "out of the robot's reach",
                    "Put the supply nearer; check reach.radius_max_mm and reach.axis_min_mm."},
    UnreachableText{Unreachable::Wall, "wall in the way",
                    "Objects lie in corners: stir the supply; check its size and place, and reach.wall_clearance_mm."},
    UnreachableText{Unreachable::GripperHitsPart, "gripper hits the part itself",
                    "The part file is wrong: correct opening_mm, T_object_tcp or the gripper's geometry."},
    UnreachableText{Unreachable::Covered, "something lies on it", "Stir the supply."},
    UnreachableText{Unreachable::Floor, "floor in the way",
                    "Check the height of T_base_supply; add grasps that reach less deep."},
    UnreachableText{Unreachable::Neighbour, "neighbour in the way",
                    "Stir the supply; add grasps, or check reach.clearance_mm."},
    UnreachableText{Unreachable::Unmeasured, "nothing was measured beside it",
                    "Clean the scanner, or scan from another side; check reach.unmeasured."},
};
static_assert(std::ranges::is_sorted(kUnreachable, {}, &UnreachableText::reason));
}  // namespace

std::span<const ResultText> result_table() { return kResults; }
std::span<const UnreachableText> unreachable_table() { return kUnreachable; }

std::string_view to_string(ResultCode code) {
  if (code == ResultCode::None) return "none";
  const auto* text = std::ranges::find(kResults, code, &ResultText::code);
  return text == kResults.end() ? "unknown result code" : text->name;
}
}  // namespace binpick::plc
