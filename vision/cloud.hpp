#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "base/expected.hpp"

namespace binpick::vision {
struct CloudError {
  std::string text;  ///< What, where, what to do.
};
/// PLY, ASCII or binary little-endian, vertices x y z (float or double), millimetres; other properties and elements are
/// skipped. Points that are not finite are dropped; a cloud without one finite point is an error.
Expected<std::vector<Eigen::Vector3f>, CloudError> load_cloud(const std::string& path);
/// The same for a file's bytes; `name` stands in the messages.
Expected<std::vector<Eigen::Vector3f>, CloudError> parse_cloud(std::span<const std::byte> bytes,
                                                               const std::string& name);
/// Binary little-endian PLY.
Expected<void, CloudError> save_cloud(const std::string& path, const std::vector<Eigen::Vector3f>& points_mm);
}  // namespace binpick::vision
