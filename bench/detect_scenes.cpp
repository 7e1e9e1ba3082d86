/// How right, how accurate and how fast detection is on emulated piles. Prints one line per scene and a summary;
/// docs/vision.md quotes it. All figures come from simulation.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <random>
#include <set>

#include "tests/emulators/world/example_parts.hpp"
#include "tests/emulators/world/pile.hpp"
#include "tests/emulators/world/world.hpp"
#include "vision/detector.hpp"
#include "vision/draw.hpp"
#include "vision/knowledge_base_impl.hpp"
#include "vision/rasteriser.hpp"
#include "vision/selection.hpp"

namespace {
using namespace binpick;
using Pose3 = Transform<frame::Supply, frame::Object>;

struct Arguments {
  std::string part = "track_link", cache = "build/piles", image;
  std::vector<double> fills{1.0};
  int count = 14, seeds = 10, first_seed = 1, threads = 2, hypotheses = 0;
  bool emptying = false, unknown_supply = false;
};

struct Setting {
  Eigen::Vector3d size_mm;
  double stand_off_mm;
  bool triangulation;
};
Setting setting_of(vision::ScannerClass scanner) {
  switch (scanner) {
    case vision::ScannerClass::Lms400:
      return {{1000, 800, 500}, 1800, false};
    case vision::ScannerClass::Lps36:
      return {{300, 300, 120}, 500, true};
    case vision::ScannerClass::Lps36Hi:
      return {{180, 180, 60}, 420, true};
  }
  return {{1000, 800, 500}, 1800, false};
}

std::vector<Pose3> settled(const emulators::ExamplePart& part, const Arguments& arguments, const Setting& setting,
                           std::uint64_t seed) {
  namespace fs = std::filesystem;
  const fs::path file = fs::path{arguments.cache} /
                        (part.name + "-" + std::to_string(arguments.count) + "-" + std::to_string(seed) + ".txt");
  std::vector<Pose3> poses;
  if (std::ifstream in{file}) {
    Pose3 pose;
    Eigen::Matrix4d m;
    while (true) {
      for (int k = 0; k < 16; ++k) in >> m(k / 4, k % 4);
      if (!in) break;
      pose.iso.matrix() = m;
      poses.push_back(pose);
    }
    return poses;
  }
  const emulators::World world = emulators::make_pile(part, arguments.count, setting.size_mm, seed);
  fs::create_directories(arguments.cache);
  std::ofstream out{file};
  out.precision(12);
  for (const auto& object : world.objects()) {
    poses.push_back(object.T_supply_object);
    for (int k = 0; k < 16; ++k) out << object.T_supply_object.iso.matrix()(k / 4, k % 4) << ' ';
    out << '\n';
  }
  return poses;
}

/// Points of one sweep. LMS 400: from one place, rays 0.25 degrees by 3 mm (at the floor); LPS 36: a laser fan that is
/// moved along y, with a camera that has to see the point, too.
std::vector<Eigen::Vector3f> sweep(const emulators::World& world, const Setting& setting,
                                   const vision::ScannerFigures& figures, std::uint64_t seed) {
  std::mt19937_64 random{seed};
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  std::vector<Eigen::Vector3f> points;
  const double half_x = 0.5 * setting.size_mm.x() + 20, half_y = 0.5 * setting.size_mm.y() + 20;
  const double far = 2 * setting.stand_off_mm;
  const double step =
      setting.triangulation ? figures.spacing_across_mm / setting.stand_off_mm : 0.25 * std::numbers::pi / 180;
  const double fan = std::atan(half_x / setting.stand_off_mm);
  for (double y = -half_y; y <= half_y; y += figures.spacing_along_mm)
    for (double a = -fan; a <= fan; a += step) {
      const Eigen::Vector3d origin(0, setting.triangulation ? y : 0, setting.stand_off_mm);
      const double tilt = setting.triangulation ? 0 : std::atan(y / setting.stand_off_mm);
      const auto ray = [&](double da, double dt) {
        const double aa = a + da, tt = tilt + dt;
        return Eigen::Vector3d(std::sin(aa), std::cos(aa) * std::sin(tt), -std::cos(aa) * std::cos(tt));
      };
      const Eigen::Vector3d direction = ray(0, 0);
      const auto hit = world.cast(origin, direction, far);
      if (!hit) continue;
      double range = hit->distance_mm;
      if (setting.triangulation) {
        const Eigen::Vector3d seen = origin + range * direction, camera = origin + Eigen::Vector3d(0, 110, 0);
        const Eigen::Vector3d to = seen - camera;
        const auto first = world.cast(camera, to.normalized(), far);
        if (!first || first->distance_mm < to.norm() - 1 || hit->cos_incidence < 0.15) continue;
      } else {
        // The spot is 2 mm wide: at a jump the echo lies somewhere between both surfaces.
        const auto beside = world.cast(origin, ray(1.0 / setting.stand_off_mm, 1.0 / setting.stand_off_mm), far);
        if (beside && std::abs(beside->distance_mm - range) > 15)
          range += uniform(random) * (beside->distance_mm - range);
      }
      const double noise = figures.noise_mm * std::min(3.0, std::sqrt(1 / std::max(0.05, hit->cos_incidence)));
      const Eigen::Vector3d p = origin + (range + noise * normal(random)) * direction;
      points.push_back(p.cast<float>());
    }
  return points;
}

/// Share of each object's silhouette that is the top surface.
std::vector<double> visible_shares(const vision::Mesh& mesh, const std::vector<Pose3>& truth, const Setting& setting) {
  const vision::Rasteriser rasteriser{mesh};
  const double pixel = setting.triangulation ? 0.5 : 2.0;
  const Eigen::Vector2d origin = -0.5 * setting.size_mm.head<2>();
  const auto rows = static_cast<int>(setting.size_mm.y() / pixel), cols = static_cast<int>(setting.size_mm.x() / pixel);
  vision::Grid<float> top = vision::Grid<float>::Constant(rows, cols, -1e9F);
  vision::Grid<int> owner = vision::Grid<int>::Constant(rows, cols, -1);
  std::vector<int> alone(truth.size()), seen(truth.size());
  vision::Template drawn;
  for (std::size_t k = 0; k < truth.size(); ++k) {
    rasteriser.draw(truth[k].iso.linear().cast<float>(), truth[k].iso.translation().cast<float>(), pixel, origin,
                    drawn);
    for (int r = 0; r < drawn.rows; ++r)
      for (int c = 0; c < drawn.cols; ++c) {
        const int row = r + drawn.row0, col = c + drawn.col0;
        const float z = drawn.top_mm[drawn.at(r, c)];
        if (std::isnan(z)) continue;
        ++alone[k];
        if (row < 0 || col < 0 || row >= rows || col >= cols || z <= top(row, col)) continue;
        top(row, col) = z;
        owner(row, col) = static_cast<int>(k);
      }
  }
  for (const int k : owner.reshaped())
    if (k >= 0) ++seen[static_cast<std::size_t>(k)];
  std::vector<double> shares;
  for (std::size_t k = 0; k < truth.size(); ++k) shares.push_back(static_cast<double>(seen[k]) / std::max(1, alone[k]));
  return shares;
}

struct Figures {
  int scenes = 0, answered = 0, first_right = 0, to_find = 0, found = 0, believed = 0, believed_right = 0, listed = 0,
      listed_right = 0;
  std::vector<double> t_mm, r_deg, time_ms;
  std::map<std::string, double> stages_ms;
  std::map<std::string, int> missed;  ///< By what became of them.
  std::array<std::array<int, 2>, 10> by_score{};
};

double at_share(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

class Bench {
 public:
  explicit Bench(const Arguments& arguments) : arguments_{arguments}, part_{emulators::example_part(arguments.part)} {
    namespace fs = std::filesystem;
    const fs::path file = fs::path{arguments.cache} / (part_.name + ".kb");
    if (auto known = vision::KnowledgeBase::open(file.string())) {
      base_.emplace(std::move(*known));
    } else {
      vision::PartOptions options;
      options.name = part_.name;
      options.scanner = part_.scanner == "lms400" ? vision::ScannerClass::Lms400 : vision::ScannerClass::Lps36;
      vision::TrainingSummary summary;
      auto trained = vision::train(part_.mesh, options, {}, &summary);
      if (!trained) throw std::runtime_error{trained.error().text};
      base_.emplace(std::move(*trained));
      std::printf("trained %s: %s, %d rotations, %llu votes, %.1f MiB, %.1f s\n", part_.name.c_str(),
                  to_string(summary.symmetry).c_str(), summary.rotations,
                  static_cast<unsigned long long>(summary.votes), summary.mib, summary.seconds);
      fs::create_directories(arguments.cache);
      (void)base_->save(file.string());
    }
    setting_ = setting_of(base_->scanner());
    mesh_ = std::make_shared<emulators::RayMesh>(part_.mesh);
    double sum = 0;
    const Eigen::Vector3d centroid = part_.mesh.centroid_mm();
    for (const auto& v : part_.mesh.vertices_mm) sum += (v.cast<double>() - centroid).squaredNorm();
    radius_mm_ = std::sqrt(sum / static_cast<double>(part_.mesh.vertices_mm.size()));
  }

  void run() {
    for (int k = 0; k < arguments_.seeds; ++k) {
      const auto seed = static_cast<std::uint64_t>(arguments_.first_seed + k);
      std::vector<Pose3> truth = settled(part_, arguments_, setting_, seed);
      // Highest last: the fill level sinks from the top.
      const Eigen::Vector3d centroid = part_.mesh.centroid_mm();
      std::stable_sort(truth.begin(), truth.end(),
                       [&](const Pose3& a, const Pose3& b) { return (a * centroid).z() < (b * centroid).z(); });
      if (arguments_.emptying)
        empty_out(truth, seed);
      else
        for (const double fill : arguments_.fills) {
          std::vector<Pose3> rest = truth;
          rest.resize(std::max<std::size_t>(
              1, static_cast<std::size_t>(std::lround(fill * static_cast<double>(truth.size())))));
          scene(rest, seed);
        }
    }
    summary();
  }

 private:
  vision::PoseDistance distance(const Pose3& a, const Pose3& b) const {
    return vision::pose_distance(a.iso, b.iso, base_->symmetry(), radius_mm_);
  }
  std::optional<std::size_t> nearest(const Pose3& pose, const std::vector<Pose3>& truth) const {
    std::optional<std::size_t> best;
    double best_mm = 0;
    for (std::size_t k = 0; k < truth.size(); ++k) {
      const vision::PoseDistance d = distance(pose, truth[k]);
      const double mm = std::hypot(d.centroid_mm, d.angle_rad * radius_mm_);
      if (!best || mm < best_mm) best = k, best_mm = mm;
    }
    return best;
  }
  bool right(const Pose3& pose, const Pose3& truth) const {
    const vision::PoseDistance d = distance(pose, truth);
    return std::hypot(d.centroid_mm, d.angle_rad * radius_mm_) < 0.1 * base_->diameter_mm();
  }

  /// What became of an object that is not in the list: the reason given, without its numbers.
  std::string reason_of_miss(const Pose3& truth, const vision::DetectionReport& report) const {
    for (const vision::Rejection& rejection : report.rejected)
      if (right(rejection.T_supply_object, truth)) return rejection.reason.substr(0, rejection.reason.find(" ("));
    return "no hypothesis, or not among the rejections told";
  }

  /// Detects once; returns the index of the object that the first answer is, if it is right.
  std::optional<std::size_t> scene(const std::vector<Pose3>& truth, std::uint64_t seed) {
    emulators::World world{setting_.size_mm};
    for (const Pose3& pose : truth) world.add(part_.name, mesh_, pose);
    const auto points = sweep(world, setting_, vision::figures_of(base_->scanner()), seed * 1000 + truth.size());
    vision::SupplyBox supply{setting_.size_mm};
    vision::DepthWindow window = vision::window_of(supply);
    if (arguments_.unknown_supply) {
      supply = {};
      window = vision::window_of(points);
    }
    vision::DepthImageBuilder builder{base_->pixel_mm(), window.min_mm, window.max_mm};
    builder.add(points);
    const vision::DepthImage image = builder.image();
    vision::DetectorOptions options;
    options.threads = arguments_.threads;
    if (arguments_.hypotheses > 0) options.hypotheses_max = arguments_.hypotheses;
    const vision::DetectionReport report = vision::detect(image, supply, *base_, options);

    ++figures_.scenes;
    figures_.time_ms.push_back(report.time_ms);
    for (const auto& [stage, ms] : report.stages_ms) figures_.stages_ms[stage] += ms;
    const std::vector<double> visible = visible_shares(part_.mesh, truth, setting_);
    std::set<std::size_t> hit;
    int wrong = 0;
    for (const vision::Detection& d : report.detections) {
      const auto k = nearest(d.T_supply_object, truth);
      const bool good = k && right(d.T_supply_object, truth[*k]) && hit.insert(*k).second;
      wrong += !good;
      ++figures_.listed;
      figures_.listed_right += good;
      if (d.score >= 0.5) ++figures_.believed, figures_.believed_right += good;
      ++figures_.by_score[static_cast<std::size_t>(std::clamp(d.score * 10, 0.0, 9.0))][good ? 1 : 0];
    }
    int to_find = 0, found = 0;
    for (std::size_t k = 0; k < truth.size(); ++k)
      if (visible[k] >= 0.5) {
        ++to_find;
        found += hit.contains(k);
        if (!hit.contains(k)) ++figures_.missed[reason_of_miss(truth[k], report)];
      }
    figures_.to_find += to_find;
    figures_.found += found;
    std::printf("seed %3llu objects %2zu: found %2d of %2d, wrong %d of %2zu, %4.0f ms; first ",
                static_cast<unsigned long long>(seed), truth.size(), found, to_find, wrong, report.detections.size(),
                report.time_ms);
    std::optional<std::size_t> answer;
    if (report.detections.empty()) {
      std::printf("none\n");
    } else {
      const vision::Detection& first = report.detections.front();
      const std::size_t k = *nearest(first.T_supply_object, truth);
      const vision::PoseDistance d = distance(first.T_supply_object, truth[k]);
      const double deg = d.angle_rad * 180 / std::numbers::pi;
      const bool good = d.centroid_mm <= 5 && deg <= 3;
      ++figures_.answered;
      figures_.first_right += good;
      figures_.t_mm.push_back(d.centroid_mm);
      figures_.r_deg.push_back(deg);
      if (good) answer = k;
      std::printf("%s %.2f mm %.2f deg score %.3f seen %.2f (truth %.2f)\n", good ? "right" : "WRONG", d.centroid_mm,
                  deg, first.score, first.visible_fraction, visible[k]);
    }
    if (!arguments_.image.empty()) {
      const std::string name = arguments_.image + "-" + part_.name + "-" + std::to_string(seed) + "-" +
                               std::to_string(truth.size()) + ".png";
      if (const auto drawn = vision::draw_report(name, image, *base_, report); !drawn)
        std::printf("%s\n", drawn.error().c_str());
    }
    return answer;
  }

  /// As the cell does it: the first answer vanishes, nothing else moves. A wrong answer ends the run.
  void empty_out(std::vector<Pose3> truth, std::uint64_t seed) {
    while (!truth.empty()) {
      const auto answer = scene(truth, seed);
      if (!answer) break;
      truth.erase(truth.begin() + static_cast<std::ptrdiff_t>(*answer));
    }
  }

  void summary() const {
    const Figures& f = figures_;
    std::printf(
        "%s: first answer right %d of %d scenes (%d answered); recall of visible >= 0.5: %.3f (%d); precision at "
        "score >= 0.5: %.3f (%d), of the list %.3f\n",
        part_.name.c_str(), f.first_right, f.scenes, f.answered, static_cast<double>(f.found) / std::max(1, f.to_find),
        f.to_find, static_cast<double>(f.believed_right) / std::max(1, f.believed), f.believed,
        static_cast<double>(f.listed_right) / std::max(1, f.listed));
    std::printf(
        "  first answer: t median %.2f max %.2f mm, r median %.2f max %.2f deg; time median %.0f p95 %.0f max %.0f "
        "ms\n",
        at_share(f.t_mm, 0.5), at_share(f.t_mm, 1), at_share(f.r_deg, 0.5), at_share(f.r_deg, 1),
        at_share(f.time_ms, 0.5), at_share(f.time_ms, 0.95), at_share(f.time_ms, 1));
    std::printf("  mean ms:");
    for (const auto& [stage, ms] : f.stages_ms) std::printf(" %s %.1f;", stage.c_str(), ms / std::max(1, f.scenes));
    std::printf("\n  missed:");
    for (const auto& [reason, n] : f.missed) std::printf(" %s: %d;", reason.c_str(), n);
    std::printf("\n  right share by score:");
    for (std::size_t k = 0; k < f.by_score.size(); ++k) {
      const int n = f.by_score[k][0] + f.by_score[k][1];
      if (n > 0)
        std::printf(" %.1f: %.2f (%d);", 0.1 * static_cast<double>(k), static_cast<double>(f.by_score[k][1]) / n, n);
    }
    std::printf("\n");
  }

  Arguments arguments_;
  emulators::ExamplePart part_;
  std::optional<vision::KnowledgeBase> base_;
  std::shared_ptr<const emulators::RayMesh> mesh_;
  Setting setting_;
  double radius_mm_ = 1;
  Figures figures_;
};
}  // namespace

int main(int argc, char** argv) {
  Arguments arguments;
  CLI::App app{"Detection on emulated piles"};
  app.add_option("--part", arguments.part, "one of the example parts");
  app.add_option("--count", arguments.count, "objects thrown into the supply");
  app.add_option("--seeds", arguments.seeds, "piles");
  app.add_option("--first-seed", arguments.first_seed, "seed of the first pile");
  app.add_option("--fills", arguments.fills, "shares of each pile that are looked at, the top taken away");
  app.add_option("--threads", arguments.threads, "threads of detection");
  app.add_option("--hypotheses", arguments.hypotheses, "bound of the hypotheses, 0: default");
  app.add_option("--cache", arguments.cache, "folder of settled piles and knowledge bases");
  app.add_option("--image", arguments.image, "prefix of pictures to draw");
  app.add_flag("--emptying", arguments.emptying, "take the first answer away until nothing is left");
  app.add_flag("--unknown-supply", arguments.unknown_supply, "detection is not told of the supply");
  CLI11_PARSE(app, argc, argv);
  try {
    Bench{arguments}.run();
  } catch (const std::exception& e) {
    std::fprintf(stderr, "detect_scenes: %s\n", e.what());
    return 1;
  }
  return 0;
}
