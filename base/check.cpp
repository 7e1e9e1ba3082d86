#include "base/check.hpp"

#include <cstdlib>

#include "base/log.hpp"

namespace binpick {
void check_failed(const char* condition, const char* file, int line) {
  BINPICK_LOG(Error, "check", "%s:%d: %s does not hold; this is an error of the program, please report it", file, line,
              condition);
  std::abort();
}
}  // namespace binpick
