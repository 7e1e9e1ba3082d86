#include "daemon/spare_memory.hpp"

#include <cstdlib>
#include <cstring>
#include <fstream>
#include <gtest/gtest.h>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || !defined(__GLIBC__)
constexpr bool kOwnHeap = false;  // a sanitizer's, or another library's
#else
constexpr bool kOwnHeap = true;
#endif

namespace binpick::daemon {
namespace {
double own_mib() {
  std::ifstream status{"/proc/self/status"};
  for (std::string line; std::getline(status, line);)
    if (line.rfind("RssAnon:", 0) == 0) return std::stod(line.substr(8)) / 1024;
  return 0;
}

/// So much in small pieces, all of them written to, and again free.
void need(std::size_t mib) {
  constexpr std::size_t kPiece = 64 * 1024;
  std::vector<std::unique_ptr<char[]>> pieces;
  for (std::size_t i = 0; i < mib * 1024 * 1024 / kPiece; ++i) {
    pieces.emplace_back(new char[kPiece]);
    std::memset(pieces.back().get(), 1, kPiece);
  }
}

/// What stays of a scan that needed 24 MiB in a thread, in MiB.
double left_of_a_scan() {
  share_one_heap();
  // After a large piece the C library takes such from its heap, and lets that keep twice as much at its end.
  { const std::vector<char> large(std::size_t{16} << 20, 1); }
  const double before = own_mib();
  double most = 0;
  std::thread{[&] {
    need(24);
    most = own_mib();
    give_back_spare_memory();
  }}.join();
  return most < before + 20 ? 100 : own_mib() - before;  // 100: the C library does otherwise than this test expects
}
}  // namespace

TEST(SpareMemory, OfAScanInAThreadNothingStays) {
  if (!kOwnHeap) GTEST_SKIP() << "not the C library's own heap";
  GTEST_FLAG_SET(death_test_style, "threadsafe");  // a process of its own, in which no thread has been yet
  EXPECT_EXIT(std::exit(left_of_a_scan() < 2 ? 0 : 1), testing::ExitedWithCode(0), "");
}
}  // namespace binpick::daemon
