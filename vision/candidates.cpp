#include "vision/candidates.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "vision/prepared.hpp"

namespace binpick::vision {
namespace {
/// A turned pose that explains less of what its first one does, as it stands, is not worth refining,
constexpr float kTurnedShare = 0.5F;
/// nor are more than so many of one candidate.
constexpr std::size_t kTurnedRefined = 2;
/// What was not measured speaks a little against a part there: it decides between poses that explain as much.
constexpr float kMissingWeight = 0.1F, kUnseenWeight = 0.5F;
}  // namespace

Finisher::Finisher(const Scene& scene, const KnowledgeBase::Impl& part, const Deadline& deadline,
                   const FinishOptions& options)
    : scene_{scene},
      part_{part},
      deadline_{deadline},
      options_{options},
      rasteriser_{prepared(part).rasteriser()},
      centroid_{part.mesh.centroid_mm().cast<float>()} {
  double sum = 0;
  for (const Eigen::Vector3f& v : part_.mesh.vertices_mm) sum += (v - centroid_).squaredNorm();
  radius_mm_ = std::sqrt(sum / std::max<double>(1, static_cast<double>(part_.mesh.vertices_mm.size())));
}

float Finisher::edge_gate_px(float pixels, double diameters) const {
  return std::max(pixels, static_cast<float>(diameters * part_.diameter_mm / scene_.pixel_mm));
}

std::vector<Template> Finisher::canvases() const {
  return std::vector<Template>(static_cast<std::size_t>(std::clamp(options_.threads, 1, 64)));
}

std::vector<float> Finisher::looked_at(const std::vector<Pose>& poses) const {
  const int every = glance_every(scene_, part_.diameter_mm);
  std::vector<Template> drawn = canvases();
  std::vector<float> evidence(poses.size(), 0);
  share(options_.threads, poses.size(), deadline_, [&](std::size_t i, int thread) {
    evidence[i] = glance(scene_, rasteriser_, poses[i], drawn[static_cast<std::size_t>(thread)], every);
  });
  return evidence;
}

Candidate Finisher::finished(Pose pose, Template& drawn) const {
  const float tolerance = tolerance_of(scene_);
  const std::size_t edge_points = options_.edges ? 160 : 0;
  Candidate candidate;
  RefineOptions options;
  options.steps = 5;
  options.gate_from_mm = std::max(2 * tolerance, static_cast<float>(0.03 * part_.diameter_mm));
  options.gate_to_mm = 2 * tolerance;
  options.edge_gate_from_px = edge_gate_px(4, 0.04);
  for (int round = 0; round < (options_.second_refinement ? 2 : 1); ++round) {
    rasteriser_.draw(pose.R, pose.t, scene_.pixel_mm, scene_.origin_mm, drawn);
    if (round > 0 && (candidate.test = dense_test(scene_, rasteriser_, pose, drawn)).evidence < 0) break;
    const ModelPoints points = model_points(scene_, rasteriser_, pose, drawn, 400, edge_points);
    candidate.information = refine(scene_, points, pose.R * centroid_ + pose.t, options, pose);
    options.gate_from_mm = options.gate_to_mm = std::max(3.5F * static_cast<float>(scene_.noise_mm), tolerance);
    options.edge_gate_from_px = 2;
    options.single_heights = true;
  }
  candidate.pose = pose;
  if (candidate.test.evidence < 0) return candidate;  // hopeless
  rasteriser_.draw(pose.R, pose.t, scene_.pixel_mm, scene_.origin_mm, drawn);
  candidate.test = dense_test(scene_, rasteriser_, pose, drawn);
  const Absent absent = absent_pixels(scene_, *shadows_, rasteriser_, pose.R, drawn);
  candidate.test.holes = absent.holes;
  candidate.test.unseen = absent.unseen;
  candidate.test.ends = absent.ends;
  candidate.test.evidence -= kMissingWeight * static_cast<float>(candidate.test.missing - absent.holes) +
                             kUnseenWeight * static_cast<float>(candidate.test.unseen);
  candidate.evidence = evidence_of(candidate.test);
  candidate.evidence[Clue::Looseness] = looseness_of(candidate);
  return candidate;
}

void Finisher::add_turned(std::vector<Candidate>& candidates, std::size_t most, double same_mm) const {
  std::vector<Candidate> strongest;
  for (const Candidate& c : candidates) {
    if (strongest.size() >= most) break;
    const bool again = std::any_of(strongest.begin(), strongest.end(), [&](const Candidate& other) {
      return displacement_mm(other.pose, c.pose, part_.symmetry, radius_mm_) < same_mm;
    });
    if (!again) strongest.push_back(c);
  }
  const std::vector<Eigen::Matrix3f> turns = principal_turns();
  if (turns.empty()) return;
  std::vector<Pose> poses;
  for (const Candidate& c : strongest)
    for (const Eigen::Matrix3f& turn : turns) {
      const Eigen::Vector3f centre = c.pose.R * centroid_ + c.pose.t;
      const Eigen::Matrix3f R = c.pose.R * turn;
      poses.push_back({R, centre - R * centroid_});
    }
  const std::vector<float> evidence = looked_at(poses);
  std::vector<Pose> near;
  for (std::size_t k = 0; k < strongest.size(); ++k) {
    std::vector<std::size_t> order(turns.size());
    for (std::size_t i = 0; i < turns.size(); ++i) order[i] = k * turns.size() + i;
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return evidence[a] > evidence[b]; });
    for (std::size_t i = 0; i < std::min(kTurnedRefined, order.size()); ++i)
      if (evidence[order[i]] > kTurnedShare * strongest[k].test.evidence) near.push_back(poses[order[i]]);
  }
  std::vector<Candidate> turned(near.size());
  std::vector<Template> drawn = canvases();
  share(options_.threads, near.size(), deadline_,
        [&](std::size_t i, int thread) { turned[i] = finished(near[i], drawn[static_cast<std::size_t>(thread)]); });
  for (const Candidate& c : turned)
    if (c.test.evidence > 0) candidates.push_back(c);
}

std::array<Finisher::Principal, 3> Finisher::principal_axes() const {
  constexpr double kNearlyRound = 0.8;
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3f& v : part_.mesh.vertices_mm) {
    const Eigen::Vector3d d = (v - centroid_).cast<double>();
    spread += d * d.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> principal(spread);
  std::array<Principal, 3> axes;
  for (int axis = 0; axis < 3; ++axis) {
    const double a = principal.eigenvalues()[(axis + 1) % 3], b = principal.eigenvalues()[(axis + 2) % 3];
    axes[static_cast<std::size_t>(axis)] = {principal.eigenvectors().col(axis).normalized(),
                                            std::min(a, b) > kNearlyRound * std::max(a, b)};
  }
  return axes;
}

Eigen::Isometry3d Finisher::turned(const Eigen::Vector3d& axis, double angle_rad) const {
  const Eigen::Vector3d centroid = centroid_.cast<double>();
  Eigen::Isometry3d moved = Eigen::Isometry3d::Identity();
  moved.linear() = Eigen::AngleAxisd(angle_rad, axis).toRotationMatrix();
  moved.translation() = centroid - moved.linear() * centroid;
  return moved;
}

/// Quarter turns about the principal axes; steps of 15 degrees about an axis that the part is nearly round about (a
/// wheel's spokes are found by the next edge only). None that the symmetry makes another's equal.
std::vector<Eigen::Matrix3f> Finisher::principal_turns() const {
  constexpr double kStepRad = std::numbers::pi / 12;
  std::vector<Eigen::Isometry3d> distinct{Eigen::Isometry3d::Identity()};
  for (const Principal& principal : principal_axes()) {
    const int steps = principal.nearly_round ? 1 : 6;
    for (int k = steps; k < 24; k += steps) {
      const Eigen::Isometry3d moved = turned(principal.axis, kStepRad * k);
      const bool again = std::any_of(distinct.begin(), distinct.end(), [&](const Eigen::Isometry3d& other) {
        const PoseDistance d = pose_distance(other, moved, part_.symmetry, radius_mm_);
        return d.angle_rad < 0.1 && d.centroid_mm < 0.05 * part_.diameter_mm;
      });
      if (!again) distinct.push_back(moved);
    }
  }
  std::vector<Eigen::Matrix3f> turns;
  for (std::size_t k = 1; k < distinct.size(); ++k) turns.push_back(distinct[k].linear().cast<float>());
  return turns;
}

void Finisher::weigh_turns(std::vector<Candidate*> candidates, const std::function<bool(const Pose&)>& possible) const {
  constexpr std::array<double, 9> kFanDeg{3, 6, 11, 19, 32, 52, 85, 130, 180};
  std::vector<Fan> fans;
  for (const Principal& principal : principal_axes()) {
    if (!principal.nearly_round) continue;
    Fan fan{principal.axis, {0}};
    for (const double degrees : kFanDeg)
      for (const double sign : {-1.0, 1.0}) {
        const double angle = sign * degrees * std::numbers::pi / 180;
        // Beyond half of the symmetry's turn it is nearer to the next equal pose.
        if (pose_distance(Eigen::Isometry3d::Identity(), turned(principal.axis, angle), part_.symmetry, radius_mm_)
                .angle_rad > 0.99 * std::abs(angle))
          fan.angles_rad.push_back(angle);
      }
    std::sort(fan.angles_rad.begin(), fan.angles_rad.end());
    if (fan.angles_rad.size() > 1) fans.push_back(std::move(fan));
  }
  if (fans.empty()) return;
  // What the deadline leaves unweighed may be turned anyhow.
  for (Candidate* candidate : candidates)
    for (const Fan& fan : fans) add_loose(*candidate, fan, fan.angles_rad.back() * fan.angles_rad.back() / 3);
  std::vector<Template> drawn = canvases();
  share(options_.threads, candidates.size(), deadline_, [&](std::size_t i, int thread) {
    Candidate weighed = *candidates[i];
    weighed.loose_turn_rad2.setZero();
    for (const Fan& fan : fans) weigh_turns(weighed, fan, possible, drawn[static_cast<std::size_t>(thread)]);
    *candidates[i] = weighed;
  });
}

void Finisher::add_loose(Candidate& candidate, const Fan& fan, double variance_rad2) {
  const Eigen::Vector3d axis = candidate.pose.R.cast<double>() * fan.axis;
  candidate.loose_turn_rad2 += variance_rad2 * axis * axis.transpose();
}

void Finisher::weigh_turns(Candidate& candidate, const Fan& fan, const std::function<bool(const Pose&)>& possible,
                           Template& drawn) const {
  // By how much noise makes evidence differ, over the root of the pixels.
  constexpr double kEvidenceNoise = 0.5;
  const auto turned_by = [&](double angle) {
    const Eigen::Matrix3f R = candidate.pose.R * Eigen::AngleAxisd(angle, fan.axis).toRotationMatrix().cast<float>();
    return Pose{R, candidate.pose.R * centroid_ + candidate.pose.t - R * centroid_};
  };
  std::vector<double> evidence(fan.angles_rad.size());
  // Of a large picture every second pixel tells it, in a quarter of the time.
  const int every = std::min(2, glance_every(scene_, part_.diameter_mm));
  const auto look = [&] {
    for (std::size_t k = 0; k < evidence.size(); ++k)
      evidence[k] = static_cast<double>(glance(scene_, rasteriser_, turned_by(fan.angles_rad[k]), drawn, every));
    return static_cast<std::size_t>(std::max_element(evidence.begin(), evidence.end()) - evidence.begin());
  };
  std::size_t best = look();
  for (int again = 0; again < 2 && fan.angles_rad[best] != 0; ++again) {
    const Candidate other = finished(turned_by(fan.angles_rad[best]), drawn);
    if (other.test.evidence <= candidate.test.evidence || !possible(other.pose)) break;
    candidate.pose = other.pose;
    candidate.test = other.test;
    candidate.information = other.information;
    // What other poses say of it stays.
    Evidence told = other.evidence;
    for (std::size_t k = static_cast<std::size_t>(Clue::Claimed); k < kClueNames.size(); ++k)
      told.clues[k] = candidate.evidence.clues[k];
    candidate.evidence = told;
    best = look();
  }
  if (evidence[best] <= 0) return;
  double weights = 0, squares = 0;
  for (std::size_t k = 0; k < evidence.size(); ++k) {
    const double width = fan.angles_rad[std::min(k + 1, evidence.size() - 1)] - fan.angles_rad[k == 0 ? 0 : k - 1];
    const double weight =
        width * std::exp((evidence[k] - evidence[best]) / (kEvidenceNoise * std::sqrt(evidence[best])));
    weights += weight;
    squares += weight * fan.angles_rad[k] * fan.angles_rad[k];
  }
  add_loose(candidate, fan, squares / weights);
}

Matrix6 Finisher::covariance_of(const Candidate& candidate) const {
  // Single points are fewer than pixels where holes were filled; the scanner's own error is common to all of them.
  constexpr double kCorrelation = 2.0;
  constexpr double kCommonShare = 0.1;
  Matrix6 prior = Matrix6::Zero();
  prior.diagonal().head<3>().setConstant(1 / std::pow(0.1 * part_.diameter_mm, 2));
  prior.diagonal().tail<3>().setConstant(1 / std::pow(0.3, 2));
  Matrix6 covariance = (candidate.information / kCorrelation + prior).inverse();
  covariance.diagonal().head<3>().array() += std::pow(kCommonShare * scene_.noise_mm, 2);
  covariance.bottomRightCorner<3, 3>() += candidate.loose_turn_rad2;
  return 0.5 * (covariance + covariance.transpose());
}

float Finisher::looseness_of(const Candidate& candidate) const {
  const Matrix6 covariance = covariance_of(candidate);
  double turn = covariance.bottomRightCorner<3, 3>().trace();
  if (part_.symmetry.kind == Symmetry::Kind::Revolution || part_.symmetry.kind == Symmetry::Kind::RevolutionFlip) {
    const Eigen::Vector3d axis = candidate.pose.R.cast<double>() * part_.symmetry.axis;  // turning about it is nothing
    turn -= axis.dot(covariance.bottomRightCorner<3, 3>() * axis);
  }
  const double variance = covariance.topLeftCorner<3, 3>().trace() + 2.0 / 3.0 * radius_mm_ * radius_mm_ * turn;
  return static_cast<float>(0.5 * std::log10(std::max(1e-12, variance / (part_.diameter_mm * part_.diameter_mm))));
}
}  // namespace binpick::vision
