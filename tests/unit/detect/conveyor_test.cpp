#include <gtest/gtest.h>
#include <limits>
#include <numbers>

#include "tests/unit/detect/scenes.hpp"
#include "vision/knowledge_base_impl.hpp"
#include "vision/resting.hpp"

/// picking = "conveyor": objects that lie by themselves on a belt.
namespace binpick::vision {
namespace {
constexpr double kDegree = std::numbers::pi / 180;

const KnowledgeBase& belt_base() {
  static const KnowledgeBase base = [] {
    PartOptions options;
    options.name = "bracket";
    options.scanner = ScannerClass::Lms400;
    options.pixel_mm = 3.0;
    options.rotations = 5000;
    options.picking = Picking::Conveyor;
    return *train(shapes::bracket(), options, {}, nullptr);
  }();
  return base;
}

const std::vector<RestingPose>& resting() {
  const Mesh& mesh = belt_base().mesh();
  static const auto poses = resting_poses(mesh, belt_base().symmetry(), 0.01 * mesh.diameter_mm(), 4 * kDegree);
  return poses;
}

/// The part in one of its resting poses, turned, at (x, y) on the belt.
Eigen::Isometry3d lying(const RestingPose& pose, double turn_rad, double x_mm, double y_mm) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = (Eigen::AngleAxisd(turn_rad, Eigen::Vector3d::UnitZ()) *
                Eigen::Quaterniond::FromTwoVectors(pose.down, -Eigen::Vector3d::UnitZ()))
                   .toRotationMatrix();
  double lowest = std::numeric_limits<double>::infinity();
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3f& v : belt_base().mesh().vertices_mm) {
    const Eigen::Vector3d p = T.linear() * v.cast<double>();
    lowest = std::min(lowest, p.z());
    middle += p / static_cast<double>(belt_base().mesh().vertices_mm.size());
  }
  T.translation() = Eigen::Vector3d(x_mm - middle.x(), y_mm - middle.y(), -lowest);
  return T;
}

TEST(Conveyor, KnowledgeBaseIsAtMostAFifthOfABinsAndHoldsRestingPosesOnly) {
  const auto& belt = belt_base().impl();
  EXPECT_LE(5 * belt.file.bytes.size(), scenes::bracket_base().impl().file.bytes.size());
  ASSERT_GE(resting().size(), 3U);
  for (const View& view : belt.views) {
    const Eigen::Vector3d down =
        view.R_supply_object.cast<double>().toRotationMatrix().transpose() * -Eigen::Vector3d::UnitZ();
    double least = 9;
    for (const RestingPose& pose : resting())
      least = std::min(least, std::atan2(down.cross(pose.down).norm(), down.dot(pose.down)));
    EXPECT_LT(least, 3.1 * kDegree);
  }
}

TEST(Conveyor, IsolatedObjectsAreAllFoundAndNothingElse) {
  std::mt19937 random{17};
  std::uniform_real_distribution<double> turn{0, 2 * std::numbers::pi}, off{-25, 25};
  int scene = 0;
  for (std::size_t first = 0; first < 3 * resting().size(); first += 4, ++scene) {
    std::vector<Eigen::Isometry3d> truth;
    for (int i = 0; i < 4; ++i)
      truth.push_back(lying(resting()[(first + static_cast<std::size_t>(i)) % resting().size()], turn(random),
                            (i % 2 == 0 ? -150 : 150) + off(random), (i / 2 == 0 ? -120 : 120) + off(random)));
    const DepthImage image = scenes::image_of(belt_base().mesh(), truth, static_cast<std::uint32_t>(scene));
    const DetectionReport report = detect(image, scenes::kSupply, belt_base(), scenes::options());
    std::size_t believed = 0;
    for (const Detection& d : report.detections) believed += d.score >= 0.5;
    EXPECT_EQ(believed, truth.size()) << "scene " << scene;
    for (const Eigen::Isometry3d& T : truth) {
      PoseDistance least{1e9, 1e9};
      for (const Detection& d : report.detections) {
        const PoseDistance distance = pose_distance(d.T_supply_object.iso, T, belt_base().symmetry(), 60);
        if (d.score >= 0.5 && distance.centroid_mm < least.centroid_mm) least = distance;
      }
      EXPECT_LT(least.centroid_mm, 2) << "scene " << scene;
      EXPECT_LT(least.angle_rad, 2 * kDegree) << "scene " << scene;
    }
  }
  EXPECT_GE(scene, 3);
}
}  // namespace
}  // namespace binpick::vision
