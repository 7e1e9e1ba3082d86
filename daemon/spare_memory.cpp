#include "daemon/spare_memory.hpp"

#include <cstdlib>  // __GLIBC__

#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace binpick::daemon {
void share_one_heap() {
#ifdef __GLIBC__
  mallopt(M_ARENA_MAX, 1);
#endif
}

void give_back_spare_memory() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}
}  // namespace binpick::daemon
