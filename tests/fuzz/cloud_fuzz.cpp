#include <cstdlib>
#include <span>

#include "vision/cloud.hpp"

/// Any bytes as a PLY file: points that are all finite, or a message.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  const auto cloud = binpick::vision::parse_cloud(std::as_bytes(std::span(bytes, size)), "fuzz.ply");
  if (!cloud) {
    if (cloud.error().text.empty()) std::abort();
    return 0;
  }
  if (cloud->empty()) std::abort();
  for (const auto& point : *cloud)
    if (!point.allFinite()) std::abort();
  return 0;
}
