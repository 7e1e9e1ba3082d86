#include "vision/scene.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "vision/team.hpp"

namespace binpick::vision {
namespace {
constexpr float kNotMeasured = std::numeric_limits<float>::quiet_NaN();
constexpr float kOutside = std::numeric_limits<float>::infinity();
constexpr float kAbsurdMm = 1e6F;
/// A pixel with fewer neighbours on its own surface is a mixed echo at an edge or dirt in the air.
constexpr int kNeighboursMin = 2;
/// So many rows are one piece of work.
constexpr int kBlockRows = 64;

/// Rows of heights with as many around them as the inner loops may look at.
class Padded {
 public:
  void resize(int rows, int cols) {
    if (rows == rows_ && cols == cols_) return;  // what lies around the rows is never written to
    rows_ = rows, cols_ = cols;
    stride_ = cols + 2 * kMarginPx + static_cast<int>(kernels::kLanes);
    z_mm_.assign(static_cast<std::size_t>(rows + 2 * kMarginPx) * static_cast<std::size_t>(stride_), kOutside);
  }
  float* row(int r) { return z_mm_.data() + static_cast<std::ptrdiff_t>(r + kMarginPx) * stride_ + kMarginPx; }
  std::ptrdiff_t stride() const { return stride_; }

 private:
  static constexpr int kMarginPx = kernels::kHoleReachPx;
  int rows_ = 0, cols_ = 0;
  std::ptrdiff_t stride_ = 0;
  std::vector<float> z_mm_;
};

/// Calls work(first, last) for blocks of rows.
template <class Work>
void share_rows(int threads, int rows, const Work& work) {
  share(threads, static_cast<std::size_t>((rows + kBlockRows - 1) / kBlockRows), Deadline{},
        [&](std::size_t block, int) {
          const int first = static_cast<int>(block) * kBlockRows;
          work(first, std::min(rows, first + kBlockRows));
        });
}

void remove_specks(const DepthImage& image, int first, int last, const kernels::Table& loops, Padded& measured,
                   Scene& scene) {
  const int rows = scene.rows(), cols = scene.cols();
  Padded finite;
  finite.resize(last - first + 2, cols);
  for (int r = std::max(0, first - 1); r < std::min(rows, last + 1); ++r) {
    const float* from = image.z_mm.row(r).data();
    float* to = finite.row(r - first + 1);
    for (int c = 0; c < cols; ++c) to[c] = std::abs(from[c]) < kAbsurdMm ? from[c] : kNotMeasured;
  }
  for (int r = first; r < last; ++r) {
    loops.clean(finite.row(r - first + 1), finite.stride(), cols, scene.jump_mm, kNeighboursMin, measured.row(r));
    std::copy_n(measured.row(r), cols, scene.measured_mm.row(r).data());
  }
}

/// The nearest edge of all within reach: first along the columns, from above and from below, then along the row
/// (Felzenszwalb and Huttenlocher, 2012, with a bound).
void spread_edges(int first, int last, const kernels::Table& loops, Scene& scene) {
  const int rows = scene.rows(), cols = scene.cols();
  const auto width = static_cast<std::size_t>(cols);
  std::vector<std::int16_t> below(width * static_cast<std::size_t>(last - first)), ways(width + 2 * kEdgeReachPx + 16);
  std::vector<std::int16_t> distance(width, kEdgeReachPx);
  for (int r = std::min(rows, last + kEdgeReachPx) - 1; r >= first; --r) {
    loops.column_distance(scene.edge.row(r).data(), cols, distance.data());
    if (r < last)
      std::copy(distance.begin(), distance.end(), below.data() + width * static_cast<std::size_t>(r - first));
  }
  std::fill(distance.begin(), distance.end(), std::int16_t{kEdgeReachPx});
  for (int r = std::max(0, first - kEdgeReachPx); r < last; ++r) {
    loops.column_distance(scene.edge.row(r).data(), cols, distance.data());
    if (r >= first)
      loops.nearest_edges(distance.data(), below.data() + width * static_cast<std::size_t>(r - first), cols, r,
                          ways.data(), scene.edge_distance_px.row(r).data(), scene.nearest_edge.row(r).data());
  }
}
}  // namespace

float jump_of(double noise_mm, double pixel_mm) { return static_cast<float>(std::max(4 * noise_mm, 1.2 * pixel_mm)); }

Scene prepare_scene(const DepthImage& image, double noise_mm, int threads, const kernels::Table& loops, Scene memory) {
  Scene scene = std::move(memory);
  scene.pixel_mm = image.pixel_mm;
  scene.origin_mm = image.origin_mm;
  scene.noise_mm = noise_mm;
  scene.jump_mm = jump_of(noise_mm, image.pixel_mm);
  const auto rows = static_cast<int>(image.z_mm.rows()), cols = static_cast<int>(image.z_mm.cols());
  for (Grid<float>* grid : {&scene.measured_mm, &scene.z_mm, &scene.slope_x, &scene.slope_y, &scene.bend_mm,
                            &scene.edge_out_x, &scene.edge_out_y, &scene.edge_distance_px})
    grid->resize(rows, cols);
  scene.edge.resize(rows, cols);
  scene.nearest_edge.resize(rows, cols);

  struct Scratch {
    Padded measured, smooth;
  };
  thread_local Scratch own;
  Padded &measured = own.measured, &smooth = own.smooth;  // this thread's, whoever works on them
  measured.resize(rows, cols);
  smooth.resize(rows, cols);
  share_rows(threads, rows, [&](int first, int last) { remove_specks(image, first, last, loops, measured, scene); });
  share_rows(threads, rows, [&](int first, int last) {
    for (int r = first; r < last; ++r) {
      loops.smooth(measured.row(r), measured.stride(), cols, scene.jump_mm, smooth.row(r));
      std::copy_n(smooth.row(r), cols, scene.z_mm.row(r).data());
    }
  });
  const auto per_mm = static_cast<float>(1 / image.pixel_mm);
  share_rows(threads, rows, [&](int first, int last) {
    for (int r = first; r < last; ++r)
      loops.surface(smooth.row(r), smooth.stride(), cols, scene.jump_mm, per_mm,
                    {scene.slope_x.row(r).data(), scene.slope_y.row(r).data(), scene.bend_mm.row(r).data(),
                     scene.edge_out_x.row(r).data(), scene.edge_out_y.row(r).data(), scene.edge.row(r).data()});
  });
  share_rows(threads, rows, [&](int first, int last) { spread_edges(first, last, loops, scene); });
  return scene;
}
}  // namespace binpick::vision
