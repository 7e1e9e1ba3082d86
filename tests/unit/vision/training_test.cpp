#include <algorithm>
#include <cmath>
#include <gtest/gtest.h>
#include <random>

#include "tests/unit/vision/shapes.hpp"
#include "vision/feature.hpp"
#include "vision/file.hpp"
#include "vision/knowledge_base_impl.hpp"
#include "vision/rotations.hpp"
#include "vision/surface.hpp"
#include "vision/view.hpp"
#include "vision/votes.hpp"

namespace binpick::vision {
namespace {
PartOptions few_rotations(int rotations) {
  PartOptions options;
  options.name = "l_shape";
  options.rotations = rotations;
  return options;
}

const KnowledgeBase& l_shape_base() {
  static const KnowledgeBase base = train(shapes::l_shape(), few_rotations(1000), {}, nullptr, 2).value();
  return base;
}

TEST(View, ABoxLyingFlatIsAsItsFormulaSays) {
  const Mesh box = shapes::box(40, 24, 10);
  const Eigen::Quaterniond upright = Eigen::Quaterniond::Identity();
  DepthImage image = window_around(box, upright.toRotationMatrix(), 1, 5, {0.5, 0.5});
  make_osmesa_renderer(box)->render(Eigen::Isometry3d::Identity(), image);
  EXPECT_TRUE(std::isnan(image.z_mm(4, 4)));
  const TrainedView view = view_of(image, box, upright, 0.1, box.diameter_mm());
  ASSERT_FALSE(view.anchors_object_mm.empty());
  const Eigen::Vector3f anchor = view.anchors_object_mm.front();  // somewhere on the top: all of it is highest
  EXPECT_NEAR(double{anchor.z()}, 5, 1e-3);
  EXPECT_LT(std::abs(anchor.x()), 20);
  EXPECT_LT(std::abs(anchor.y()), 12);
  EXPECT_NEAR(double{view.lowest_mm}, -10, 1e-3);
  EXPECT_NEAR(double{view.area_mm2}, 960, 1);
  ASSERT_EQ(view.surface.size(), static_cast<std::size_t>(kSurfaceSamples));
  for (const SurfaceSample& s : view.surface) {
    EXPECT_NEAR(double{s.p_mm.z()}, 0, 1e-3);
    EXPECT_TRUE(s.normal.isApprox(Eigen::Vector3f::UnitZ(), 1e-3F));
  }
  ASSERT_EQ(view.edges_mm.size(), static_cast<std::size_t>(kEdgeSamples));
  for (const Eigen::Vector3f& e : view.edges_mm) {
    const Eigen::Vector3f at = anchor + e;
    const double out = std::max(std::abs(double{at.x()}) - 20, std::abs(double{at.y()}) - 12);
    EXPECT_NEAR(out, -0.5, 0.51);  // the last pixel inside
  }
}

TEST(View, SamplesLieOnTheSurfaceWithItsNormalsInAnyRotation) {
  const Mesh part = shapes::l_shape();
  const SurfaceTree tree(part);
  const auto renderer = make_osmesa_renderer(part);
  for (const Eigen::Quaterniond& q : training_rotations(25, {})) {
    DepthImage image = window_around(part, q.toRotationMatrix(), 0.5, 5, {0, 0});
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = q.toRotationMatrix();
    renderer->render(T, image);
    const TrainedView view = view_of(image, part, q, 0.1, part.diameter_mm());
    ASSERT_FALSE(view.anchors_object_mm.empty());
    EXPECT_LE(view.anchors_object_mm.size(), kAnchorsMax);
    const Eigen::Vector3d anchor = q * view.anchors_object_mm.front().cast<double>();
    double top = -1e9;
    for (const Eigen::Vector3f& v : part.vertices_mm) top = std::max(top, (q * v.cast<double>()).z());
    EXPECT_GT(anchor.z(), top - 3);
    int wrong_normals = 0;
    for (const SurfaceSample& s : view.surface) {
      const Eigen::Vector3d p = q.conjugate() * (anchor + s.p_mm.cast<double>());
      EXPECT_LT(tree.distance_mm(p, 10), 0.01);
      // A box's normals are along its axes.
      const Eigen::Vector3d n = q.conjugate() * s.normal.cast<double>();
      wrong_normals += n.cwiseAbs().maxCoeff() < 0.98;
    }
    EXPECT_LE(wrong_normals, static_cast<int>(view.surface.size()) / 5);
    for (const Eigen::Vector3f& e : view.edges_mm)
      EXPECT_LT(tree.distance_mm(q.conjugate() * (anchor + e.cast<double>()), 10), 0.01);
  }
}

TEST(Training, AnyFirstSamplesAreSpreadOverTheView) {
  for (const View& view : l_shape_base().impl().views) {
    if (view.surface.size() < kSurfaceSamples) continue;
    Eigen::AlignedBox3f few, all;
    for (std::size_t i = 0; i < view.surface.size(); ++i) {
      all.extend(view.surface[i].p_mm);
      if (i < 16) few.extend(view.surface[i].p_mm);
    }
    EXPECT_GT(few.diagonal().norm(), 0.85F * all.diagonal().norm());
  }
}

TEST(Training, ThreadsDoNotChangeTheResultAndTheSeedDoes) {
  const auto file_of = [](int threads, std::uint64_t seed) {
    PartOptions options = few_rotations(150);
    options.seed = seed;
    const std::string path = testing::TempDir() + "threads.kb";
    EXPECT_TRUE(train(shapes::l_shape(), options, {}, nullptr, threads)->save(path));
    return *read_file(path);
  };
  const auto one = file_of(1, 1);
  EXPECT_TRUE(one == file_of(3, 1));
  EXPECT_FALSE(one == file_of(1, 2));
}

TEST(Training, VotesFindTheRotationThatIsSeen) {
  // Every pixel of a noisy view votes where its feature says; the anchor is known. The view itself, or one near it,
  // wins.
  const KnowledgeBase::Impl& part = l_shape_base().impl();
  const auto renderer = make_osmesa_renderer(part.mesh);
  std::mt19937 random(8);
  std::normal_distribution<float> noise(0, static_cast<float>(part.noise_mm));
  int first_right = 0, trials = 0;
  for (std::size_t truth = 3; truth < part.views.size(); truth += 41, ++trials) {
    const View& view = part.views[truth];
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = view.R_supply_object.cast<double>().toRotationMatrix();
    DepthImage image = window_around(part.mesh, T.linear(), part.pixel_mm, 20, {0.3, 0.1});
    renderer->render(T, image);
    const float floor_mm = view.lowest_mm + (view.R_supply_object * view.anchors_object_mm.front()).z();
    for (Eigen::Index i = 0; i < image.z_mm.size(); ++i) {
      float& z = image.z_mm.data()[i];
      z = (std::isnan(z) ? floor_mm : z) + noise(random);
    }
    const DepthImage smooth = smoothed(image, smoothing_jump_mm(part.noise_mm, part.pixel_mm));
    const auto features = features_of(smooth, {part.feature_tolerance_mm, part.feature_stride});
    const Eigen::Vector3d anchor = T * view.anchors_object_mm.front().cast<double>();
    std::vector<double> sum(part.views.size(), 0);
    for (std::size_t i = 0; i < features.size(); ++i) {
      if (features[i] >= kFeatureCount) continue;
      const auto cols = static_cast<std::size_t>(image.z_mm.cols());
      for (std::uint32_t k = part.offsets[features[i]]; k < part.offsets[features[i] + 1]; ++k) {
        const Vote& vote = part.votes[k];
        const double x = image.origin_mm.x() + (static_cast<double>(i % cols) + vote.dx) * part.pixel_mm;
        const double y = image.origin_mm.y() + (static_cast<double>(i / cols) + vote.dy) * part.pixel_mm;
        const double z = double{smooth.z_mm.data()[i]} + vote.dz * part.dz_quantum_mm;
        if ((Eigen::Vector3d(x, y, z) - anchor).norm() < 2.5 * part.pixel_mm) sum[vote.rotation] += vote.weight;
      }
    }
    const auto best = static_cast<std::size_t>(std::ranges::max_element(sum) - sum.begin());
    const double off = double{part.views[best].R_supply_object.angularDistance(view.R_supply_object)};
    first_right += off < 0.35;
  }
  EXPECT_GE(trials, 20);
  EXPECT_GE(first_right, trials * 8 / 10);
}

TEST(Training, WhatIsSeenEverywhereIsDropped) {
  std::vector<std::vector<RawVote>> of_view(40);
  for (std::size_t v = 0; v < of_view.size(); ++v) {
    of_view[v].push_back({5, {1, 2, 3, 0, 256}});                                         // in every view
    of_view[v].push_back({static_cast<std::uint32_t>(100 + v % 20), {4, 5, 6, 0, 256}});  // in two of them
  }
  const VoteTable table = build_votes(of_view, 10, 100);
  ASSERT_EQ(table.offsets.size(), kFeatureCount + 1);
  EXPECT_EQ(table.offsets[6] - table.offsets[5], 0U);
  EXPECT_EQ(table.votes.size(), 40U);
  EXPECT_EQ(table.offsets[101] - table.offsets[100], 2U);
  EXPECT_EQ(table.votes[table.offsets[100]].rotation, 0);
  EXPECT_EQ(table.votes[table.offsets[100] + 1].rotation, 20);
  // Rarer weighs more, and of a view the heaviest stay.
  const VoteTable all = build_votes(of_view, 1000, 100);
  EXPECT_GT(all.votes[all.offsets[100]].weight, all.votes[all.offsets[5]].weight);
  const VoteTable one_each = build_votes(of_view, 1000, 1);
  EXPECT_EQ(one_each.votes.size(), 40U);
  EXPECT_EQ(one_each.offsets[6] - one_each.offsets[5], 0U);
}

TEST(Training, ThePlaneIsNoFeatureOfIt) {
  const KnowledgeBase::Impl& part = l_shape_base().impl();
  EXPECT_EQ(part.offsets[kPlaneFeature + 1] - part.offsets[kPlaneFeature], 0U);
  EXPECT_GT(part.votes.size(), 20 * part.views.size());
  EXPECT_EQ(part.views.size(), 1000U);
}

TEST(Training, RefusesWhatItCannotTrain) {
  const auto text = [](const Mesh& mesh, const PartOptions& options) {
    const auto base = train(mesh, options, {}, nullptr, 1);
    return base ? std::string("trained") : base.error().text;
  };
  EXPECT_NE(text({}, few_rotations(10)).find("holds no triangle"), std::string::npos);
  Mesh metres = shapes::l_shape();
  for (Eigen::Vector3f& v : metres.vertices_mm) v *= 1e-3F;
  EXPECT_NE(text(metres, few_rotations(10)).find("check mesh_unit"), std::string::npos);
  for (Eigen::Vector3f& v : metres.vertices_mm) v *= 1e6F;
  EXPECT_NE(text(metres, few_rotations(10)).find("check mesh_unit"), std::string::npos);
  PartOptions fine = few_rotations(10);
  fine.pixel_mm = 0.001;
  EXPECT_NE(text(shapes::l_shape(), fine).find("pixel_mm"), std::string::npos);
}

TEST(Training, FiveTrianglesAndARevolutionTrain) {
  Mesh wedge;
  wedge.vertices_mm = {{0, 0, 0}, {80, 0, 0}, {0, 60, 0}, {0, 0, 40}, {80, 60, 10}};
  wedge.triangles = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 4, 3}, {2, 3, 4}};
  EXPECT_TRUE(train(wedge, few_rotations(60), {}, nullptr, 1));
  TrainingSummary summary;
  double last = 0;
  PartOptions options = few_rotations(2000);
  const auto base = train(
      shapes::turned({{0, 30.0F}, {60, 5.0F}}, 64), options, [&](TrainingProgress p) { last = p.fraction; }, &summary,
      1);
  ASSERT_TRUE(base);
  EXPECT_EQ(summary.symmetry.kind, Symmetry::Kind::Revolution);
  EXPECT_EQ(last, 1);
  EXPECT_EQ(summary.rotations, static_cast<int>(base->impl().views.size()));
  EXPECT_GT(summary.mib, 2);
}
}  // namespace
}  // namespace binpick::vision
