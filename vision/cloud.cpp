#include "vision/cloud.hpp"

#include <algorithm>
#include <cstring>

#include "vision/file.hpp"
#include "vision/ply.hpp"

namespace binpick::vision {
using Points = std::vector<Eigen::Vector3f>;

Expected<Points, CloudError> parse_cloud(std::span<const std::byte> bytes, const std::string& name) {
  const auto failed = [&](const std::string& why) { return unexpected(CloudError{"cloud " + name + ": " + why}); };
  if (bytes.empty()) return failed("the file is empty; scan or save it again");
  auto ply = parse_ply(bytes, false);
  if (!ply) return failed(ply.error());
  Points& points = ply->vertices;
  const std::size_t said = points.size();
  if (said == 0) return failed("holds no point; scan again");
  std::erase_if(points, [](const Eigen::Vector3f& p) { return !p.allFinite(); });
  if (points.empty()) return failed("holds " + std::to_string(said) + " points, none of them finite; scan again");
  return std::move(points);
}

Expected<Points, CloudError> load_cloud(const std::string& path) {
  const auto bytes = read_file(path);
  if (!bytes) return unexpected(CloudError{"cloud: " + bytes.error()});
  return parse_cloud(*bytes, path);
}

Expected<void, CloudError> save_cloud(const std::string& path, const Points& points_mm) {
  const std::string header =
      "ply\nformat binary_little_endian 1.0\ncomment millimetres, supply frame\nelement vertex " +
      std::to_string(points_mm.size()) + "\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
  std::vector<std::byte> bytes(header.size() + 12 * points_mm.size());
  std::memcpy(bytes.data(), header.data(), header.size());
  std::byte* out = bytes.data() + header.size();
  for (const Eigen::Vector3f& point : points_mm) {
    std::memcpy(out, point.data(), 12);
    out += 12;
  }
  if (const auto written = write_file(path, bytes); !written)
    return unexpected(CloudError{"cloud: " + written.error()});
  return {};
}
}  // namespace binpick::vision
