#include "bench/scenes/grasps.hpp"

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <map>
#include <memory>
#include <random>

#include "bench/scenes/precision.hpp"
#include "tests/emulators/world/ray_mesh.hpp"
#include "vision/clearance.hpp"
#include "vision/draw.hpp"

namespace binpick::bench {
namespace {
using Eigen::Vector3d;

/// Deeper than this the gripper hits.
constexpr double kTouchMm = 0.5;
/// A held object may push what it lies against by this share of the part's diameter.
constexpr double kPushDiameters = 0.015;
/// The offers that a cell may answer from one scan.
constexpr std::size_t kFirst = 3;

/// Of this thread: the choice is one thread's work, and the machine may be busy.
double cpu_ms() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) * 1e3 + static_cast<double>(now.tv_nsec) * 1e-6;
}

enum class Fate { Free, HitsPart, HitsWall, HitsNeighbour, PartHitsWall, PartHitsNeighbour };

/// Points spread over a surface, so far below it.
std::vector<Vector3d> points_below(const vision::Mesh& mesh, double apart_mm, double depth_mm) {
  std::vector<Vector3d> points;
  for (const auto& corners : mesh.triangles) {
    const Vector3d a = mesh.vertices_mm[corners[0]].cast<double>(), b = mesh.vertices_mm[corners[1]].cast<double>(),
                   c = mesh.vertices_mm[corners[2]].cast<double>();
    const Vector3d normal = (b - a).cross(c - a).normalized();
    const int n = std::max(1, static_cast<int>(std::ceil(std::max((b - a).norm(), (c - a).norm()) / apart_mm)));
    for (int i = 0; i <= n; ++i)
      for (int k = 0; k <= n - i; ++k) points.emplace_back(a + (b - a) * i / n + (c - a) * k / n - depth_mm * normal);
  }
  return points;
}

/// The pile as it is, and what happens in it.
class Exact {
 public:
  Exact(const ScenePart& part, const std::vector<ObjectPose>& poses)
      : mesh_{part.body.mesh},
        rays_{part.body.mesh},
        supply_{setting_of(part).supply_mm},
        poses_{poses},
        points_{points_below(part.body.mesh, 0.03 * part.body.mesh.diameter_mm(),
                             kPushDiameters * part.body.mesh.diameter_mm())} {
    for (const auto& v : mesh_.vertices_mm) own_.extend(v.cast<double>());
  }

  Fate fate(const vision::Gripper& gripper, const vision::Grasp& grasp, const Eigen::Isometry3d& T_supply_tcp,
            std::size_t object) const {
    const Eigen::Isometry3d& T = poses_[object].iso;
    vision::Grasp as_it_lies = grasp;
    as_it_lies.T_object_tcp.iso = T.inverse() * T_supply_tcp;
    if (vision::hits_part(gripper, as_it_lies, mesh_, kTouchMm)) return Fate::HitsPart;
    for (const vision::Swept& body : vision::room_of(gripper, grasp, T_supply_tcp, -0.5 * kTouchMm)) {
      if (outside(body)) return Fate::HitsWall;
      for (std::size_t other = 0; other < poses_.size(); ++other)
        if (other != object && meets(body, poses_[other].iso)) return Fate::HitsNeighbour;
    }
    return carried(T, -T_supply_tcp.linear().col(2), grasp.approach_mm, object);
  }

 private:
  bool outside(const vision::Swept& body) const {
    if (body.along(Vector3d::UnitZ()).least < -kTouchMm) return true;
    for (Eigen::Index axis = 0; axis < 2; ++axis) {
      const vision::Swept::Range across = body.along(Vector3d::Unit(axis)),
                                 beside = body.along(Vector3d::Unit(1 - axis));
      for (const double side : {-1.0, 1.0})
        for (double at = 0.5 * supply_[axis]; at < (side > 0 ? across.greatest : -across.least); at += 1)
          for (double along = beside.least; along <= beside.greatest; along += 1) {
            const vision::Swept::Span span = body.at(static_cast<float>(axis == 0 ? side * at : along),
                                                     static_cast<float>(axis == 0 ? along : side * at));
            if (!span.empty() && span.low < static_cast<float>(supply_.z())) return true;
          }
    }
    return false;
  }

  bool meets(const vision::Swept& body, const Eigen::Isometry3d& T) const {
    Eigen::AlignedBox3d box;
    for (int k = 0; k < 8; ++k) box.extend(T * own_.corner(static_cast<Eigen::AlignedBox3d::CornerType>(k)));
    Eigen::AlignedBox3d room;
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const vision::Swept::Range range = body.along(Vector3d::Unit(axis));
      room.min()[axis] = range.least, room.max()[axis] = range.greatest;
    }
    if (!box.intersects(room)) return false;
    for (const auto& corners : mesh_.triangles) {
      std::array<Vector3d, 3> triangle;
      Eigen::AlignedBox3d around;
      for (std::size_t k = 0; k < 3; ++k) around.extend(triangle[k] = T * mesh_.vertices_mm[corners[k]].cast<double>());
      if (around.intersects(room) && body.meets(triangle)) return true;
    }
    return false;
  }

  /// Whether a point on its way enters the object at T.
  bool enters(const Vector3d& from, const Vector3d& way, double length_mm, const Eigen::Isometry3d& T) const {
    const Eigen::Vector3f along = (T.linear().transpose() * way).cast<float>();
    const auto hit = rays_.cast((T.inverse() * from).cast<float>(), along, static_cast<float>(length_mm));
    return hit && rays_.normal(hit->triangle).dot(along) < 0;
  }

  Fate carried(const Eigen::Isometry3d& T, const Vector3d& back, double approach_mm, std::size_t object) const {
    Eigen::AlignedBox3d swept;
    for (const Vector3d& p : points_)
      for (const double way : {0.0, approach_mm}) swept.extend(T * p + way * back);
    if (swept.min().z() < supply_.z())
      for (const Vector3d& p : points_) {
        const Vector3d start = T * p, end = start + approach_mm * back;
        for (Eigen::Index axis = 0; axis < 2; ++axis) {
          const double wall = 0.5 * supply_[axis] + 2 * kTouchMm;
          if (std::abs(end[axis]) > std::max(wall, std::abs(start[axis])) && end.z() < supply_.z())
            return Fate::PartHitsWall;
        }
      }
    constexpr double kHigh = 1000;
    swept.max().z() = kHigh;
    for (std::size_t other = 0; other < poses_.size(); ++other) {
      if (other == object) continue;
      Eigen::AlignedBox3d box;
      for (int k = 0; k < 8; ++k)
        box.extend(poses_[other].iso * own_.corner(static_cast<Eigen::AlignedBox3d::CornerType>(k)));
      if (!box.intersects(swept)) continue;
      // Points of either one on the other's way.
      for (const Vector3d& p : points_) {
        const Vector3d mine = T * p, its = poses_[other].iso * p;
        if (enters(mine, back, approach_mm, poses_[other].iso) ||
            enters(mine + approach_mm * back, Vector3d::UnitZ(), kHigh, poses_[other].iso) ||
            enters(its, -back, approach_mm, T))
          return Fate::PartHitsNeighbour;
        Eigen::Isometry3d T_up = T;
        T_up.translation() += approach_mm * back;
        if (enters(its, -Vector3d::UnitZ(), kHigh, T_up)) return Fate::PartHitsNeighbour;
      }
    }
    return Fate::Free;
  }

  const vision::Mesh& mesh_;
  emulators::RayMesh rays_;
  Vector3d supply_;
  const std::vector<ObjectPose>& poses_;
  std::vector<Vector3d> points_;
  Eigen::AlignedBox3d own_;
};

struct Tally {
  int scenes = 0, detections = 0, wrong = 0, offered = 0, first = 0, first_hits = 0, firsts = 0, firsts_hit = 0;
  int takeable = 0, missed = 0;
  std::map<Fate, int> fates;
  std::map<vision::Obstacle, int> missed_for;
  std::vector<double> ms;
};

const char* name_of(Fate fate) {
  switch (fate) {
    case Fate::Free:
      return "free";
    case Fate::HitsPart:
      return "itself";
    case Fate::HitsWall:
      return "wall or floor";
    case Fate::HitsNeighbour:
      return "neighbour";
    case Fate::PartHitsWall:
      return "part at wall";
    case Fate::PartHitsNeighbour:
      return "part at neighbour";
  }
  return "?";
}

void print(const std::string& name, const Tally& t) {
  const auto percent = [](int of, int all) { return 100.0 * of / std::max(1, all); };
  std::printf("| %s | %d | %d | %.1f | %.1f | %d | %.1f | %d | %.1f | %.1f | %.1f |", name.c_str(), t.scenes,
              t.detections, percent(t.first_hits, t.first), percent(t.firsts_hit, t.firsts), t.offered,
              percent(t.offered - (t.fates.contains(Fate::Free) ? t.fates.at(Fate::Free) : 0), t.offered), t.takeable,
              percent(t.missed, t.takeable), quantile(t.ms, 0.5), quantile(t.ms, 0.99));
  for (const auto& [fate, count] : t.fates)
    if (fate != Fate::Free) std::printf(" %s %d,", name_of(fate), count);
  std::printf(" | ");
  for (const auto& [why, count] : t.missed_for) std::printf(" %s %d,", to_string(why), count);
  std::printf(" |\n");
  std::fflush(stdout);
}

void one_scene(const ScenePart& part, const std::vector<vision::Grasp>& grasps, const std::vector<ObjectPose>& pile,
               const SceneId& id, const vision::KnowledgeBase& base, const RunOptions& options,
               const vision::ReachLimits& limits, const std::string& picture, Tally& tally) {
  const Scene scene = make_scene(part, pile, id, options.bias_mm, options.sparse);
  const vision::SupplyBox supply{scene.supply_mm};
  const vision::DepthImage image = depth_image_of(scene.points, base, supply);
  vision::DetectionReport report = vision::detect(image, supply, base, options.detector());
  std::erase_if(report.detections, [](const vision::Detection& d) { return d.score < 0.5; });
  const vision::GripperScene room{image, base.mesh(), base.noise_mm(), part.body.gripper};
  const double begin_ms = cpu_ms();
  const vision::GraspChoice choice = vision::choose_grasps(report, base.symmetry(), grasps, supply, limits, &room);
  tally.ms.push_back(cpu_ms() - begin_ms);
  ++tally.scenes;
  if (!picture.empty()) {
    const vision::Reachable* first = choice.reachable.empty() ? nullptr : &choice.reachable.front();
    const auto drawn = vision::draw_report(picture, image, base, report, first, &part.body.gripper,
                                           first != nullptr ? &grasps[first->grasp] : nullptr);
    if (!drawn) throw std::runtime_error{drawn.error()};
  }

  const Judge judge{part};
  const Exact exact{part, pile};
  // The object that a detection is of.
  std::vector<std::optional<std::size_t>> object(report.detections.size());
  for (std::size_t d = 0; d < object.size(); ++d) {
    double least = judge.threshold_mm();
    for (std::size_t o = 0; o < pile.size(); ++o) {
      const double distance = judge.measure(true).distance_mm(report.detections[d].T_supply_object.iso, pile[o].iso);
      if (distance < least) least = distance, object[d] = o;
    }
    ++tally.detections;
    if (!object[d]) ++tally.wrong;
  }
  std::size_t rank = 0;
  for (const vision::Reachable& offer : choice.reachable) {
    if (!object[offer.detection]) continue;
    const Fate fate =
        exact.fate(part.body.gripper, grasps[offer.grasp], offer.T_supply_grasp.iso, *object[offer.detection]);
    ++tally.offered;
    ++tally.fates[fate];
    tally.takeable += fate == Fate::Free;
    if (rank == 0) ++tally.first, tally.first_hits += fate != Fate::Free;
    if (rank < kFirst) ++tally.firsts, tally.firsts_hit += fate != Fate::Free;
    ++rank;
  }
  for (const vision::Unreachable& missed : choice.unreachable) {
    if (!object[missed.detection]) continue;
    // The first of those that would hit nothing.
    const vision::RejectedGrasp* takeable = nullptr;
    for (const vision::RejectedGrasp& rejected : choice.rejected) {
      if (rejected.detection != missed.detection || rejected.why <= vision::Obstacle::Reach) continue;
      const vision::Grasp& grasp = grasps[rejected.grasp];
      const Eigen::Isometry3d T =
          vision::poses_of(grasp, report.detections[missed.detection].T_supply_object, base.symmetry())[rejected.pose];
      if (exact.fate(part.body.gripper, grasp, T, *object[missed.detection]) != Fate::Free) continue;
      takeable = &rejected;
      break;
    }
    if (takeable == nullptr) continue;
    ++tally.takeable;
    ++tally.missed;
    ++tally.missed_for[takeable->why];
  }
}
}  // namespace

void grasps(const RunOptions& options, const RunSelection& selection, std::size_t scenes,
            const vision::ReachLimits& limits) {
  const Split& split = split_named(selection.split);
  std::printf(
      "| | scenes | detections | first offer hits %% | first %zu hit %% | offers | hit %% | could be taken | not "
      "offered "
      "%% | ms p50 | p99 | hits | not offered for |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
      kFirst);
  for (const ClassSetting& setting : class_settings())
    for (const std::string& name : selected_parts(setting, selection)) {
      const ScenePart part = scene_part(setting.scanner, name);
      if (!part.body.gripper.jaws) continue;
      std::vector<vision::Grasp> grasps;
      for (const emulators::ExampleGrasp& grasp : part.body.grasps) grasps.push_back(grasp.grasp());
      const vision::KnowledgeBase base = knowledge_base_of(part, options.base_file(part));
      Tally tally;
      for (std::size_t number = selection.shard; number < std::min(scenes, split.scenes());
           number += selection.shards) {
        const SceneId id = split.scene(number);
        const std::vector<ObjectPose> pile = taken_down(settled_pile(part, id.pile, options.piles), id.fill);
        std::string picture;
        if (const std::string to = options.picture_folder(); !to.empty()) {
          std::filesystem::create_directories(to);
          picture = to + "/" + std::string{setting.name} + "-" + name + "-" + std::to_string(number) + ".png";
        }
        one_scene(part, grasps, pile, id, base, options, limits, picture, tally);
      }
      print(std::string{setting.name} + ' ' + name, tally);
    }
}
}  // namespace binpick::bench
