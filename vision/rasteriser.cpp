#include "vision/rasteriser.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace binpick::vision {
namespace {
constexpr float kNothing = std::numeric_limits<float>::quiet_NaN();
/// A template larger than this is a pose far out of any supply, or a pixel far too small.
constexpr float kTemplatePixelsMax = 4096;

class ScanLineRenderer final : public DepthRenderer {
 public:
  explicit ScanLineRenderer(const Mesh& mesh) : rasteriser_{mesh} {}
  void render(const Eigen::Isometry3d& T_supply_object, DepthImage& image) override {
    rasteriser_.draw(T_supply_object.linear().cast<float>(), T_supply_object.translation().cast<float>(),
                     image.pixel_mm, image.origin_mm, drawn_);
    image.z_mm.setConstant(kNothing);
    for (int r = std::max(0, -drawn_.row0); r < drawn_.rows && r + drawn_.row0 < image.z_mm.rows(); ++r)
      for (int c = std::max(0, -drawn_.col0); c < drawn_.cols && c + drawn_.col0 < image.z_mm.cols(); ++c)
        image.z_mm(r + drawn_.row0, c + drawn_.col0) = drawn_.top_mm[drawn_.at(r, c)];
  }

 private:
  Rasteriser rasteriser_;
  Template drawn_;
};
}  // namespace

Rasteriser::Rasteriser(const Mesh& mesh) : vertices_mm_{mesh.vertices_mm}, triangles_{mesh.triangles} {
  normals_.reserve(triangles_.size());
  for (const auto& [a, b, c] : triangles_)
    normals_.push_back((vertices_mm_[b] - vertices_mm_[a]).cross(vertices_mm_[c] - vertices_mm_[a]).stableNormalized());
}

void Rasteriser::draw(const Eigen::Matrix3f& R, const Eigen::Vector3f& t, double pixel_mm,
                      const Eigen::Vector2d& origin_mm, Template& out) const {
  out.rows = out.cols = 0;
  const auto per_mm = static_cast<float>(1 / pixel_mm);
  // Vertices in pixels of the depth image; z stays in millimetres.
  std::vector<Eigen::Vector3f> at(vertices_mm_.size());
  const Eigen::Vector3f shift((t.x() - static_cast<float>(origin_mm.x())) * per_mm,
                              (t.y() - static_cast<float>(origin_mm.y())) * per_mm, t.z());
  Eigen::Matrix3f A = R;
  A.topRows<2>() *= per_mm;
  Eigen::Vector2f low = Eigen::Vector2f::Constant(std::numeric_limits<float>::max()), high = -low;
  for (std::size_t i = 0; i < at.size(); ++i) {
    at[i] = A * vertices_mm_[i] + shift;
    low = low.cwiseMin(at[i].head<2>());
    high = high.cwiseMax(at[i].head<2>());
  }
  const Eigen::Vector2f extent = high - low;
  if (!extent.allFinite() || extent.maxCoeff() > kTemplatePixelsMax || low.cwiseAbs().maxCoeff() > 1e6F) return;
  out.col0 = static_cast<int>(std::ceil(low.x()));
  out.row0 = static_cast<int>(std::ceil(low.y()));
  out.cols = std::max(0, static_cast<int>(std::floor(high.x())) - out.col0 + 1);
  out.rows = std::max(0, static_cast<int>(std::floor(high.y())) - out.row0 + 1);
  const std::size_t pixels = static_cast<std::size_t>(out.rows) * static_cast<std::size_t>(out.cols);
  out.top_mm.assign(pixels, -std::numeric_limits<float>::infinity());
  out.bottom_mm.assign(pixels, std::numeric_limits<float>::infinity());
  out.triangle.assign(pixels, -1);

  const Eigen::Vector2f corner(static_cast<float>(out.col0), static_cast<float>(out.row0));
  for (Eigen::Vector3f& p : at) p.head<2>() -= corner;
  for (std::size_t k = 0; k < triangles_.size(); ++k) {
    std::array<const Eigen::Vector3f*, 3> v{&at[triangles_[k][0]], &at[triangles_[k][1]], &at[triangles_[k][2]]};
    std::sort(v.begin(), v.end(), [](const auto* a, const auto* b) { return a->y() < b->y(); });
    const Eigen::Vector3f &a = *v[0], &b = *v[1], &c = *v[2];
    const int row_first = std::max(0, static_cast<int>(std::ceil(a.y())));
    const int row_last = std::min(out.rows - 1, static_cast<int>(std::floor(c.y())));
    if (row_first > row_last) continue;
    const Eigen::Vector3f ab = b - a, ac = c - a;
    const float area = ab.x() * ac.y() - ab.y() * ac.x();
    if (std::abs(area) < 1e-9F) continue;  // seen edge on
    const float dz_dx = (ab.z() * ac.y() - ac.z() * ab.y()) / area, dz_dy = (ab.x() * ac.z() - ac.x() * ab.z()) / area;
    for (int row = row_first; row <= row_last; ++row) {
      const auto y = static_cast<float>(row);
      const float long_x = a.x() + ac.x() * (y - a.y()) / ac.y();
      const bool lower_half = y < b.y();
      const Eigen::Vector3f& from = lower_half ? a : b;
      const Eigen::Vector3f& to = lower_half ? b : c;
      const float rise = to.y() - from.y();
      const float short_x = rise > 0 ? from.x() + (to.x() - from.x()) * (y - from.y()) / rise : from.x();
      const int col_first = std::max(0, static_cast<int>(std::ceil(std::min(long_x, short_x))));
      const int col_last = std::min(out.cols - 1, static_cast<int>(std::floor(std::max(long_x, short_x))));
      float z = a.z() + dz_dy * (y - a.y()) + dz_dx * (static_cast<float>(col_first) - a.x());
      std::size_t i = out.at(row, col_first);
      for (int col = col_first; col <= col_last; ++col, ++i, z += dz_dx) {
        if (z > out.top_mm[i]) {
          out.top_mm[i] = z;
          out.triangle[i] = static_cast<std::int32_t>(k);
        }
        out.bottom_mm[i] = std::min(out.bottom_mm[i], z);
      }
    }
  }
  for (std::size_t i = 0; i < pixels; ++i)
    if (out.triangle[i] < 0) out.top_mm[i] = out.bottom_mm[i] = kNothing;
}

std::unique_ptr<DepthRenderer> make_scan_line_renderer(const Mesh& mesh) {
  return std::make_unique<ScanLineRenderer>(mesh);
}
}  // namespace binpick::vision
