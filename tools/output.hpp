#pragma once

#include <string>

namespace binpick::tools {
/// Why a result could not be written there: what, where, what to do. Empty: it could, as far as one can tell without
/// writing. Asked before work that takes seconds or moves something.
std::string cannot_be_written(const std::string& path);
}  // namespace binpick::tools
