#include "vision/overlaps.hpp"

#include <cmath>
#include <gtest/gtest.h>
#include <map>
#include <random>
#include <set>
#include <utility>

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

using Middles = std::map<std::pair<int, int>, float>;

/// Twice the middle of the height, by row and column: drawn from above and, turned over, from below.
Middles middles_of(const Rasteriser& part, const Eigen::Isometry3d& T) {
  const Eigen::Vector3f over{1, -1, -1};
  const Eigen::Matrix3f R = T.linear().cast<float>();
  const Eigen::Vector3f t = T.translation().cast<float>();
  Template upper, lower;
  part.draw(R, t, kPixelMm, Eigen::Vector2d::Zero(), upper);
  part.draw(over.asDiagonal() * R, over.asDiagonal() * t, kPixelMm, Eigen::Vector2d::Zero(), lower);
  Middles middles;
  for (int r = 0; r < upper.rows; ++r)
    for (int c = 0; c < upper.cols; ++c) {
      const int row = upper.row0 + r, col = upper.col0 + c, below = -row - lower.row0, beside = col - lower.col0;
      if (below < 0 || beside < 0 || below >= lower.rows || beside >= lower.cols) continue;
      const float middle = upper.top_mm[upper.at(r, c)] - lower.top_mm[lower.at(below, beside)];
      if (!std::isnan(middle)) middles[{row, col}] = middle;
    }
  return middles;
}

/// The side of the largest square, each one tried.
double square_mm(const Middles& object, const Middles& other) {
  const auto stands_over = [&](int row, int col) {
    const auto own = object.find({row, col}), its = other.find({row, col});
    return own != object.end() && its != other.end() && its->second > own->second;
  };
  int largest = 0;
  for (const auto& [at, middle] : object)
    for (bool grows = true; grows;) {
      for (int k = 0; k <= largest && grows; ++k)
        for (int l = 0; l <= largest && grows; ++l) grows = stands_over(at.first + k, at.second + l);
      largest += grows ? 1 : 0;
    }
  return kPixelMm * largest;
}
}  // namespace

TEST(Overlaps, AreThoseOfEveryPixelOfEveryPair) {
  Mesh bar;
  shapes::add_box(bar, {-30, -10, -10}, {30, 10, 10});
  const Rasteriser part{bar};
  std::mt19937 random{7};
  std::uniform_real_distribution<double> place{-40, 40}, unit{-1, 1};
  std::vector<Detection> detections(8);
  std::vector<Middles> middles;
  for (Detection& detection : detections) {
    auto& T = detection.T_supply_object.iso;
    T.linear() =
        Eigen::Quaterniond{unit(random), unit(random), unit(random), unit(random)}.normalized().toRotationMatrix();
    T.translation() = Eigen::Vector3d{place(random), place(random), 30 + 20 * unit(random)};
    middles.push_back(middles_of(part, T));
  }
  const auto found = overlaps_mm(part, detections, kPixelMm);
  int covered = 0;
  for (std::size_t a = 0; a < detections.size(); ++a) {
    double largest = 0;
    for (std::size_t b = 0; b < detections.size(); ++b)
      if (a != b) largest = std::max(largest, square_mm(middles[a], middles[b]));
    EXPECT_EQ(found[a], largest) << a;
    covered += largest > 0 ? 1 : 0;
  }
  EXPECT_GT(covered, 3);
}

TEST(Overlaps, ElsewhereAreThoseOfOneThatStandsThere) {
  Mesh bar;
  shapes::add_box(bar, {-30, -10, -10}, {30, 10, 10});
  const Rasteriser part{bar};
  std::vector<Detection> detections(3);
  const auto at = [&](std::size_t d) -> Eigen::Isometry3d& { return detections[d].T_supply_object.iso; };
  at(0).translation() = Eigen::Vector3d{0, 0, 10};
  at(1).translation() = Eigen::Vector3d{0, 12, 31};
  at(2).translation() = Eigen::Vector3d{90, 4, 31};
  const auto elsewhere = overlap_elsewhere(part, detections, kPixelMm);
  std::set<double> found;
  for (const double x : {0.0, 20.0, 60.0, 75.0, 130.0, 400.0}) {
    const Eigen::Isometry3d T{Eigen::Translation3d{x, -3, 14} * Eigen::AngleAxisd{0.3, Eigen::Vector3d::UnitX()}};
    auto moved = detections;
    moved[0].T_supply_object.iso = T;
    EXPECT_EQ(elsewhere(0, T), overlaps_mm(part, moved, kPixelMm)[0]) << x;
    found.insert(elsewhere(0, T));
  }
  EXPECT_GT(found.size(), 2U) << "all alike";
  EXPECT_EQ(elsewhere(0, at(0)), overlaps_mm(part, detections, kPixelMm)[0]) << "asked again";
}

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
