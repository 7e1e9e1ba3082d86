#include "vision/kernels.hpp"

#include <atomic>
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
  const Table* fast = find("avx2");
  return fast == nullptr ? kPortable : *fast;
}

std::atomic<const Table*>& current() {
  static std::atomic<const Table*> loops{&chosen(std::getenv("BINPICK_LOOPS"))};
  return loops;
}
}  // namespace

const Table& portable() { return kPortable; }

const Table* find(std::string_view name) {
#ifdef BINPICK_AVX2_KERNELS
  if (name == kAvx2.name) return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") ? &kAvx2 : nullptr;
#endif
  return name == kPortable.name ? &kPortable : nullptr;
}

const Table& chosen(const char* loops) {
  if (loops == nullptr || *loops == 0) return best();
  if (const Table* named = find(loops)) return *named;
  BINPICK_LOG(Warning, "vision", "BINPICK_LOOPS=%s is not known here; portable is, or leave it away for the fastest",
              loops);
  return best();
}

const Table& table() { return *current().load(std::memory_order_relaxed); }
void use(const Table& loops) { current().store(&loops, std::memory_order_relaxed); }
}  // namespace binpick::vision::kernels
