#include "vision/kernels.hpp"

namespace binpick::vision::kernels {
extern const Table kPortable;
#ifdef BINPICK_AVX2_KERNELS
extern const Table kAvx2;
#endif

const Table& portable() { return kPortable; }

const Table& table() {
#ifdef BINPICK_AVX2_KERNELS
  static const Table& best = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") ? kAvx2 : kPortable;
  return best;
#else
  return kPortable;
#endif
}
}  // namespace binpick::vision::kernels
