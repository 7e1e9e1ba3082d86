#include "vision/kernels.hpp"

#include <cstdlib>
#include <string_view>

#include "base/log.hpp"

namespace binpick::vision::kernels {
extern const Table kPortable;
#ifdef BINPICK_AVX2_KERNELS
extern const Table kAvx2;
#endif

namespace {
const Table& best() {
#ifdef BINPICK_AVX2_KERNELS
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return kAvx2;
#endif
  return kPortable;
}
}  // namespace

const Table& portable() { return kPortable; }

const Table& chosen(const char* loops) {
  if (loops == nullptr || *loops == 0) return best();
  if (loops == std::string_view{kPortable.name}) return kPortable;
  BINPICK_LOG(Warning, "vision", "BINPICK_LOOPS=%s is not known; portable is, or leave it away for the fastest", loops);
  return best();
}

const Table& table() {
  static const Table& loops = chosen(std::getenv("BINPICK_LOOPS"));
  return loops;
}
}  // namespace binpick::vision::kernels
