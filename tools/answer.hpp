#pragma once

#include <string>

namespace binpick::tools {
/// What one device said to `binpick probe`.
struct Answer {
  bool good = false;
  std::string text;  ///< What it said, or what to do.
};
}  // namespace binpick::tools
