#include <cstdlib>
#include <string_view>

#include "vision/calibration/pose_list.hpp"

/// Any bytes as a list of poses: rows with rigid transforms, or a message.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  const auto list = binpick::vision::calibration::parse_pose_list(
      std::string_view(reinterpret_cast<const char*>(bytes), size), "poses.csv");
  if (!list) {
    if (!list.error().starts_with("poses.csv:")) std::abort();
    return 0;
  }
  if (list->rows.empty()) std::abort();
  for (const auto& row : list->rows)
    if (row.scan.empty() || !row.T_base_holder.matrix().allFinite() || !row.T_base_holder.linear().isUnitary(1e-6))
      std::abort();
  return 0;
}
