#include "vision/kernels.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <gtest/gtest.h>
#include <limits>
#include <random>
#include <vector>

namespace binpick::vision::kernels {
namespace {
constexpr int kRows = 60, kCols = 75;

/// A wavy surface with a step and holes, and what belongs to it.
struct Wavy {
  Wavy() {
    for (int r = 0; r < kRows; ++r)
      for (int c = 0; c < kCols; ++c) {
        const auto x = static_cast<float>(c), y = static_cast<float>(r);
        z.push_back((r * 7 + c * 13) % 31 == 0 ? std::numeric_limits<float>::quiet_NaN()
                                               : 10 * std::sin(0.1F * x) + 0.2F * y + (c > 40 ? 30.0F : 0.0F));
        slope_x.push_back(std::cos(0.1F * x));
        slope_y.push_back(0.2F);
        // Edge pixels stand at column 41; the next one is in the same row.
        edge.push_back(std::abs(c - 41) <= 8 ? r * kCols + 41 : -1);
        distance.push_back(static_cast<float>(std::min(16, std::abs(c - 41))));
        out_x.push_back(-1);
        out_y.push_back(0);
      }
    picture = {z.data(),        slope_x.data(), slope_y.data(),      edge.data(),  distance.data(), z.data(),
               out_x.data(),    out_y.data(),   /*bend_mm=*/nullptr, kRows,        kCols,
               /*origin_x=*/-5, /*origin_y=*/3, /*pixel_mm=*/2,      /*jump_mm=*/6};
  }
  std::vector<float> z, slope_x, slope_y, distance, out_x, out_y;
  std::vector<std::int32_t> edge;
  Picture picture;
};

Motion motion_about(const Eigen::Vector3f& axis, float angle, const Eigen::Vector3f& shift) {
  const Eigen::Matrix3f R = Eigen::AngleAxisf(angle, axis.normalized()).toRotationMatrix();
  Motion m;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) m.turn[3 * r + c] = R(r, c);
    m.shift[r] = shift[r];
  }
  return m;
}

/// `values` per point by eights, from points that lie about the picture and partly beside it.
std::vector<float> points(std::size_t n, std::size_t values) {
  std::mt19937 random{7};
  std::uniform_real_distribution<float> any{-10, 160};
  std::vector<float> out(n * values);
  for (std::size_t i = 0; i < n; ++i) {
    const float x = any(random), y = any(random), z = 10 * std::sin(0.05F * x) + 0.1F * y + 0.02F * any(random);
    Eigen::Vector3f normal(0.1F * any(random) - 8, 0.1F * any(random) - 8, 20);
    normal.normalize();
    const std::array<float, 6> all{x, y, z, normal.x(), normal.y(), normal.z()};
    for (std::size_t k = 0; k < values; ++k) out[i / 8 * 8 * values + k * 8 + i % 8] = all[k];
  }
  return out;
}

const Wavy& wavy() {
  static const Wavy picture;
  return picture;
}
const Motion kMoved = motion_about({1, 2, 3}, 0.05F, {1, -2, 3});

/// Both, when the processor has both; else the portable ones against themselves would say nothing.
bool two_sets() { return &table() != &portable(); }
}  // namespace

TEST(Kernels, PortableOnesDoWhatAPlainLoopDoes) {
  const auto surfels = points(64, 6);
  const std::array<float, 3> centre{70, 60, 5};
  std::array<float, kNormalSums> sums{};
  portable().match_surface(wavy().picture, kMoved, centre.data(), surfels.data(), 64, 8, 0.25F, sums.data());
  Eigen::Matrix<double, 6, 6> H = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 1> g = Eigen::Matrix<double, 6, 1>::Zero();
  int used = 0;
  for (std::size_t i = 0; i < 64; ++i) {
    const auto at = [&](std::size_t k) { return static_cast<double>(surfels[i / 8 * 48 + k * 8 + i % 8]); };
    Eigen::Matrix3d R;
    for (int k = 0; k < 9; ++k) R(k / 3, k % 3) = static_cast<double>(kMoved.turn[k]);
    const Eigen::Vector3d p =
        R * Eigen::Vector3d(at(0), at(1), at(2)) + Eigen::Vector3f::Map(std::data(kMoved.shift)).cast<double>();
    const Eigen::Vector3d n = R * Eigen::Vector3d(at(3), at(4), at(5));
    const double x = (p.x() + 5) / 2, y = (p.y() - 3) / 2;
    const auto col = static_cast<int>(std::floor(x + 0.5)), row = static_cast<int>(std::floor(y + 0.5));
    if (col < 0 || row < 0 || col >= kCols || row >= kRows) continue;
    const auto k = static_cast<std::size_t>(row * kCols + col);
    const double z = static_cast<double>(wavy().z[k]) + 2 * (static_cast<double>(wavy().slope_x[k]) * (x - col) +
                                                             static_cast<double>(wavy().slope_y[k]) * (y - row));
    const double d = z - p.z(), residual = n.z() * d, share = residual / 8;
    if (!(std::abs(d) < 16) || std::abs(share) >= 1) continue;
    ++used;
    const double weight = 0.25 * std::pow(1 - share * share, 2);
    Eigen::Matrix<double, 6, 1> J;
    J << n, (p - Eigen::Vector3f::Map(centre.data()).cast<double>()).cross(n);
    H += weight * J * J.transpose();
    g += weight * residual * J;
  }
  EXPECT_GT(used, 10);
  for (int r = 0, k = 0; r < 6; ++r) {
    for (int c = r; c < 6; ++c, ++k)
      EXPECT_NEAR(static_cast<double>(sums[static_cast<std::size_t>(k)]), H(r, c), 1e-4 * (1 + H.norm()));
    EXPECT_NEAR(static_cast<double>(sums[static_cast<std::size_t>(21 + r)]), g[r], 1e-4 * (1 + g.norm()));
  }
}

TEST(Kernels, AnEdgePullsAcrossItselfOnly) {
  // Eight points three pixels beside the edge, at its height.
  std::vector<float> edges(40, 0.0F);
  for (std::size_t i = 0; i < 8; ++i) {
    const int row = 20 + static_cast<int>(i);
    edges[i] = -5 + 2 * 44.0F;
    edges[8 + i] = 3 + 2 * static_cast<float>(row);
    edges[16 + i] = wavy().z[static_cast<std::size_t>(row * kCols + 41)];
    if (std::isnan(edges[16 + i])) edges[16 + i] = 1000;
  }
  const std::array<float, 3> centre{edges[0], edges[8], 0};
  for (const Table* loops : {&portable(), &table()}) {
    std::array<float, kNormalSums> sums{};
    loops->match_edges(wavy().picture, Motion{}, centre.data(), edges.data(), 8, 20, 1, sums.data());
    EXPECT_GT(sums[0], 1) << "information along x";
    EXPECT_EQ(sums[6], 0) << "none along y";
    // The edge lies at a lower x; it ends towards -x, so that the way there is forwards.
    EXPECT_NEAR(sums[21] / sums[0], -6, 1e-3) << loops->name;
  }
}

TEST(Kernels, BothSetsAgree) {
  if (!two_sets()) GTEST_SKIP() << "this processor has the portable set only";
  const auto surfels = points(128, 6), places = points(128, 3);
  const std::array<float, 3> centre{70, 60, 5};
  std::array<float, kNormalSums> a{}, b{};
  portable().match_surface(wavy().picture, kMoved, centre.data(), surfels.data(), 128, 8, 1, a.data());
  table().match_surface(wavy().picture, kMoved, centre.data(), surfels.data(), 128, 8, 1, b.data());
  const float scale = *std::max_element(a.begin(), a.end());
  for (std::size_t k = 0; k < a.size(); ++k) EXPECT_NEAR(a[k], b[k], 1e-4F * scale) << k;
  SparseSum c, d;
  portable().sparse(wavy().picture, kMoved, places.data(), 128, 5, c);
  table().sparse(wavy().picture, kMoved, places.data(), 128, 5, d);
  EXPECT_EQ(c.explained, d.explained);
  EXPECT_EQ(c.contradicted, d.contradicted);
  EXPECT_NEAR(c.evidence, d.evidence, 1e-3);
  EXPECT_GT(c.explained, 5);
  EXPECT_NEAR(portable().edges(wavy().picture, kMoved, places.data(), 128),
              table().edges(wavy().picture, kMoved, places.data(), 128), 1e-3);
}

TEST(Kernels, CoarseTestCountsSamples) {
  // Sixteen samples in a row of a flat picture: view 0 lies on it, view 1 floats over half of it, view 2 is below.
  const std::vector<float> flat(64, 10.0F);
  std::vector<std::int32_t> offsets;
  std::vector<float> rise;
  for (int view = 0; view < 3; ++view)
    for (int k = 0; k < 16; ++k) {
      offsets.push_back(k - 8);
      rise.push_back(view == 1 && k % 2 == 0 ? 5.0F : view == 2 ? -5.0F : 0.0F);
    }
  for (const Table* loops : {&portable(), &table()}) {
    std::array<std::uint32_t, 3> passed{};
    ASSERT_EQ(loops->coarse(&flat[32], offsets.data(), rise.data(), 0, 3, 10, 1, 8, 8, passed.data()), 2U)
        << loops->name;
    EXPECT_EQ(view_of(passed[0]), 0U);
    EXPECT_EQ(view_of(passed[1]), 1U);
    EXPECT_GT(passed[0], passed[1]) << "the better one";
    ASSERT_EQ(loops->coarse(&flat[32], offsets.data(), rise.data(), 0, 3, 10, 1, 8, 7, passed.data()), 1U);
    ASSERT_EQ(loops->coarse(&flat[32], offsets.data(), rise.data(), 0, 3, 10, 1, 0, 7, passed.data()), 2U)
        << "what lies under the surface is hidden, not contradicted";
    EXPECT_EQ(view_of(passed[1]), 2U);
  }
}

TEST(Kernels, TheEnvironmentMayAskForThePortableLoops) {
  EXPECT_EQ(&chosen("portable"), &portable());
  for (const char* loops : {"", "avx512"}) EXPECT_EQ(&chosen(loops), &chosen(nullptr)) << "the fastest";
  EXPECT_EQ(&chosen(chosen(nullptr).name), &chosen(nullptr));
}

TEST(Kernels, AProgramMayAskForLoopsByName) {
  EXPECT_EQ(find("avx512"), nullptr);
  const Table& before = table();
  EXPECT_EQ(find(before.name), &before);
  use(*find("portable"));
  EXPECT_EQ(&table(), &portable());
  use(before);
  EXPECT_EQ(&table(), &before);
}
}  // namespace binpick::vision::kernels
