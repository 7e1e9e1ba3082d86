#include "vision/score.hpp"

#include <cmath>
#include <gtest/gtest.h>
#include <limits>

#include "vision/shadows.hpp"

namespace binpick::vision {
namespace {
/// What a pose looks like that lies open and fits.
DenseTest good_test() {
  DenseTest test;
  test.pixels = 1000;
  test.explained = 900;
  test.occluded = 100;
  test.fit = 0.95F;
  test.edges_found = 100;
  test.edges_missing = 5;
  test.normal_agreement = 0.97F;
  test.bend_agreement = 0.7F;
  return test;
}

Evidence good_evidence() {
  Evidence evidence = evidence_of(good_test());
  evidence[Clue::Looseness] = -2.3F;
  return evidence;
}

TEST(Score, FallsWithWhatSpeaksAgainst) {
  const double good = score_of(good_evidence());
  EXPECT_GT(good, 0.95);
  const auto with = [](Clue clue, float value) {
    Evidence evidence = good_evidence();
    evidence[clue] = value;
    return score_of(evidence);
  };
  EXPECT_LT(with(Clue::Contradicted, 0.2F), good - 0.02);
  EXPECT_LT(with(Clue::Edges, 0.2F), good - 0.02);
  EXPECT_LT(with(Clue::Looseness, -0.5F), good - 0.02);
  EXPECT_LT(with(Clue::Normals, 0.3F), good);
}

TEST(Score, ARivalThatExplainsAsMuchIsACoin) {
  EXPECT_DOUBLE_EQ(against_rival(1, 0.01), 0.5);
  EXPECT_GT(against_rival(0.9, 0.01), 0.99);
  Evidence evidence = good_evidence();
  evidence[Clue::Rival] = 1;
  EXPECT_LE(score_of(evidence), 0.5);
}

TEST(Score, ASupplyThatIsMostlySomethingElseRarelyHoldsThePart) {
  const auto with_known = [](float known) {
    Evidence evidence = good_evidence();
    evidence[Clue::Known] = known;
    return score_of(evidence);
  };
  EXPECT_DOUBLE_EQ(with_known(0.9F), with_known(0.5F)) << "other objects may lie deep";
  EXPECT_LT(with_known(0.2F), with_known(0.5F));
  EXPECT_LT(with_known(0.05F), 0.5) << "bricks of which one looks like the part";
}

TEST(Score, TermsOfAnythingAreFinite) {
  for (const double term : terms_of(Evidence{})) EXPECT_TRUE(std::isfinite(term));
  for (const double by_itself : {0.0, 1.0})
    for (const double term : second_terms(by_itself, 0)) EXPECT_TRUE(std::isfinite(term));
}

/// 60 × 60 pixels of 1 mm at a height of 10, nothing measured at x = 40 … 49, and a post of 60 mm at x = 30.
Scene scene_with_a_hole(bool post) {
  Scene scene;
  scene.pixel_mm = 1;
  scene.z_mm = Grid<float>::Constant(60, 60, 10);
  scene.z_mm.middleCols(40, 10).setConstant(std::numeric_limits<float>::quiet_NaN());
  if (post) scene.z_mm.col(30).setConstant(60);
  return scene;
}

TEST(Shadows, ReachAsFarAsTheSlantAllows) {
  const Scene scene = scene_with_a_hole(true);
  const Shadows shadows{scene, {}};
  // 50 mm above, seen past a slant of 0.4: 20 mm beside the post.
  EXPECT_TRUE(shadows.may_hide(30, 44, 10));
  EXPECT_FALSE(shadows.may_hide(30, 44, 50));
  EXPECT_FALSE(shadows.may_hide(30, 56, 10.5F));
  EXPECT_FALSE((Shadows{scene_with_a_hole(false), {}}.may_hide(30, 44, 10.5F)));
}

TEST(Shadows, AWallHidesWhatLiesBesideIt) {
  Scene scene = scene_with_a_hole(false);
  scene.origin_mm = {-29.5, -29.5};
  const Shadows shadows{scene, {{60, 60, 40}}};
  EXPECT_TRUE(shadows.may_hide(30, 50, 10));  // 10 mm from a wall that is 30 mm higher
  EXPECT_FALSE(shadows.may_hide(30, 50, 30));
  EXPECT_FALSE(shadows.may_hide(30, 30, 10.5F));
}

/// Of a plate of 50 × 50 mm, at a height of 20, from x = y = 5 on.
Absent absent_of_plate(const Scene& scene) {
  Mesh plate;
  plate.vertices_mm = {{0, 0, 20}, {50, 0, 20}, {50, 50, 20}, {0, 50, 20}};
  plate.triangles = {{0, 1, 2}, {0, 2, 3}};
  const Rasteriser part{plate};
  Template drawn;
  part.draw(Eigen::Matrix3f::Identity(), Eigen::Vector3f(5, 5, 0), scene.pixel_mm, scene.origin_mm, drawn);
  return absent_pixels(scene, Shadows{scene, {}}, part, Eigen::Matrix3f::Identity(), drawn);
}

TEST(Shadows, WhatNothingHidesIsUnseen) {
  EXPECT_NEAR(absent_of_plate(scene_with_a_hole(false)).unseen, 10 * 51, 60);
  // The post hides 16 mm of the plate beside it, to the cell: three or four of the ten columns are left.
  EXPECT_NEAR(absent_of_plate(scene_with_a_hole(true)).unseen, 3.5 * 51, 51);
}

TEST(Shadows, ASurfaceThatEndsWithinThePartIsAShorterBody) {
  Scene scene;
  scene.pixel_mm = 1;
  scene.noise_mm = 0.1;
  scene.jump_mm = 2;
  scene.z_mm = Grid<float>::Constant(60, 60, 20);
  EXPECT_EQ(absent_of_plate(scene).ends, 0);
  scene.z_mm.rightCols(25).setConstant(0);  // one sees past it: x = 35 and on
  EXPECT_NEAR(absent_of_plate(scene).ends, 41, 2);
  scene.z_mm.rightCols(25).setConstant(std::numeric_limits<float>::quiet_NaN());  // nothing measured, and nothing hides
  EXPECT_NEAR(absent_of_plate(scene).ends, 41, 2);
  scene.z_mm.middleCols(37, 3).setConstant(120);  // something high does
  EXPECT_LT(absent_of_plate(scene).ends, 10);
  scene.z_mm.setConstant(20);
  for (int col = 10; col < 50; col += 6)  // a sparse scan
    scene.z_mm.middleCols(col, 4).setConstant(std::numeric_limits<float>::quiet_NaN());
  EXPECT_EQ(absent_of_plate(scene).ends, 0);
  EXPECT_EQ(absent_of_plate(scene).unseen, 0);
  scene.z_mm.setConstant(20);
  scene.z_mm(30, 30) = scene.z_mm(31, 40) = 0;  // single pixels are noise
  EXPECT_EQ(absent_of_plate(scene).ends, 0);
  scene.z_mm.rightCols(7).setConstant(0);  // as does an edge two pixels from the part's own
  EXPECT_EQ(absent_of_plate(scene).ends, 0);
}
}  // namespace
}  // namespace binpick::vision
