#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <thread>

#include "vision/decimation.hpp"
#include "vision/knowledge_base_impl.hpp"
#include "vision/renderer.hpp"
#include "vision/resting.hpp"
#include "vision/rotations.hpp"
#include "vision/surface.hpp"
#include "vision/view.hpp"
#include "vision/votes.hpp"

namespace binpick::vision {
namespace {
constexpr double kSmallPartMm = 150;  ///< Below, a part belongs to the triangulation scanners.
constexpr double kLargestPartMm = 5000;
constexpr double kSpacingsMin = 6;
constexpr int kRotationsMax = 60'000, kRotations = 10'000;
constexpr int kLooks = 4;
constexpr std::size_t kVotesPerView = 256;

double default_pixel_mm(const Mesh& mesh, const ScannerFigures& figures, double diameter_mm) {
  // Of as many points, spread evenly.
  const double spacing = std::sqrt(figures.spacing_along_mm * figures.spacing_across_mm);
  // A quarter of the part's thinnest direction, by its surface's deviation (a plate's is half its thickness).
  const Eigen::Vector3d variance = surface_covariance(mesh).selfadjointView<Eigen::Lower>().eigenvalues();
  const double thin = 0.5 * std::sqrt(std::max(0.0, variance.minCoeff()));
  const double pixel = std::min(0.8 * spacing, std::max(thin, 0.25 * spacing));
  return std::max(pixel, diameter_mm / 120);  // A vote reaches 127 pixels.
}

ScannerClass scanner_of(const PartOptions& options, double diameter_mm) {
  return options.scanner.value_or(diameter_mm < kSmallPartMm ? ScannerClass::Lps36 : ScannerClass::Lms400);
}

/// The mesh to render: a tenth of the triangles shows the same part, in a tenth of the time, also when it is detected.
Mesh mesh_to_render(const Mesh& mesh, double noise_mm) {
  constexpr std::size_t kEasy = 5000;
  // Flat faces cut into many triangles cost nothing to mend; only what is very fine has to give more.
  if (mesh.triangles.size() <= kEasy) return decimated(mesh, noise_mm / 30);
  Mesh finer = decimated(mesh, noise_mm / 10);
  return finer.triangles.size() <= kEasy ? finer : decimated(mesh, noise_mm / 3);
}

/// What resolve() made of the options and the mesh; the votes are still to come.
PartFacts resolved(const Mesh& mesh, const PartOptions& options) {
  PartFacts part;
  part.part_name = options.name;
  part.mesh_hash = mesh_hash(mesh);
  part.diameter_mm = mesh.diameter_mm();
  part.scanner = scanner_of(options, part.diameter_mm);
  const ScannerFigures& figures = figures_of(part.scanner);
  part.noise_mm = figures.noise_mm;
  part.mesh = mesh_to_render(mesh, part.noise_mm);
  part.pixel_mm = options.pixel_mm.value_or(default_pixel_mm(part.mesh, figures, part.diameter_mm));
  part.dz_quantum_mm = std::max(0.25 * part.noise_mm, part.diameter_mm / 30'000);
  PartOptions known = options;
  known.scanner = part.scanner;
  part.symmetry = symmetry_of(part.mesh, known);
  part.feature_stride = std::clamp(static_cast<int>(std::lround(0.04 * part.diameter_mm / part.pixel_mm)), 1, 4);
  part.feature_tolerance_mm =
      static_cast<float>(std::max(1.6 * part.noise_mm, 0.25 * part.pixel_mm * part.feature_stride));
  return part;
}

/// How far a random rotation is from the nearest of a grid on average (rotations.hpp). A revolution's axes are spread
/// as densely as those of 10 000 rotations.
double gap_rad(int rotations, const Symmetry& symmetry) {
  const bool finite = symmetry.kind == Symmetry::Kind::None || symmetry.kind == Symmetry::Kind::Finite;
  return 122 * std::numbers::pi / 180 / std::cbrt(finite ? rotations : kRotations);
}

int rotations_of(const PartOptions& options) {
  return std::clamp(options.rotations.value_or(kRotations), 1, kRotationsMax);
}

/// The same group about the same centre, written down in the same way.
bool same(const Symmetry& a, const Symmetry& b) {
  constexpr double kSame = 1e-6;
  if (a.kind != b.kind || a.rotations.size() != b.rotations.size()) return false;
  if ((a.centre_mm - b.centre_mm).norm() > kSame || (a.axis - b.axis).norm() > kSame) return false;
  return std::equal(a.rotations.begin(), a.rotations.end(), b.rotations.begin(),
                    [](const Eigen::Matrix3d& x, const Eigen::Matrix3d& y) { return (x - y).norm() < kSame; });
}

struct Conveyor {
  std::size_t poses = 0;
  std::vector<Eigen::Quaterniond> rotations;
  double gap_rad = 0;
};

/// Views of the resting poses: as dense as a sixth of what a bin would take allows, and no denser than serves.
Conveyor lying_on_a_belt(const PartFacts& part, std::size_t bin_rotations) {
  constexpr double kDegree = std::numbers::pi / 180;
  constexpr double kBarrierDiameters = 0.01, kLean = 3 * kDegree, kTurnMin = 4 * kDegree, kTurnMax = 12 * kDegree;
  Conveyor conveyor;
  const auto all = resting_poses(part.mesh, part.symmetry, kBarrierDiameters * part.diameter_mm, kTurnMin);
  for (double turn = kTurnMin;; turn *= 1.1) {
    // A round part rolls: its lying poses are as far apart as the turns.
    const auto poses = apart(all, part.symmetry, turn);
    const bool last = turn * 1.1 > kTurnMax;
    conveyor.poses = poses.size();
    conveyor.rotations = resting_rotations(poses, part.symmetry, turn, last ? 0 : kLean);
    conveyor.gap_rad = 0.5 * turn;
    if (last || 6 * conveyor.rotations.size() <= bin_rotations) return conveyor;
  }
}

struct Trained {
  TrainedView view;
  std::vector<RawVote> votes;
};

Trained train_view(const PartFacts& part, const Eigen::Quaterniond& rotation, std::uint64_t seed,
                   DepthRenderer& renderer) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = rotation.toRotationMatrix();
  const int margin = kRingReach * part.feature_stride + 1;
  // Two places on the pixel grid: what depends on where the grid falls is not kept.
  std::vector<DepthImage> renders;
  for (const double shift : {0.0, 0.5}) {
    renders.push_back(window_around(part.mesh, T.linear(), part.pixel_mm, margin, {shift, shift}));
    renderer.render(T, renders.back());
  }
  Trained trained;
  trained.view = view_of(renders.front(), part.mesh, rotation, part.noise_mm, part.diameter_mm);
  LookOptions look;
  look.rule = {part.feature_tolerance_mm, part.feature_stride};
  look.noise_mm = part.noise_mm;
  look.dz_quantum_mm = part.dz_quantum_mm;
  look.looks = kLooks;
  look.seed = seed;
  trained.votes = look_at(renders, trained.view, look);
  return trained;
}

std::vector<Trained> train_views(const PartFacts& part, const std::vector<Eigen::Quaterniond>& rotations,
                                 std::uint64_t seed, const std::function<void(TrainingProgress)>& progress,
                                 int threads) {
  std::vector<Trained> trained(rotations.size());
  std::atomic<std::size_t> next{0};
  constexpr std::size_t kBlock = 32;
  const auto run = [&](bool reports) {
    const auto renderer = make_osmesa_renderer(part.mesh);
    for (std::size_t first = next.fetch_add(kBlock); first < rotations.size(); first = next.fetch_add(kBlock)) {
      for (std::size_t i = first; i < std::min(first + kBlock, rotations.size()); ++i)
        trained[i] = train_view(part, rotations[i], seed * 0x9E3779B97F4A7C15ULL + i, *renderer);
      if (reports && progress) progress({static_cast<double>(first) / static_cast<double>(rotations.size())});
    }
  };
  std::vector<std::jthread> others;
  for (int t = 1; t < threads; ++t) others.emplace_back(run, false);
  run(true);
  return trained;
}
}  // namespace

const ScannerFigures& figures_of(ScannerClass scanner) {
  // noise, spacing along and across the sweep, stand-off
  static constexpr ScannerFigures kLps36Hi{0.12, 0.5, 0.5, 420}, kLps36{0.5, 1, 1, 500}, kLms400{3, 3, 7.9, 1800};
  switch (scanner) {
    case ScannerClass::Lps36Hi:
      return kLps36Hi;
    case ScannerClass::Lps36:
      return kLps36;
    case ScannerClass::Lms400:
      return kLms400;
  }
  return kLps36;
}

Symmetry symmetry_of(const Mesh& mesh, const PartOptions& options) {
  if (options.symmetry) {
    Symmetry given = *options.symmetry;
    given.centre_mm = options.symmetry_centre_mm.value_or(mesh.centroid_mm());
    return given;
  }
  // What the scanner's noise hides is no difference.
  const double diameter_mm = mesh.diameter_mm();
  const double noise_mm = figures_of(scanner_of(options, diameter_mm)).noise_mm;
  return find_symmetry(mesh, options.symmetry_tolerance_mm.value_or(std::max(0.5 * noise_mm, 0.005 * diameter_mm)));
}

std::string other_option(const KnowledgeBase& trained, const PartOptions& options) {
  const PartFacts& part = trained.impl();
  if (part.scanner != scanner_of(options, part.diameter_mm)) return "scanner";
  if (options.pixel_mm && *options.pixel_mm != part.pixel_mm) return "pixel_mm";
  if (options.symmetry && !same(symmetry_of(part.mesh, options), part.symmetry)) return "symmetry";
  // Views of a part on a conveyor are never as far apart as those of a bin.
  const double bin_gap_rad = gap_rad(rotations_of(options), part.symmetry);
  const bool as_in_a_bin = std::abs(part.rotation_gap_rad - bin_gap_rad) < 1e-9;
  if (options.picking == Picking::Conveyor) return as_in_a_bin ? "picking" : "";
  return as_in_a_bin ? "" : "rotations or picking";
}

Expected<KnowledgeBase, MeshError> train(const Mesh& mesh, const PartOptions& options,
                                         const std::function<void(TrainingProgress)>& progress,
                                         TrainingSummary* summary, int threads) {
  const auto start = std::chrono::steady_clock::now();
  const auto failed = [&](const std::string& why) {
    return unexpected(MeshError{"part " + options.name + ": " + why});
  };
  const auto mm = [](double value) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), "%.6g mm", value);
    return std::string{text.data()};
  };
  if (progress) progress({0.0});
  if (mesh.triangles.empty()) return failed("the mesh holds no triangle; export the part as a surface mesh");
  TrainedPart part;
  static_cast<PartFacts&>(part) = resolved(mesh, options);
  if (!(part.diameter_mm > 0)) return failed("the mesh has no extent; check mesh_unit");
  if (part.diameter_mm > kLargestPartMm)
    return failed("the part's diameter is " + mm(part.diameter_mm) + ", over " + mm(kLargestPartMm) +
                  "; check mesh_unit");
  if (!(part.pixel_mm > 0) || part.diameter_mm / part.pixel_mm > 1000)
    return failed("a pixel of " + mm(part.pixel_mm) + " is too small for a part of " + mm(part.diameter_mm) +
                  "; check mesh_unit and pixel_mm");
  // No scanner shows a part by fewer points; a part in metres comes here too.
  const double spacing_mm =
      std::max(figures_of(part.scanner).spacing_along_mm, figures_of(part.scanner).spacing_across_mm);
  if (part.diameter_mm < kSpacingsMin * spacing_mm)
    return failed("the part's diameter is " + mm(part.diameter_mm) + ", too small for a scanner whose points are " +
                  mm(spacing_mm) + " apart; check mesh_unit and scanner");
  if (part.diameter_mm < 4 * part.pixel_mm)
    return failed("the part's diameter is " + mm(part.diameter_mm) + ", too small for pixels of " + mm(part.pixel_mm) +
                  "; check mesh_unit, pixel_mm and scanner");
  const int asked = rotations_of(options);
  std::vector<Eigen::Quaterniond> rotations = training_rotations(asked, part.symmetry);
  part.rotation_gap_rad = gap_rad(asked, part.symmetry);
  std::size_t resting = 0;
  if (options.picking == Picking::Conveyor) {
    Conveyor conveyor = lying_on_a_belt(part, rotations.size());
    resting = conveyor.poses;
    if (resting == 0) return failed("the part rests on a belt in no way; check the mesh, or use picking = \"bin\"");
    rotations = std::move(conveyor.rotations);
    part.rotation_gap_rad = conveyor.gap_rad;
  }
  if (threads <= 0) threads = std::clamp(static_cast<int>(std::thread::hardware_concurrency()), 1, 64);
  std::vector<Trained> trained = train_views(part, rotations, options.seed, progress, threads);

  std::vector<std::vector<RawVote>> votes;
  for (Trained& t : trained) {
    // A plate on edge between two columns of pixels shows nothing.
    if (t.view.anchors_object_mm.empty() || t.view.surface.empty()) continue;
    part.views.push_back(std::move(t.view));
    votes.push_back(std::move(t.votes));
  }
  trained.clear();
  if (part.views.empty()) return failed("no view shows anything of the mesh; check mesh_unit and pixel_mm");
  VoteTable table = build_votes(
      votes, static_cast<std::uint32_t>(std::max(0, options.votes_per_feature_max.value_or(0))), kVotesPerView);
  part.offsets = std::move(table.offsets);
  part.votes = std::move(table.votes);
  const FileBytes file = kept(encoded(part));
  if (progress) progress({1.0});
  if (summary != nullptr) {
    summary->symmetry = part.symmetry;
    summary->resting_poses = resting;
    summary->triangles = mesh.triangles.size();
    summary->triangles_rendered = part.mesh.triangles.size();
    summary->rotations = static_cast<int>(part.views.size());
    summary->votes = part.votes.size();
    summary->mib = static_cast<double>(file.bytes.size()) / (1 << 20);
    summary->seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  }
  auto base = open_knowledge_base(file, options.name);
  if (!base) return failed(base.error().text);
  return std::move(*base);
}
}  // namespace binpick::vision
