#pragma once

#include "tests/emulators/world/example_parts.hpp"

namespace binpick::emulators {
/// Gives the part its gripper and the ways it is taken: enough of them that standing, leaning and wall-near objects can
/// be reached too. By the part's name. The straight way in is short: on a tilted one the held object moves sideways,
/// and what leans on a wall would be pressed into it.
void add_gripper(ExamplePart& part);
}  // namespace binpick::emulators
