#include "vision/overlaps.hpp"

#include <gtest/gtest.h>

#include "tests/unit/detect/shapes.hpp"

namespace binpick::vision {
namespace {
constexpr double kPixelMm = 0.5;

/// Of bars of 60 × 20 × 20 mm with their middles there.
std::vector<double> overlaps_of(const std::vector<Eigen::Vector3d>& at) {
  Mesh bar;
  shapes::add_box(bar, {-30, -10, -10}, {30, 10, 10});
  std::vector<Detection> detections;
  for (const Eigen::Vector3d& t : at) detections.emplace_back().T_supply_object.iso.translation() = t;
  return overlaps_mm(Rasteriser{bar}, detections, kPixelMm);
}
}  // namespace

TEST(Overlaps, AreAsWideAsTheStripThatIsCovered) {
  for (const double over : {0.0, 1.0, 3.0, 8.0}) {
    const auto found = overlaps_of({{5, -40, 10}, {15, -20 - over, 30}});
    EXPECT_NEAR(found[0], over, kPixelMm) << over;
    EXPECT_EQ(found[1], 0) << "the upper one can be lifted";
  }
}

TEST(Overlaps, TheWidestOfAllThatLieOnIt) {
  const auto found = overlaps_of({{0, 0, 10}, {0, 18, 31}, {54, 0, 31}, {0, 100, 10}});
  EXPECT_NEAR(found[0], 6, kPixelMm);
  EXPECT_EQ(found[3], 0);
}

TEST(Overlaps, LevelNeighboursAreNone) {
  const auto found = overlaps_of({{0, 0, 10}, {0, 19.5, 10}});
  EXPECT_LE(found[0], kPixelMm) << "their poses are not exact";
  EXPECT_LE(found[1], kPixelMm);
  EXPECT_TRUE(overlaps_of({}).empty());
}

/// A ring of bars, each with one end on the next: none is free.
TEST(Overlaps, InARingEachIsCovered) {
  Mesh bar;
  shapes::add_box(bar, {-30, -10, -10}, {30, 10, 10});
  std::vector<Detection> detections(4);
  for (int k = 0; k < 4; ++k) {
    const Eigen::AngleAxisd turn{k * M_PI / 2, Eigen::Vector3d::UnitZ()};
    auto& T = detections[static_cast<std::size_t>(k)].T_supply_object.iso;
    T.linear() = turn.toRotationMatrix() * Eigen::AngleAxisd{-0.4, Eigen::Vector3d::UnitY()};
    T.translation() = turn * Eigen::Vector3d{0, 20, 0} + Eigen::Vector3d{0, 0, 30};
  }
  for (const double each : overlaps_mm(Rasteriser{bar}, detections, kPixelMm)) EXPECT_GT(each, 5);
}
}  // namespace binpick::vision
