#include "vision/verification.hpp"

#include <algorithm>
#include <cmath>

#include "vision/kernels.hpp"
#include "vision/prepared.hpp"

namespace binpick::vision {
namespace {
constexpr float kContradictionWeight = 4.0F;
constexpr float kEdgeMissingWeight = 0.7F;
constexpr float kEdgeFoundWeight = 0.3F;
/// A contradiction beside the template's own edge may be half a pixel of pose error.
constexpr float kBorderWeight = 0.25F;
constexpr float kNormalCosine = 0.82F;  // 35 degrees

/// A template and the faces of its pose. The faces stay until the thread asks again.
kernels::Drawn drawn_of(const Scene& scene, const Rasteriser& part, const Pose& pose, const Template& drawn,
                        const kernels::Table& loops) {
  thread_local std::vector<float> faces;
  const std::size_t count = part.triangle_count();
  faces.resize(4 * count);
  const kernels::Motion motion = motion_of(pose.R, pose.t);
  loops.turn_faces(motion.turn, part.normals().data(), count, tolerance_of(scene),
                   static_cast<float>(0.5 * scene.pixel_mm), faces.data());
  const std::size_t first = drawn.at(0, 0);
  return {drawn.top_mm.data() + first,
          drawn.triangle.data() + first,
          drawn.rows,
          drawn.cols,
          drawn.stride,
          drawn.row0,
          drawn.col0,
          faces.data(),
          count};
}

float sparse(const Scene& scene, const KnowledgeBase::Impl& part, std::size_t view, float tolerance_mm,
             const kernels::Motion& motion, std::size_t samples_max = 1000) {
  constexpr std::size_t kFirst = 16;
  constexpr float kHopeless = -1;
  const std::span<const float> points = prepared(part).surface(view), edges = prepared(part).edges(view);
  const bool all = samples_max >= points.size() / 3;
  const std::size_t n = all ? points.size() / 3 : samples_max, first = std::min(n, kFirst);
  if (n == 0) return kHopeless;
  const kernels::Picture picture = picture_of(scene, false);
  kernels::SparseSum sum;
  kernels::table().sparse(picture, motion, points.data(), first, tolerance_mm, sum);
  if (n > first) {
    if (sum.explained < 4 || sum.contradicted > 8) return kHopeless;
    kernels::table().sparse(picture, motion, points.data() + 3 * first, n - first, tolerance_mm, sum);
  }
  if (sum.evidence <= 0) return kHopeless;
  const std::size_t m = all ? edges.size() / 3 : 0;
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
  picture.bend_mm = scene.bend_mm.data();
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
                      float tolerance_mm, std::size_t samples_max) {
  const View& seen = part.views[view];
  const Eigen::Matrix3f turn = pose.R * seen.R_supply_object.toRotationMatrix().transpose();
  return sparse(scene, part, view, tolerance_mm, motion_of(turn, pose.R * seen.anchors_object_mm.front() + pose.t),
                samples_max);
}

float DenseTest::visible_fraction() const {
  return static_cast<float>(explained + contradicted) / static_cast<float>(std::max(1, pixels - holes));
}
float DenseTest::contradicted_ratio() const {
  return static_cast<float>(contradicted) / static_cast<float>(std::max(1, explained + contradicted));
}
float DenseTest::edge_ratio() const {
  return static_cast<float>(edges_found + 1) / static_cast<float>(edges_found + edges_missing + 1);
}

int glance_every(const Scene& scene, double diameter_mm) {
  constexpr double kAcross = 40;
  return std::max(1, static_cast<int>(std::lround(diameter_mm / (kAcross * scene.pixel_mm))));
}

float glance(const Scene& scene, const Rasteriser& part, const Pose& pose, Template& drawn, int every,
             const kernels::Table& loops) {
  part.draw(pose.R, pose.t, every * scene.pixel_mm, scene.origin_mm, drawn);
  if (every == 1) return dense_test(scene, part, pose, drawn, loops).evidence;
  if (drawn.rows == 0) return 0;
  kernels::DenseSum sum;
  loops.glance(picture_of(scene, false), drawn_of(scene, part, pose, drawn, loops), every,
               jump_of(scene.noise_mm, every * scene.pixel_mm), sum);
  const auto length = static_cast<float>(every), area = length * length;
  // Of a pixel beside an edge only this share is one beside an edge at full size.
  const float border = static_cast<float>(sum.contradicted_border) * (1 - kBorderWeight) / length;
  return area * (sum.weight - kContradictionWeight * (static_cast<float>(sum.contradicted) - border)) +
         length * (kEdgeFoundWeight * static_cast<float>(sum.edges_found) -
                   kEdgeMissingWeight * static_cast<float>(sum.edges_missing));
}

void compare(const Scene& scene, const Rasteriser& part, const Pose& pose, const Template& drawn,
             std::vector<PixelState>& states, const kernels::Table& loops) {
  static_assert(sizeof(PixelState) == 1 && PixelState::Missing == PixelState{4});
  states.assign(drawn.top_mm.size(), PixelState::Empty);
  if (drawn.rows == 0) return;
  loops.states(picture_of(scene, false), drawn_of(scene, part, pose, drawn, loops),
               reinterpret_cast<std::uint8_t*>(states.data() + drawn.at(0, 0)));
}

DenseTest dense_test(const Scene& scene, const Rasteriser& part, const Pose& pose, const Template& drawn,
                     const kernels::Table& loops) {
  DenseTest test;
  if (drawn.rows == 0) return test;
  const auto noise = static_cast<float>(scene.noise_mm);
  kernels::DenseSum sum;
  loops.dense(picture_of(scene, false), drawn_of(scene, part, pose, drawn, loops),
              {kNormalCosine * kNormalCosine, 4 * noise}, sum);
  test.pixels = sum.pixels;
  test.explained = sum.explained;
  test.contradicted = sum.contradicted;
  test.contradicted_border = sum.contradicted_border;
  test.occluded = sum.occluded;
  test.missing = sum.pixels - sum.explained - sum.contradicted - sum.occluded;
  test.edges_found = sum.edges_found;
  test.edges_missing = sum.edges_missing;
  test.fit = sum.weight / static_cast<float>(std::max(1, sum.explained));
  if (sum.normals > 0) test.normal_agreement = static_cast<float>(sum.normals_same) / static_cast<float>(sum.normals);
  // A model without curvature worth the noise says nothing about it.
  if (sum.bend_model > 0.15F * noise * noise * static_cast<float>(std::max(1, sum.normals)))
    test.bend_agreement = sum.bend_both / std::sqrt(sum.bend_model * std::max(sum.bend_scene, 1e-6F));
  const float contradiction = static_cast<float>(sum.contradicted - sum.contradicted_border) +
                              kBorderWeight * static_cast<float>(sum.contradicted_border);
  test.evidence = sum.weight - kContradictionWeight * contradiction -
                  kEdgeMissingWeight * static_cast<float>(sum.edges_missing) +
                  kEdgeFoundWeight * static_cast<float>(sum.edges_found);
  return test;
}
}  // namespace binpick::vision
