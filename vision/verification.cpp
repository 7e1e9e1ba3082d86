#include "vision/verification.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "vision/kernels.hpp"
#include "vision/prepared.hpp"

namespace binpick::vision {
namespace {
constexpr float kSlopeMax = 2.0F;
constexpr float kContradictionWeight = 4.0F;
constexpr float kEdgeMissingWeight = 0.7F;
constexpr float kEdgeFoundWeight = 0.3F;
/// A contradiction beside the template's own edge may be half a pixel of pose error.
constexpr float kBorderWeight = 0.25F;
constexpr float kNormalCosine = 0.82F;  // 35 degrees
/// The place beyond an edge at which the lower surface is looked for.
constexpr int kBeyondPx = 2;

struct Step {
  int row, col;
};
constexpr std::array<Step, 4> kCross{{{0, 1}, {1, 0}, {0, -1}, {-1, 0}}};

float drawn_at(const Template& drawn, int row, int col) {
  if (row < 0 || col < 0 || row >= drawn.rows || col >= drawn.cols) return std::numeric_limits<float>::quiet_NaN();
  return drawn.top_mm[drawn.at(row, col)];
}

/// Of a triangle as it lies: the height of the supply's z axis on its normal, either side up.
float upright(const Rasteriser& part, const Pose& pose, std::int32_t triangle) {
  return std::abs(pose.R.row(2).dot(part.normal(triangle)));
}

Eigen::Vector3f upward_normal(const Rasteriser& part, const Pose& pose, std::int32_t triangle) {
  const Eigen::Vector3f n = pose.R * part.normal(triangle);
  return n.z() < 0 ? Eigen::Vector3f(-n) : n;
}

/// Rise per distance of a surface whose unit normal has this z.
float slope_of(float nz) {
  const float flat2 = std::max(0.0F, 1 - nz * nz);
  return flat2 > kSlopeMax * kSlopeMax * nz * nz ? kSlopeMax : std::sqrt(flat2) / nz;
}

/// Mean second difference over two pixels of the drawn surface, as Scene::bend_mm.
float drawn_bend(const Template& drawn, int row, int col, float jump_mm) {
  constexpr std::array<Step, 4> kPairs{{{0, 2}, {2, 0}, {2, 2}, {2, -2}}};
  const float centre = drawn_at(drawn, row, col);
  float sum = 0;
  int pairs = 0;
  for (const Step& s : kPairs) {
    const float a = drawn_at(drawn, row + s.row, col + s.col), b = drawn_at(drawn, row - s.row, col - s.col);
    if (!(std::abs(a - centre) <= jump_mm && std::abs(b - centre) <= jump_mm)) continue;
    sum += a + b - 2 * centre;
    ++pairs;
  }
  return pairs >= 2 ? sum / static_cast<float>(pairs) : 0;
}

float sparse(const Scene& scene, const KnowledgeBase::Impl& part, std::size_t view, float tolerance_mm,
             const kernels::Motion& motion) {
  constexpr std::size_t kFirst = 16;
  constexpr float kHopeless = -1;
  const std::span<const float> points = prepared(part).surface(view), edges = prepared(part).edges(view);
  const std::size_t n = points.size() / 3, first = std::min(n, kFirst);
  if (n == 0) return kHopeless;
  const kernels::Picture picture = picture_of(scene, false);
  kernels::SparseSum sum;
  kernels::table().sparse(picture, motion, points.data(), first, tolerance_mm, sum);
  if (n > first) {
    if (sum.explained < 4 || sum.contradicted > 8) return kHopeless;
    kernels::table().sparse(picture, motion, points.data() + 3 * first, n - first, tolerance_mm, sum);
  }
  if (sum.evidence <= 0) return kHopeless;
  const std::size_t m = edges.size() / 3;
  const float found = m == 0 ? 0 : kernels::table().edges(picture, motion, edges.data(), m) / static_cast<float>(m);
  const float pixels = part.views[view].area_mm2 / static_cast<float>(scene.pixel_mm * scene.pixel_mm);
  return pixels * (sum.evidence / static_cast<float>(n) + 0.3F * found);
}
}  // namespace

Eigen::Isometry3d Pose::iso() const {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::Quaterniond(R.cast<double>()).normalized().toRotationMatrix();
  T.translation() = t.cast<double>();
  return T;
}

float tolerance_of(const Scene& scene) {
  return static_cast<float>(std::max(1.5 * scene.noise_mm, 0.35 * scene.pixel_mm));
}

kernels::Motion motion_of(const Eigen::Matrix3f& turn, const Eigen::Vector3f& shift) {
  kernels::Motion motion;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) motion.turn[3 * r + c] = turn(r, c);
    motion.shift[r] = shift[r];
  }
  return motion;
}

kernels::Picture picture_of(const Scene& scene, bool single_heights) {
  kernels::Picture picture;
  picture.z_mm = single_heights ? scene.measured_mm.data() : scene.z_mm.data();
  picture.slope_x = scene.slope_x.data();
  picture.slope_y = scene.slope_y.data();
  picture.nearest_edge = scene.nearest_edge.data();
  picture.edge_distance_px = scene.edge_distance_px.data();
  picture.edge_z_mm = scene.z_mm.data();
  picture.edge_out_x = scene.edge_out_x.data();
  picture.edge_out_y = scene.edge_out_y.data();
  picture.rows = scene.rows();
  picture.cols = scene.cols();
  picture.origin_x = static_cast<float>(scene.origin_mm.x());
  picture.origin_y = static_cast<float>(scene.origin_mm.y());
  picture.pixel_mm = static_cast<float>(scene.pixel_mm);
  picture.jump_mm = scene.jump_mm;
  return picture;
}

float sparse_evidence(const Scene& scene, const KnowledgeBase::Impl& part, std::size_t view,
                      const Eigen::Vector3f& p_supply, float tolerance_mm) {
  return sparse(scene, part, view, tolerance_mm, motion_of(Eigen::Matrix3f::Identity(), p_supply));
}

float sparse_evidence(const Scene& scene, const KnowledgeBase::Impl& part, std::size_t view, const Pose& pose,
                      float tolerance_mm) {
  const View& seen = part.views[view];
  const Eigen::Matrix3f turn = pose.R * seen.R_supply_object.toRotationMatrix().transpose();
  return sparse(scene, part, view, tolerance_mm, motion_of(turn, pose.R * seen.anchors_object_mm.front() + pose.t));
}

float DenseTest::visible_fraction() const {
  return pixels == 0 ? 0 : static_cast<float>(explained + contradicted) / static_cast<float>(pixels);
}
float DenseTest::contradicted_ratio() const {
  return static_cast<float>(contradicted) / static_cast<float>(std::max(1, explained + contradicted));
}
float DenseTest::edge_ratio() const {
  return static_cast<float>(edges_found + 1) / static_cast<float>(edges_found + edges_missing + 1);
}

std::vector<PixelState> compare(const Scene& scene, const Rasteriser& part, const Pose& pose, const Template& drawn) {
  const float tolerance = tolerance_of(scene);
  const auto per_slope = static_cast<float>(0.5 * scene.pixel_mm);
  std::vector<PixelState> states(drawn.top_mm.size(), PixelState::Empty);
  for (int r = 0; r < drawn.rows; ++r)
    for (int c = 0; c < drawn.cols; ++c) {
      const std::size_t i = drawn.at(r, c);
      if (drawn.triangle[i] < 0) continue;
      const int row = r + drawn.row0, col = c + drawn.col0;
      if (!scene.inside(row, col) || std::isnan(scene.z_mm(row, col))) {
        states[i] = PixelState::Missing;
        continue;
      }
      const float d = scene.z_mm(row, col) - drawn.top_mm[i];
      const float limit = tolerance + per_slope * slope_of(upright(part, pose, drawn.triangle[i]));
      states[i] = std::abs(d) <= limit ? PixelState::Explained
                  : d < 0              ? PixelState::Contradicted
                                       : PixelState::Occluded;
    }
  return states;
}

DenseTest dense_test(const Scene& scene, const Rasteriser& part, const Pose& pose, const Template& drawn) {
  DenseTest test;
  const std::vector<PixelState> states = compare(scene, part, pose, drawn);
  const float tolerance = tolerance_of(scene);
  const auto per_slope = static_cast<float>(0.5 * scene.pixel_mm);
  const auto noise = static_cast<float>(scene.noise_mm);
  float weight = 0, contradiction = 0;
  int normals = 0, normals_same = 0;
  float bend_both = 0, bend_model = 0, bend_scene = 0;
  for (int r = 0; r < drawn.rows; ++r)
    for (int c = 0; c < drawn.cols; ++c) {
      const std::size_t i = drawn.at(r, c);
      if (states[i] == PixelState::Empty) continue;
      ++test.pixels;
      const int row = r + drawn.row0, col = c + drawn.col0;
      const float z = drawn.top_mm[i];
      bool border = false;
      if (states[i] != PixelState::Missing)
        for (const Step& s : kCross) {
          const float beside = drawn_at(drawn, r + s.row, c + s.col);
          const bool model_ends = !(z - beside <= scene.jump_mm);  // also where nothing is drawn
          border |= model_ends || beside - z > scene.jump_mm;
          if (!model_ends || states[i] != PixelState::Explained) continue;
          const int out_row = row + kBeyondPx * s.row, out_col = col + kBeyondPx * s.col;
          // An inner jump narrower than the look-out says nothing.
          const float model_beyond = drawn_at(drawn, r + kBeyondPx * s.row, c + kBeyondPx * s.col);
          if (!scene.inside(out_row, out_col) || z - model_beyond <= scene.jump_mm) continue;
          const float drop = scene.z_mm(row, col) - scene.z_mm(out_row, out_col);
          if (drop > scene.jump_mm)
            ++test.edges_found;
          else if (std::abs(drop) <= 0.5F * scene.jump_mm)
            ++test.edges_missing;
        }
      switch (states[i]) {
        case PixelState::Explained: {
          ++test.explained;
          const Eigen::Vector3f n = upward_normal(part, pose, drawn.triangle[i]);
          const float d = scene.z_mm(row, col) - z;
          const float share = d / (tolerance + per_slope * slope_of(n.z()));
          weight += 1 - share * share;
          if (border) break;
          const Eigen::Vector3f seen =
              Eigen::Vector3f(-scene.slope_x(row, col), -scene.slope_y(row, col), 1).normalized();
          ++normals;
          normals_same += seen.dot(n) >= kNormalCosine;
          const auto clipped = [&](float bend) { return std::clamp(bend, -4 * noise, 4 * noise); };
          const float drawn_here = clipped(drawn_bend(drawn, r, c, scene.jump_mm));
          const float measured_here = clipped(scene.bend_mm(row, col));
          bend_both += drawn_here * measured_here;
          bend_model += drawn_here * drawn_here;
          bend_scene += measured_here * measured_here;
          break;
        }
        case PixelState::Contradicted:
          ++test.contradicted;
          test.contradicted_border += border;
          contradiction += border ? kBorderWeight : 1.0F;
          break;
        case PixelState::Occluded:
          ++test.occluded;
          break;
        case PixelState::Missing:
          ++test.missing;
          break;
        case PixelState::Empty:
          break;
      }
    }
  test.fit = weight / static_cast<float>(std::max(1, test.explained));
  if (normals > 0) test.normal_agreement = static_cast<float>(normals_same) / static_cast<float>(normals);
  // A model without curvature worth the noise says nothing about it.
  if (bend_model > 0.15F * noise * noise * static_cast<float>(std::max(1, normals)))
    test.bend_agreement = bend_both / std::sqrt(bend_model * std::max(bend_scene, 1e-6F));
  test.evidence = weight - kContradictionWeight * contradiction -
                  kEdgeMissingWeight * static_cast<float>(test.edges_missing) +
                  kEdgeFoundWeight * static_cast<float>(test.edges_found);
  return test;
}
}  // namespace binpick::vision
