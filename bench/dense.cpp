/// The rendered test with the portable inner loops and with those of this processor, one thread each: a part of some
/// 600 triangles on 150 pixels, as a fine scanner sees it. The ratio of the lines counts, not the times.
#include <benchmark/benchmark.h>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <utility>

#include "vision/rotations.hpp"
#include "vision/verification.hpp"

namespace {
using namespace binpick::vision;

/// A torus, 30 mm wide, of 25 × 12 quadrangles.
Mesh torus() {
  constexpr int kAround = 25, kAcross = 12;
  Mesh mesh;
  for (int i = 0; i < kAround; ++i)
    for (int j = 0; j < kAcross; ++j) {
      const double a = 2 * std::numbers::pi * i / kAround, b = 2 * std::numbers::pi * j / kAcross;
      const double r = 10 + 5 * std::cos(b);
      mesh.vertices_mm.emplace_back(static_cast<float>(r * std::cos(a)), static_cast<float>(r * std::sin(a)),
                                    static_cast<float>(5 * std::sin(b)));
      const auto at = [](int m, int n) { return static_cast<std::uint32_t>((m % kAround) * kAcross + n % kAcross); };
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return mesh;
}

/// Four of them in different attitudes, and where they are.
struct Setting {
  Setting() {
    DepthImage image;
    image.pixel_mm = 0.2;
    image.z_mm.setZero(400, 400);
    const auto rotations = training_rotations(64, {});
    Template drawn;
    for (std::size_t k = 0; k < 4; ++k) {
      Pose pose;
      pose.R = rotations[7 * k].cast<float>().toRotationMatrix();
      pose.t = Eigen::Vector3f(k % 2 == 0 ? 20 : 60, k < 2 ? 20 : 60, 10);
      poses.push_back(pose);
      part.draw(pose.R, pose.t, image.pixel_mm, image.origin_mm, drawn);
      for (int r = 0; r < drawn.rows; ++r)
        for (int c = 0; c < drawn.cols; ++c)
          if (drawn.triangle[drawn.at(r, c)] >= 0)
            image.z_mm(r + drawn.row0, c + drawn.col0) = drawn.top_mm[drawn.at(r, c)];
    }
    scene = prepare_scene(image, 0.1);
    for (Pose& pose : poses) {
      pose.t += Eigen::Vector3f(0.3F, -0.2F, 0.05F);
      templates.emplace_back();
      part.draw(pose.R, pose.t, image.pixel_mm, image.origin_mm, templates.back());
    }
  }
  Rasteriser part{torus()};
  Scene scene;
  std::vector<Pose> poses;
  std::vector<Template> templates;
};
const Setting& setting() {
  static const Setting one;
  return one;
}

void dense(benchmark::State& state, const kernels::Table& loops) {
  const Setting& s = setting();
  std::size_t k = 0, pixels = 0;
  for (auto _ : state) {
    const DenseTest test = dense_test(s.scene, s.part, s.poses[k], s.templates[k], loops);
    pixels += static_cast<std::size_t>(test.pixels);
    benchmark::DoNotOptimize(test);
    k = (k + 1) % s.poses.size();
  }
  state.counters["pixels/s"] = benchmark::Counter(static_cast<double>(pixels), benchmark::Counter::kIsRate);
}
BENCHMARK_CAPTURE(dense, portable, kernels::portable())->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(dense, chosen, kernels::table())->Unit(benchmark::kMicrosecond);

void look(benchmark::State& state) {
  const Setting& s = setting();
  Template drawn;
  std::size_t k = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(glance(s.scene, s.part, s.poses[k], drawn, 4));
    k = (k + 1) % s.poses.size();
  }
}
BENCHMARK(look)->Unit(benchmark::kMicrosecond);

void draw(benchmark::State& state) {
  const Setting& s = setting();
  Template drawn;
  std::size_t k = 0;
  for (auto _ : state) {
    s.part.draw(s.poses[k].R, s.poses[k].t, s.scene.pixel_mm, s.scene.origin_mm, drawn);
    benchmark::DoNotOptimize(drawn.top_mm.data());
    k = (k + 1) % s.poses.size();
  }
}
BENCHMARK(draw)->Unit(benchmark::kMicrosecond);
/// 720 × 720 pixels of blocks on a slope, with noise, and one in forty missing.
DepthImage blocks() {
  DepthImage image;
  image.pixel_mm = 0.2;
  image.z_mm.resize(720, 720);
  std::mt19937 random{1};
  std::normal_distribution<float> noise{0, 0.05F};
  for (Eigen::Index r = 0; r < 720; ++r)
    for (Eigen::Index c = 0; c < 720; ++c)
      image.z_mm(r, c) = random() % 40 == 0 ? std::numeric_limits<float>::quiet_NaN()
                                            : static_cast<float>((r / 60 * 7 + c / 60 * 3) % 11) +
                                                  0.04F * static_cast<float>(c % 60) + noise(random);
  return image;
}

void prepare(benchmark::State& state, const kernels::Table& loops) {
  const DepthImage image = blocks();
  Scene scene;
  for (auto _ : state) {
    scene = prepare_scene(image, 0.05, 1, loops, std::move(scene));
    benchmark::DoNotOptimize(scene.z_mm.data());
  }
}
BENCHMARK_CAPTURE(prepare, portable, kernels::portable())->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(prepare, chosen, kernels::table())->Unit(benchmark::kMillisecond);
}  // namespace

BENCHMARK_MAIN();
