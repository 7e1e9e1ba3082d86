/// Renders per second of the reference renderer (OSMesa) and the working one, one thread each, at some 5 000 triangles
/// and 64 × 64 pixels. The ratio of the two lines counts, not the times.
#include <benchmark/benchmark.h>
#include <cmath>
#include <numbers>

#include "vision/rasteriser.hpp"
#include "vision/renderer.hpp"
#include "vision/rotations.hpp"

namespace {
using namespace binpick::vision;

/// A torus, 64 mm wide, of 50 × 50 quadrangles.
Mesh torus() {
  constexpr int kSteps = 50;
  constexpr double kStep = 2 * std::numbers::pi / kSteps;
  Mesh mesh;
  for (int i = 0; i < kSteps; ++i)
    for (int j = 0; j < kSteps; ++j) {
      const double r = 22 + 8 * std::cos(j * kStep);
      mesh.vertices_mm.emplace_back(static_cast<float>(r * std::cos(i * kStep)),
                                    static_cast<float>(r * std::sin(i * kStep)),
                                    static_cast<float>(8 * std::sin(j * kStep)));
      const auto at = [&](int a, int b) { return static_cast<std::uint32_t>((a % kSteps) * kSteps + b % kSteps); };
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return mesh;
}

void renders(benchmark::State& state, std::unique_ptr<DepthRenderer> (*make)(const Mesh&)) {
  const auto renderer = make(torus());
  const auto rotations = training_rotations(64, {});
  DepthImage image;
  image.pixel_mm = 1;
  image.origin_mm = Eigen::Vector2d::Constant(-31.5);
  image.z_mm.resize(64, 64);
  std::size_t k = 0;
  for (auto _ : state) {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = rotations[k++ % rotations.size()].toRotationMatrix();
    renderer->render(T, image);
    benchmark::DoNotOptimize(image.z_mm.data());
  }
  state.counters["renders/s"] =
      benchmark::Counter(static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
}
BENCHMARK_CAPTURE(renders, osmesa, &make_osmesa_renderer)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(renders, working, &make_working_renderer)->Unit(benchmark::kMicrosecond);
}  // namespace

BENCHMARK_MAIN();
