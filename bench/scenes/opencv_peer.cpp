#include "bench/scenes/opencv_peer.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/surface_matching.hpp>
#include <opencv2/surface_matching/ppf_helpers.hpp>

#include "bench/scenes/classes.hpp"
#include "tests/emulators/scanner/phase_shift.hpp"

namespace binpick::bench {
namespace {
namespace ppf = cv::ppf_match_3d;
using SteadyClock = std::chrono::steady_clock;

constexpr double kSampling = 0.05;
constexpr double kReferences = 1.0 / 5;
constexpr int kModelPoints = 5000, kIcpPoints = 1000;
constexpr int kNormalNeighbours = 12;
/// Votes are made a score between 0 and 1; any rising function gives the same average precision.
constexpr double kHalfVotes = 1000;
/// More poses than there are parts in any supply; ICP takes its time for each.
constexpr std::size_t kPosesMax = 40;

double seconds_since(SteadyClock::time_point from) {
  return std::chrono::duration<double>(SteadyClock::now() - from).count();
}

/// Points with normals, strewn evenly over the surface.
cv::Mat model_of(const vision::Mesh& mesh) {
  std::vector<double> area;
  double sum = 0;
  const auto corner = [&](std::size_t t, std::size_t k) { return mesh.vertices_mm[mesh.triangles[t][k]]; };
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    area.push_back(sum += 0.5 * (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0)).norm());
  emulators::Random random{11};
  cv::Mat model(kModelPoints, 6, CV_32F);
  for (int i = 0; i < kModelPoints; ++i) {
    const auto t = static_cast<std::size_t>(std::ranges::lower_bound(area, random.uniform() * sum) - area.begin());
    auto u = static_cast<float>(random.uniform()), v = static_cast<float>(random.uniform());
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const Eigen::Vector3f e = corner(t, 1) - corner(t, 0), f = corner(t, 2) - corner(t, 0);
    const Eigen::Vector3f p = corner(t, 0) + u * e + v * f, n = e.cross(f).normalized();
    for (int k = 0; k < 3; ++k) model.at<float>(i, k) = p[k], model.at<float>(i, 3 + k) = n[k];
  }
  return model;
}

/// One point for each cube of this edge, with the mean normal. The library's own sampling cuts each axis into as many
/// pieces, however long it is: a flat scene would keep most of its points, and matching take minutes.
cv::Mat sampled(const cv::Mat& cloud, double edge_mm) {
  using Vector6f = Eigen::Matrix<float, 6, 1>;
  std::map<std::array<int, 3>, std::pair<Vector6f, int>> cubes;
  for (int i = 0; i < cloud.rows; ++i) {
    const Vector6f row = Eigen::Map<const Vector6f>(cloud.ptr<float>(i));
    if (!row.allFinite()) continue;
    std::array<int, 3> cube{};
    for (int k = 0; k < 3; ++k) cube[static_cast<std::size_t>(k)] = static_cast<int>(std::floor(row[k] / edge_mm));
    auto& [sum, n] = cubes.try_emplace(cube, Vector6f::Zero(), 0).first->second;
    sum += row;
    ++n;
  }
  cv::Mat kept(static_cast<int>(cubes.size()), 6, CV_32F);
  int row = 0;
  for (const auto& [cube, points] : cubes) {
    Eigen::Map<Vector6f> mean{kept.ptr<float>(row++)};
    mean = points.first / static_cast<float>(points.second);
    mean.tail<3>().normalize();
  }
  return kept;
}

Eigen::Isometry3d iso_of(const cv::Matx44d& pose) {
  Eigen::Matrix3d R;
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) R(r, c) = pose(r, c);
    T.translation()[r] = pose(r, 3);
  }
  T.linear() = Eigen::Quaterniond{R}.normalized().toRotationMatrix();
  return T;
}
}  // namespace

struct OpencvPeer::Impl {
  const Judge& judge;
  const ClassSetting& setting;
  cv::Mat model;
  mutable ppf::PPF3DDetector detector{kSampling, kSampling};
  double training_s = 0;
};

OpencvPeer::OpencvPeer(const ScenePart& part, const Judge& judge)
    : impl_{new Impl{judge, setting_of(part.scanner), model_of(part.body.mesh)}} {
  const auto begin = SteadyClock::now();
  impl_->detector.trainModel(impl_->model);
  impl_->training_s = seconds_since(begin);
}
OpencvPeer::~OpencvPeer() = default;

bool OpencvPeer::built() { return true; }
double OpencvPeer::training_s() const { return impl_->training_s; }

void OpencvPeer::detect(const std::vector<Eigen::Vector3f>& points, SceneLine& line) const {
  const vision::ScannerFigures& figures = vision::figures_of(impl_->setting.scanner);
  const auto half = (0.5 * impl_->setting.supply_mm.head<2>()).cast<float>().eval();
  const auto above = static_cast<float>(3 * figures.noise_mm + 0.02 * impl_->judge.diameter_mm());
  const auto begin = SteadyClock::now();
  std::vector<Eigen::Vector3f> inside;
  for (const Eigen::Vector3f& p : points)
    if (p.z() > above && std::abs(p.x()) < half.x() - above && std::abs(p.y()) < half.y() - above) inside.push_back(p);
  if (static_cast<int>(inside.size()) > kNormalNeighbours) {
    cv::Mat cloud(static_cast<int>(inside.size()), 3, CV_32F), scene;
    for (int i = 0; i < cloud.rows; ++i)
      for (int k = 0; k < 3; ++k) cloud.at<float>(i, k) = inside[static_cast<std::size_t>(i)][k];
    ppf::computeNormalsPC3d(cloud, scene, kNormalNeighbours, true,
                            cv::Vec3f(0, 0, static_cast<float>(figures.stand_off_mm)));
    std::vector<ppf::Pose3DPtr> poses;
    // As dense as the model. The library takes the step relative to the scene's extent.
    const double step_mm = kSampling * impl_->judge.diameter_mm();
    const cv::Mat sparse = sampled(scene, step_mm);
    impl_->detector.match(sparse, poses, kReferences, step_mm / impl_->setting.supply_mm.head<2>().maxCoeff());
    poses.resize(std::min(poses.size(), kPosesMax));
    ppf::ICP icp(50, 0.005F, 2.5F, 4);
    if (!poses.empty()) icp.registerModelToScene(impl_->model.rowRange(0, kIcpPoints).clone(), sparse, poses);
    std::ranges::stable_sort(poses, {}, [](const ppf::Pose3DPtr& p) { return -static_cast<double>(p->numVotes); });
    for (const ppf::Pose3DPtr& pose : poses) {
      DetectionLine detection;
      detection.T_supply_object = iso_of(pose->pose);
      if (!detection.T_supply_object.matrix().allFinite()) continue;
      const auto votes = static_cast<double>(pose->numVotes);
      detection.score = votes / (votes + kHalfVotes);
      const bool again = std::ranges::any_of(line.detections, [&](const DetectionLine& other) {
        return impl_->judge.measure(true).distance_mm(other.T_supply_object, detection.T_supply_object) <
               impl_->judge.threshold_mm();
      });
      if (!again) line.detections.push_back(detection);
    }
  }
  line.time_ms = 1000 * seconds_since(begin);
  line.points = points.size();
}
}  // namespace binpick::bench
