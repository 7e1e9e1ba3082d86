#include <algorithm>
#include <array>
#include <cmath>
#include <gtest/gtest.h>
#include <numeric>
#include <random>

#include "tests/unit/detect/scenes.hpp"
#include "vision/verification.hpp"

/// The rendered test against a plain loop that says the same in words that can be read.
namespace binpick::vision {
namespace {
constexpr std::array<std::array<int, 2>, 4> kCross{{{0, 1}, {1, 0}, {0, -1}, {-1, 0}}};

float drawn_at(const Template& drawn, int r, int c) {
  if (r < 0 || c < 0 || r >= drawn.rows || c >= drawn.cols) return std::numeric_limits<float>::quiet_NaN();
  return drawn.top_mm[drawn.at(r, c)];
}

float drawn_bend(const Template& drawn, int r, int c, float jump_mm) {
  float sum = 0;
  int pairs = 0;
  for (const auto& [dr, dc] : std::array<std::array<int, 2>, 4>{{{0, 2}, {2, 0}, {2, 2}, {2, -2}}}) {
    const float here = drawn_at(drawn, r, c), a = drawn_at(drawn, r + dr, c + dc), b = drawn_at(drawn, r - dr, c - dc);
    if (!(std::abs(a - here) <= jump_mm && std::abs(b - here) <= jump_mm)) continue;
    sum += a + b - 2 * here;
    ++pairs;
  }
  return pairs >= 2 ? sum / static_cast<float>(pairs) : 0;
}

DenseTest plain(const Scene& scene, const Rasteriser& part, const Pose& pose, const Template& drawn,
                std::vector<PixelState>& states) {
  DenseTest test;
  const float tolerance = tolerance_of(scene), jump = scene.jump_mm, most = 4 * static_cast<float>(scene.noise_mm);
  double weight = 0, both = 0, model = 0, measured = 0;
  int normals = 0, same = 0;
  states.assign(drawn.top_mm.size(), PixelState::Empty);
  for (int r = 0; r < drawn.rows; ++r)
    for (int c = 0; c < drawn.cols; ++c) {
      const std::size_t i = drawn.at(r, c);
      if (drawn.triangle[i] < 0) continue;
      ++test.pixels;
      const int row = r + drawn.row0, col = c + drawn.col0;
      if (!scene.inside(row, col) || std::isnan(scene.z_mm(row, col))) {
        ++test.missing;
        states[i] = PixelState::Missing;
        continue;
      }
      Eigen::Vector3f n = pose.R * part.normal(drawn.triangle[i]);
      if (n.z() < 0) n = -n;
      const float slope = std::min(2.0F, std::sqrt(std::max(0.0F, 1 - n.z() * n.z())) / n.z());
      const float limit = tolerance + 0.5F * static_cast<float>(scene.pixel_mm) * slope;
      const float z = drawn.top_mm[i], d = scene.z_mm(row, col) - z;
      states[i] = std::abs(d) <= limit ? PixelState::Explained
                  : d < 0              ? PixelState::Contradicted
                                       : PixelState::Occluded;
      bool border = false;
      for (const auto& [dr, dc] : kCross) {
        const float beside = drawn_at(drawn, r + dr, c + dc);
        const bool ends = !(z - beside <= jump);
        border |= ends || beside - z > jump;
        if (!ends || states[i] != PixelState::Explained || !scene.inside(row + 2 * dr, col + 2 * dc) ||
            z - drawn_at(drawn, r + 2 * dr, c + 2 * dc) <= jump)
          continue;
        const float drop = scene.z_mm(row, col) - scene.z_mm(row + 2 * dr, col + 2 * dc);
        test.edges_found += drop > jump;
        test.edges_missing += std::abs(drop) <= 0.5F * jump;
      }
      test.explained += states[i] == PixelState::Explained;
      test.contradicted += states[i] == PixelState::Contradicted;
      test.occluded += states[i] == PixelState::Occluded;
      if (states[i] == PixelState::Contradicted) test.contradicted_border += border;
      if (states[i] != PixelState::Explained) continue;
      weight += 1 - std::pow(static_cast<double>(d / limit), 2);
      if (border) continue;
      ++normals;
      same += Eigen::Vector3f(-scene.slope_x(row, col), -scene.slope_y(row, col), 1).normalized().dot(n) >= 0.82F;
      const float a = std::clamp(drawn_bend(drawn, r, c, jump), -most, most);
      const float b = std::clamp(scene.bend_mm(row, col), -most, most);
      both += static_cast<double>(a * b), model += static_cast<double>(a * a), measured += static_cast<double>(b * b);
    }
  test.fit = static_cast<float>(weight / std::max(1, test.explained));
  if (normals > 0) test.normal_agreement = static_cast<float>(same) / static_cast<float>(normals);
  if (model > 0.15 * scene.noise_mm * scene.noise_mm * std::max(1, normals))
    test.bend_agreement = static_cast<float>(both / std::sqrt(model * std::max(measured, 1e-6)));
  test.evidence = static_cast<float>(weight - 4 * (test.contradicted - 0.75 * test.contradicted_border) -
                                     0.7 * test.edges_missing + 0.3 * test.edges_found);
  return test;
}

/// A pile of brackets, one of them half out of the picture: noise, holes, a floor.
struct Pile {
  Pile() {
    DepthImage image;
    image.pixel_mm = 3;
    image.origin_mm = {-300.0, -250.0};
    image.z_mm.setZero(168, 201);
    Template drawn;
    for (const Eigen::Isometry3d& T : objects) {
      part.draw(T.linear().cast<float>(), T.translation().cast<float>(), image.pixel_mm, image.origin_mm, drawn);
      for (int r = 0; r < drawn.rows; ++r)
        for (int c = 0; c < drawn.cols; ++c) {
          const int row = r + drawn.row0, col = c + drawn.col0;
          if (drawn.triangle[drawn.at(r, c)] < 0 || row >= image.z_mm.rows() || col >= image.z_mm.cols()) continue;
          image.z_mm(row, col) = std::max(image.z_mm(row, col), drawn.top_mm[drawn.at(r, c)]);
        }
    }
    std::mt19937 random{5};
    std::normal_distribution<float> noise{0, 1.5F};
    for (float& z : image.z_mm.reshaped())
      z = random() % 11 == 0 ? std::numeric_limits<float>::quiet_NaN() : z + noise(random);
    scene = prepare_scene(image, 1.5);
  }
  std::vector<Eigen::Isometry3d> objects{scenes::pose(-120, 60, 0, 0.4), scenes::pose(-60, 90, 40, 1.9, 0.5),
                                         scenes::pose(120, -90, 0, 2.7, 1.2), scenes::pose(290, 200, 5, 0.2)};
  Rasteriser part{shapes::bracket()};
  Scene scene;
};

/// True poses and poses near them.
std::vector<Pose> poses_about(const Pile& pile, int each) {
  std::mt19937 random{3};
  std::normal_distribution<float> normal;
  std::vector<Pose> poses;
  for (const Eigen::Isometry3d& T : pile.objects)
    for (int k = 0; k < each; ++k) {
      const float off = static_cast<float>(k) / static_cast<float>(each);
      const Eigen::Vector3f axis = Eigen::Vector3f(normal(random), normal(random), normal(random)).normalized();
      Pose pose;
      pose.R = Eigen::AngleAxisf(0.5F * off, axis) * T.linear().cast<float>();
      pose.t =
          T.translation().cast<float>() + 8 * off * Eigen::Vector3f(normal(random), normal(random), normal(random));
      poses.push_back(pose);
    }
  return poses;
}

TEST(Dense, SaysWhatAPlainLoopSays) {
  const Pile pile;
  Template drawn;
  std::vector<PixelState> expected_states, states;
  int outside = 0, edges = 0, bent = 0;
  for (const Pose& pose : poses_about(pile, 12)) {
    pile.part.draw(pose.R, pose.t, pile.scene.pixel_mm, pile.scene.origin_mm, drawn);
    const DenseTest expected = plain(pile.scene, pile.part, pose, drawn, expected_states);
    ASSERT_GT(expected.pixels, 300);
    outside += expected.missing > 0.2 * expected.pixels;
    edges += expected.edges_found > 10 && expected.edges_missing > 0;
    bent += expected.bend_agreement < 1;
    for (const kernels::Table* loops : {&kernels::portable(), &kernels::table()}) {
      SCOPED_TRACE(loops->name);
      const DenseTest test = dense_test(pile.scene, pile.part, pose, drawn, *loops);
      EXPECT_EQ(test.pixels, expected.pixels);
      EXPECT_EQ(test.missing, expected.missing);
      // A height at the limit itself may round to either side.
      EXPECT_NEAR(test.explained, expected.explained, 1);
      EXPECT_NEAR(test.contradicted, expected.contradicted, 1);
      EXPECT_NEAR(test.contradicted_border, expected.contradicted_border, 1);
      EXPECT_NEAR(test.occluded, expected.occluded, 1);
      EXPECT_NEAR(test.edges_found, expected.edges_found, 2);
      EXPECT_NEAR(test.edges_missing, expected.edges_missing, 2);
      EXPECT_NEAR(test.fit, expected.fit, 2e-3);
      EXPECT_NEAR(test.normal_agreement, expected.normal_agreement, 2e-3);
      EXPECT_NEAR(test.bend_agreement, expected.bend_agreement, 1e-2);
      EXPECT_NEAR(test.evidence, expected.evidence, 4);
      compare(pile.scene, pile.part, pose, drawn, states, *loops);
      ASSERT_EQ(states.size(), expected_states.size());
      const auto different = std::inner_product(states.begin(), states.end(), expected_states.begin(), 0, std::plus{},
                                                std::not_equal_to{});
      EXPECT_LE(different, 1);
    }
  }
  EXPECT_GT(outside, 3) << "poses that reach out of the picture";
  EXPECT_GT(edges, 10);
  EXPECT_GT(bent, 10);
}

/// Spearman's rank correlation.
double rank_correlation(const std::vector<float>& a, const std::vector<float>& b) {
  const auto ranks = [](const std::vector<float>& values) {
    std::vector<double> rank;
    for (const float v : values)
      rank.push_back(static_cast<double>(std::count_if(values.begin(), values.end(), [&](float o) { return o < v; })));
    return rank;
  };
  const std::vector<double> x = ranks(a), y = ranks(b);
  double sum = 0;
  for (std::size_t k = 0; k < x.size(); ++k) sum += (x[k] - y[k]) * (x[k] - y[k]);
  const auto n = static_cast<double>(x.size());
  return 1 - 6 * sum / (n * (n * n - 1));
}

TEST(Dense, AGlanceOrdersPosesAsTheWholeTestDoes) {
  const Pile pile;
  Template drawn;
  const std::vector<Pose> poses = poses_about(pile, 25);
  std::vector<float> whole;
  for (const Pose& pose : poses) whole.push_back(glance(pile.scene, pile.part, pose, drawn, 1));
  const float most = *std::max_element(whole.begin(), whole.end());
  EXPECT_GT(most, 1000);
  for (const int every : {2, 3}) {
    std::vector<float> seen;
    float apart = 0;
    for (std::size_t k = 0; k < poses.size(); ++k) {
      seen.push_back(glance(pile.scene, pile.part, poses[k], drawn, every));
      EXPECT_NEAR(seen[k], glance(pile.scene, pile.part, poses[k], drawn, every, kernels::portable()), 1e-2F * most);
      if (whole[k] > 0.2F * most) apart = std::max(apart, std::abs(seen[k] - whole[k]));
    }
    EXPECT_GT(rank_correlation(whole, seen), 0.95) << every;
    EXPECT_LT(apart, 0.15F * most) << every;
  }
}

TEST(Dense, AGlanceSeesSomeFortyPixels) {
  Scene scene;
  scene.pixel_mm = 0.2;
  EXPECT_EQ(glance_every(scene, 24), 3);
  EXPECT_EQ(glance_every(scene, 2), 1);
}

TEST(Dense, FarOutsideIsMissing) {
  const Pile pile;
  Pose pose;
  Template drawn;
  std::vector<PixelState> states;
  for (const Eigen::Vector3f& t : {Eigen::Vector3f(4000, 0, 0), Eigen::Vector3f(0, -4000, 0)}) {
    pose.t = t;
    pile.part.draw(pose.R, pose.t, pile.scene.pixel_mm, pile.scene.origin_mm, drawn);
    const DenseTest test = dense_test(pile.scene, pile.part, pose, drawn);
    EXPECT_GT(test.pixels, 300);
    EXPECT_EQ(test.missing, test.pixels);
    compare(pile.scene, pile.part, pose, drawn, states);
    EXPECT_EQ(std::count(states.begin(), states.end(), PixelState::Missing), test.pixels);
  }
  pose.t = Eigen::Vector3f(1e9F, 0, 0);
  pile.part.draw(pose.R, pose.t, pile.scene.pixel_mm, pile.scene.origin_mm, drawn);
  EXPECT_EQ(dense_test(pile.scene, pile.part, pose, drawn).pixels, 0);
}
}  // namespace
}  // namespace binpick::vision
