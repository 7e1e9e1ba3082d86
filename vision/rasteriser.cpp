#include "vision/rasteriser.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "vision/kernels.hpp"

namespace binpick::vision {
namespace {
static_assert(Template::kMarginPx == kernels::kMargin);
constexpr float kNothing = std::numeric_limits<float>::quiet_NaN();
/// A template larger than this is a pose far out of any supply, or a pixel far too small.
constexpr float kTemplatePixelsMax = 4096;

/// Every body of the mesh is closed, and its normals point outwards: then what is seen from above turns its normal up.
bool turns_outward(const Mesh& mesh) {
  std::vector<std::uint64_t> edges, reversed;
  std::vector<std::uint32_t> body(mesh.vertices_mm.size());
  std::iota(body.begin(), body.end(), 0U);
  const auto root = [&](std::uint32_t v) {
    while (body[v] != v) v = body[v] = body[body[v]];
    return v;
  };
  for (const auto& triangle : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint64_t from = triangle[k], to = triangle[(k + 1) % 3];
      edges.push_back(from << 32 | to);
      reversed.push_back(to << 32 | from);
      body[root(triangle[k])] = root(triangle[(k + 1) % 3]);
    }
  std::sort(edges.begin(), edges.end());
  std::sort(reversed.begin(), reversed.end());
  if (edges != reversed || std::adjacent_find(edges.begin(), edges.end()) != edges.end()) return false;
  std::vector<double> volume(mesh.vertices_mm.size(), 0.0);
  for (const auto& [a, b, c] : mesh.triangles)
    volume[root(a)] += mesh.vertices_mm[a].cast<double>().dot(
        mesh.vertices_mm[b].cast<double>().cross(mesh.vertices_mm[c].cast<double>()));
  return std::none_of(volume.begin(), volume.end(), [](double v) { return v < 0; });
}

class WorkingRenderer final : public DepthRenderer {
 public:
  explicit WorkingRenderer(const Mesh& mesh) : rasteriser_{mesh} {}
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

Rasteriser::Rasteriser(const Mesh& mesh) : outward_{turns_outward(mesh)} {
  const auto filled = [](std::size_t n) { return (n + kernels::kLanes - 1) / kernels::kLanes * kernels::kLanes; };
  const std::size_t n = mesh.vertices_mm.size(), count = filled(mesh.triangles.size());
  points_ = filled(n);
  vertices_mm_.resize(3 * points_);
  for (std::size_t i = 0; i < points_ && n > 0; ++i)
    for (std::size_t axis = 0; axis < 3; ++axis)
      vertices_mm_[axis * points_ + i] = mesh.vertices_mm[std::min(i, n - 1)][static_cast<Eigen::Index>(axis)];
  triangles_.assign(3 * count, 0);  // what fills up the last eight has no area
  normals_.assign(3 * count, 0.0F);
  for (std::size_t k = 0; k < mesh.triangles.size(); ++k) {
    const auto& [a, b, c] = mesh.triangles[k];
    for (std::size_t corner = 0; corner < 3; ++corner)
      triangles_[corner * count + k] = static_cast<std::int32_t>(mesh.triangles[k][corner]);
    const Eigen::Vector3f normal =
        (mesh.vertices_mm[b] - mesh.vertices_mm[a]).cross(mesh.vertices_mm[c] - mesh.vertices_mm[a]).stableNormalized();
    for (std::size_t axis = 0; axis < 3; ++axis) normals_[axis * count + k] = normal[static_cast<Eigen::Index>(axis)];
  }
}

void Rasteriser::draw(const Eigen::Matrix3f& R, const Eigen::Vector3f& t, double pixel_mm,
                      const Eigen::Vector2d& origin_mm, Template& out) const {
  out.rows = out.cols = out.stride = 0;
  const auto per_mm = static_cast<float>(1 / pixel_mm);
  // Vertices in pixels of the depth image; z stays in millimetres.
  kernels::Motion motion;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) motion.turn[3 * r + c] = R(r, c) * (r < 2 ? per_mm : 1.0F);
  motion.shift[0] = (t.x() - static_cast<float>(origin_mm.x())) * per_mm;
  motion.shift[1] = (t.y() - static_cast<float>(origin_mm.y())) * per_mm;
  motion.shift[2] = t.z();
  thread_local std::vector<float> at;
  at.resize(vertices_mm_.size());
  Eigen::Vector4f box;  // low x, y, high x, y
  kernels::table().move_points(motion, vertices_mm_.data(), points_, at.data(), box.data());
  const Eigen::Vector2f extent = box.tail<2>() - box.head<2>();
  if (points_ == 0 || !extent.allFinite() || extent.maxCoeff() > kTemplatePixelsMax || box.cwiseAbs().maxCoeff() > 1e6F)
    return;
  out.col0 = static_cast<int>(std::ceil(box[0]));
  out.row0 = static_cast<int>(std::ceil(box[1]));
  out.cols = std::max(0, static_cast<int>(std::floor(box[2])) - out.col0 + 1);
  out.rows = std::max(0, static_cast<int>(std::floor(box[3])) - out.row0 + 1);
  if (out.rows == 0 || out.cols == 0) {
    out.rows = out.cols = 0;
    return;
  }
  out.stride = out.cols + 2 * Template::kMarginPx + static_cast<int>(kernels::kLanes);
  const std::size_t pixels =
      static_cast<std::size_t>(out.rows + 2 * Template::kMarginPx) * static_cast<std::size_t>(out.stride);
  out.top_mm.assign(pixels, -std::numeric_limits<float>::infinity());
  out.triangle.assign(pixels, -1);

  for (std::size_t i = 0; i < points_; ++i) {
    at[i] -= static_cast<float>(out.col0);
    at[points_ + i] -= static_cast<float>(out.row0);
  }
  const std::size_t first = out.at(0, 0);
  const kernels::Canvas canvas{out.top_mm.data() + first, out.triangle.data() + first, out.rows, out.cols, out.stride};
  kernels::table().draw(canvas, at.data(), points_, triangles_.data(), triangles_.size() / 3, outward_);
  for (std::size_t i = 0; i < pixels; ++i) out.top_mm[i] = out.triangle[i] < 0 ? kNothing : out.top_mm[i];
}

std::unique_ptr<DepthRenderer> make_working_renderer(const Mesh& mesh) {
  return std::make_unique<WorkingRenderer>(mesh);
}
}  // namespace binpick::vision
