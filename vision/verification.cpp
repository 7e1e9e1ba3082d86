#include "vision/verification.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace binpick::vision {
namespace {
constexpr float kSlopeMax = 2.0F;
constexpr float kContradictionWeight = 4.0F;
constexpr float kEdgeMissingWeight = 0.7F;
constexpr float kEdgeFoundWeight = 0.3F;
/// A contradiction beside the template's own edge may be half a pixel of pose error.
constexpr float kBorderWeight = 0.25F;
/// On a thin rim the error of a grid rotation alone puts a third of the samples beside it: mild here, strict when
/// rendered.
constexpr float kSparseContradiction = 1.0F;
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

Eigen::Vector3f upward_normal(const Rasteriser& part, const Pose& pose, std::int32_t triangle) {
  const Eigen::Vector3f n = pose.R * part.normal(triangle);
  return n.z() < 0 ? Eigen::Vector3f(-n) : n;
}

float slope_of(const Eigen::Vector3f& n) {
  const float flat = std::hypot(n.x(), n.y());
  return flat > kSlopeMax * n.z() ? kSlopeMax : flat / n.z();
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

/// Sum over the samples in [first, last): explained count one less what their distance takes.
struct SparseSum {
  float evidence = 0;
  int explained = 0;
  int contradicted = 0;
};

template <class Place>
void add_sparse(const Scene& scene, const View& view, std::size_t first, std::size_t last, float tolerance_mm,
                const Place& place, SparseSum& sum) {
  const auto per_mm = static_cast<float>(1 / scene.pixel_mm);
  const Eigen::Vector2f origin = scene.origin_mm.cast<float>();
  for (std::size_t i = first; i < last; ++i) {
    const Eigen::Vector3f p = place(view.surface[i].p_mm);
    const float x = (p.x() - origin.x()) * per_mm + 0.5F, y = (p.y() - origin.y()) * per_mm + 0.5F;
    if (!(x >= 0 && y >= 0 && x < static_cast<float>(scene.cols()) && y < static_cast<float>(scene.rows()))) {
      sum.evidence -= 1;  // outside the supply
      ++sum.contradicted;
      continue;
    }
    const float d = scene.z_mm(static_cast<int>(y), static_cast<int>(x)) - p.z();
    if (std::abs(d) <= tolerance_mm) {
      const float share = d / tolerance_mm;
      sum.evidence += 1 - 0.7F * share * share;
      ++sum.explained;
    } else if (d < 0) {
      sum.evidence -= kSparseContradiction;
      ++sum.contradicted;
    }
  }
}

template <class Place>
float add_edges(const Scene& scene, const View& view, const Place& place) {
  if (view.edges_mm.empty()) return 0;
  const auto per_mm = static_cast<float>(1 / scene.pixel_mm);
  const Eigen::Vector2f origin = scene.origin_mm.cast<float>();
  float found = 0;
  for (const Eigen::Vector3f& edge : view.edges_mm) {
    const Eigen::Vector3f p = place(edge);
    const auto col = static_cast<int>(std::lround((p.x() - origin.x()) * per_mm));
    const auto row = static_cast<int>(std::lround((p.y() - origin.y()) * per_mm));
    if (!scene.inside(row, col) || scene.nearest_edge(row, col) < 0) continue;
    const std::int32_t at = scene.nearest_edge(row, col);
    const float z = scene.z_mm(at / scene.cols(), at % scene.cols());
    if (std::abs(z - p.z()) < scene.jump_mm) found += std::max(0.0F, 1 - scene.edge_distance_px(row, col) / 5.0F);
  }
  return found / static_cast<float>(view.edges_mm.size());
}

template <class Place>
float sparse(const Scene& scene, const View& view, float tolerance_mm, const Place& place) {
  constexpr std::size_t kFirst = 16;
  constexpr float kHopeless = -1;
  const std::size_t n = view.surface.size();
  if (n == 0) return kHopeless;
  SparseSum sum;
  add_sparse(scene, view, 0, std::min(kFirst, n), tolerance_mm, place, sum);
  if (n > kFirst) {
    if (sum.explained < 4 || sum.contradicted > 8) return kHopeless;
    add_sparse(scene, view, kFirst, n, tolerance_mm, place, sum);
  }
  if (sum.evidence <= 0) return kHopeless;
  const float pixels = view.area_mm2 / static_cast<float>(scene.pixel_mm * scene.pixel_mm);
  return pixels * (sum.evidence / static_cast<float>(n) + 0.3F * add_edges(scene, view, place));
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

float sparse_evidence(const Scene& scene, const View& view, const Eigen::Vector3f& p_supply, float tolerance_mm) {
  return sparse(scene, view, tolerance_mm, [&](const Eigen::Vector3f& p) -> Eigen::Vector3f { return p_supply + p; });
}

float sparse_evidence(const Scene& scene, const View& view, const Pose& pose, float tolerance_mm) {
  const Eigen::Matrix3f turn = pose.R * view.R_supply_object.toRotationMatrix().transpose();
  const Eigen::Vector3f anchor = pose.R * view.anchors_object_mm.front() + pose.t;
  return sparse(scene, view, tolerance_mm,
                [&](const Eigen::Vector3f& p) -> Eigen::Vector3f { return anchor + turn * p; });
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
      const float limit = tolerance + per_slope * slope_of(upward_normal(part, pose, drawn.triangle[i]));
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
          const float share = d / (tolerance + per_slope * slope_of(n));
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
