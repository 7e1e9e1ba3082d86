#include "bench/scenes/piles.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <random>
#include <stdexcept>

#include "bench/scenes/classes.hpp"
#include "tests/emulators/world/pile.hpp"

namespace binpick::bench {
namespace {
namespace fs = std::filesystem;

std::string hex(std::uint64_t value) {
  std::array<char, 20> text{};
  std::snprintf(text.data(), text.size(), "%016llx", static_cast<unsigned long long>(value));
  return text.data();
}

/// Numbers until the end of the file; a file that was cut short gives an incomplete pose, and is settled again.
std::vector<ObjectPose> read_poses(const fs::path& file, std::size_t expected) {
  std::ifstream in{file};
  std::vector<ObjectPose> poses;
  for (std::array<double, 7> v{}; in;) {
    for (double& x : v) in >> x;
    if (!in) break;
    ObjectPose pose;
    pose.iso.linear() = Eigen::Quaterniond{v[0], v[1], v[2], v[3]}.normalized().toRotationMatrix();
    pose.iso.translation() = Eigen::Vector3d{v[4], v[5], v[6]};
    poses.push_back(pose);
  }
  return poses.size() == expected ? poses : std::vector<ObjectPose>{};
}

/// Every level once, neighbours far apart.
std::vector<double> even_fills(int levels) {
  constexpr int kStride = 49;  // shares no factor with the number of levels
  std::vector<double> fills;
  for (int k = 0; k < levels; ++k) fills.push_back(static_cast<double>(k * kStride % levels + 1) / levels);
  return fills;
}

/// Under another name first: shards beside this one read the same folder.
void write_poses(const fs::path& file, const std::vector<ObjectPose>& poses) {
  const fs::path part = file.string() + "." + hex(std::random_device{}());
  {
    std::ofstream out{part};
    out.precision(12);
    for (const ObjectPose& pose : poses) {
      const Eigen::Quaterniond q{pose.iso.linear()};
      const Eigen::Vector3d t = pose.iso.translation();
      out << q.w() << ' ' << q.x() << ' ' << q.y() << ' ' << q.z() << ' ' << t.x() << ' ' << t.y() << ' ' << t.z()
          << '\n';
    }
    if (!out.flush()) throw std::runtime_error{part.string() + ": cannot be written; check folder and free space"};
  }
  fs::rename(part, file);
}
}  // namespace

SceneId Split::scene(std::size_t number) const {
  SceneId id;
  id.pile = first_pile + number % piles;
  id.fill = fills[(number / piles + number % piles) % fills.size()];
  id.noise = first_pile * 1'000 + number;
  return id;
}

const Split* find_split(std::string_view name) {
  static const std::array<Split, 4> splits{
      Split{"tune", 1, 10, {1.0, 0.75, 0.5, 0.25}}, Split{"last", 1, 10, {0.0, 0.06}},
      Split{"report", 1'001, 25, {0.9, 0.65, 0.4, 0.15}}, Split{"figure7", 5'001, 25, even_fills(120)}};
  const auto it = std::ranges::find(splits, name, &Split::name);
  return it == splits.end() ? nullptr : &*it;
}

const Split& split_named(std::string_view name) {
  const Split* split = find_split(name);
  if (split == nullptr)
    throw std::runtime_error{"no split \"" + std::string{name} + "\"; there are tune, last, report and figure7"};
  return *split;
}

std::vector<ObjectPose> settled_pile(const ScenePart& part, std::uint64_t seed, const std::string& folder) {
  const ClassSetting setting = setting_of(part);
  std::string own_supply;
  if (part.supply_mm)
    for (const double mm : *part.supply_mm) own_supply += "-" + std::to_string(std::lround(mm));
  const fs::path file = fs::path{folder} / (part.body.name + "-" + std::string{setting.name} + own_supply + "-" +
                                            std::to_string(part.pile) + "-" + hex(vision::mesh_hash(part.body.mesh)) +
                                            "-" + std::to_string(seed) + ".txt");
  std::vector<ObjectPose> poses = read_poses(file, static_cast<std::size_t>(part.pile));
  if (!poses.empty()) return poses;
  const emulators::World world = emulators::make_pile(part.body, part.pile, setting.supply_mm, seed);
  for (const auto& object : world.objects()) poses.push_back(object.T_supply_object);
  const Eigen::Vector3d centroid = part.body.mesh.centroid_mm();
  std::ranges::stable_sort(poses, {}, [&](const ObjectPose& pose) { return (pose * centroid).z(); });
  fs::create_directories(folder);
  write_poses(file, poses);
  return poses;
}

std::vector<ObjectPose> taken_down(std::vector<ObjectPose> pile, double fill) {
  const auto left = static_cast<std::size_t>(std::lround(fill * static_cast<double>(pile.size())));
  pile.resize(std::min(pile.size(), std::max<std::size_t>(1, left)));
  return pile;
}
}  // namespace binpick::bench
