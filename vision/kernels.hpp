#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

/// The inner loops of detection. They are compiled twice, for any x86-64 and for one with AVX2 and FMA, and chosen when
/// the program runs. Plain arrays only: an inline function of another header that were compiled with AVX2 here could be
/// the copy that the linker keeps for all.
namespace binpick::vision::kernels {
/// Points in groups of eight lie in memory as x x x x x x x x, y …; `n` is a multiple of eight.
inline constexpr std::size_t kLanes = 8;

/// Picture as the loops see it: row-major, `cols` values in a row.
struct Picture {
  const float* z_mm = nullptr;
  const float* slope_x = nullptr;
  const float* slope_y = nullptr;
  const std::int32_t* nearest_edge = nullptr;  ///< Index of the nearest edge pixel, -1: none near.
  const float* edge_distance_px = nullptr;
  const float* edge_z_mm = nullptr;  ///< Heights that edges are compared with.
  const float* edge_out_x = nullptr;
  const float* edge_out_y = nullptr;
  const float* bend_mm = nullptr;
  int rows = 0, cols = 0;
  float origin_x = 0, origin_y = 0;  ///< Supply x, y of the centre of pixel (0, 0), mm.
  float pixel_mm = 1;
  float jump_mm = 1;
};

/// p_supply = turn · p + shift; row-major.
struct Motion {
  float turn[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  float shift[3] = {0, 0, 0};
};

struct SparseSum {
  float evidence = 0;
  int explained = 0;
  int contradicted = 0;
};

/// Upper triangle of the normal equations' matrix by rows (21), then its right side (6).
inline constexpr std::size_t kNormalSums = 27;

/// What a mesh is drawn on: pixel (row, col) is [row * stride + col]; stride is at least cols + kLanes.
struct Canvas {
  float* top_mm = nullptr;           ///< Starts at -infinity.
  std::int32_t* triangle = nullptr;  ///< Of the top surface.
  int rows = 0, cols = 0, stride = 0;
};

/// A template: pixel (row, col) is [row * stride + col], and lies on pixel (row + row0, col + col0) of the picture.
/// kMargin pixels around it can be read as well, and kLanes more to the right of them.
struct Drawn {
  const float* top_mm = nullptr;           ///< NaN or -infinity outside the silhouette.
  const std::int32_t* triangle = nullptr;  ///< -1 outside.
  int rows = 0, cols = 0, stride = 0, row0 = 0, col0 = 0;
  const float* faces = nullptr;  ///< What turn_faces() made of the normals, by triangle.
  std::size_t faces_count = 0;   ///< A multiple of eight.
};
inline constexpr int kMargin = 2;

struct DenseLimits {
  float normal_cosine2 = 0;  ///< Squared cosine of the angle between normals that agree.
  float bend_max_mm = 0;     ///< Larger curvatures count as this.
};

/// See DenseTest (verification.hpp).
struct DenseSum {
  int pixels = 0, explained = 0, contradicted = 0, contradicted_border = 0, occluded = 0;
  int edges_found = 0, edges_missing = 0, normals = 0, normals_same = 0;
  float weight = 0, bend_both = 0, bend_model = 0, bend_scene = 0;
};

/// What a row of the scene is written to, see Scene (scene.hpp).
struct SurfaceRow {
  float *slope_x = nullptr, *slope_y = nullptr, *bend_mm = nullptr;
  float *edge_out_x = nullptr, *edge_out_y = nullptr;
  std::uint8_t* edge = nullptr;
};
/// How far an edge looks over a hole for the surface beyond it.
inline constexpr int kHoleReachPx = 3;
/// Further away than that, no edge is known.
inline constexpr int kEdgeReachPx = 16;

/// A view (below 2^24) that passed the coarse test: the larger, the better; equal ones in the order of the views.
constexpr std::uint32_t ranked(std::uint32_t view, int explained, int contradicted) {
  return static_cast<std::uint32_t>(32 + 2 * explained - contradicted) << 24 | (0xFFFFFFU - view);
}
constexpr std::uint32_t view_of(std::uint32_t rank) { return 0xFFFFFFU - (rank & 0xFFFFFFU); }

struct Table {
  const char* name;

  /// Views first … last - 1 at one place: `offsets` (index differences in `padded`, which must be valid for all of
  /// them) and `rise_mm` hold 16 samples per view. Writes ranked(view, …) of the views with at least `explained_min`
  /// samples within `tolerance_mm` and at most `contradicted_max` seen through; returns how many.
  std::size_t (*coarse)(const float* padded, const std::int32_t* offsets, const float* rise_mm, std::size_t first,
                        std::size_t last, float z_mm, float tolerance_mm, int explained_min, int contradicted_max,
                        std::uint32_t* passed);

  /// Adds what n samples say: explained count 1 less 0.7 of their squared share of the tolerance, seen through or
  /// outside the picture -1.
  void (*sparse)(const Picture& picture, const Motion& motion, const float* points, std::size_t n, float tolerance_mm,
                 SparseSum& sum);
  /// Sum over n edge points of how near the next edge of their height is: 1 there, 0 five pixels away.
  float (*edges)(const Picture& picture, const Motion& motion, const float* points, std::size_t n);

  /// Point-to-plane residuals of n surfels (x, y, z and normal x, y, z, by eights), Tukey weights times `weight`.
  /// `motion` moves them; `arm_from` is the centre of rotation, supply.
  void (*match_surface)(const Picture& picture, const Motion& motion, const float* arm_from, const float* surfels,
                        std::size_t n, float gate_mm, float weight, float* sums);
  /// Residuals of n edge points (x, y, z and out x, y, by eights; out of zero: the scene's) across the nearest edge.
  void (*match_edges)(const Picture& picture, const Motion& motion, const float* arm_from, const float* edges,
                      std::size_t n, float gate_mm, float weight, float* sums);

  /// n points (x of all, y of all, z of all) moved; x and y of the low and high corner around them go to `box`.
  void (*move_points)(const Motion& motion, const float* points, std::size_t n, float* moved, float* box);
  /// Draws triangles, given by the indices of their corners (all first corners, all second, all third; `count` is a
  /// multiple of eight) into n points in pixels of the canvas; only those that look up, or all.
  void (*draw)(const Canvas& canvas, const float* points, std::size_t n, const std::int32_t* corners, std::size_t count,
               bool upward_only);

  /// n unit normals (x of all, y of all, z of all) turned, made to look up; then how far from a surface that lies so a
  /// height may be: the tolerance and `per_slope_mm` times the rise per distance. `faces` has room for 4 n.
  void (*turn_faces)(const float* turn, const float* normals, std::size_t n, float tolerance_mm, float per_slope_mm,
                     float* faces);
  /// Compares a template with the picture.
  void (*dense)(const Picture& picture, const Drawn& drawn, const DenseLimits& limits, DenseSum& sum);
  /// The same for a template that was drawn with a pixel `every` times as wide, and lies on every so many of the
  /// picture's. Its own neighbours are a jump apart from `model_jump_mm` on. Nothing about normals and curvature.
  void (*glance)(const Picture& picture, const Drawn& drawn, int every, float model_jump_mm, DenseSum& sum);
  /// Which pixels of a template lie at an edge of its own, beside what is a jump lower, and which within a surface: a
  /// bit each, a byte for eight pixels of a row, row by row.
  void (*outline)(const Drawn& drawn, float jump_mm, std::uint8_t* inner, std::uint8_t* edges);
  /// PixelState (verification.hpp) of the template's pixels, in its layout; writes nothing about eights of a row that
  /// are empty.
  void (*states)(const Picture& picture, const Drawn& drawn, std::uint8_t* states);

  /// A row of a picture: what has too few neighbours on its own surface becomes NaN. Rows lie `stride` apart; here and
  /// below as many pixels around the row are read as a loop looks far, and up to seven more.
  void (*clean)(const float* z, std::ptrdiff_t stride, int cols, float jump_mm, int neighbours_min, float* out);
  /// Plane through each pixel and its eight neighbours on the same surface, at the pixel.
  void (*smooth)(const float* measured, std::ptrdiff_t stride, int cols, float jump_mm, float* z);
  /// What the smoothed surface tells.
  void (*surface)(const float* z, std::ptrdiff_t stride, int cols, float jump_mm, float per_mm, const SurfaceRow& out);
  /// Distances to the next edge in each column, at most kEdgeReachPx, carried on to the next row.
  void (*column_distance)(const std::uint8_t* edge, int cols, std::int16_t* distance);
  /// From the column distances to both sides, the nearest edge of all; ways: room for cols + 2 kEdgeReachPx + 15.
  void (*nearest_edges)(const std::int16_t* above, const std::int16_t* below, int cols, int row, std::int16_t* ways,
                        float* distance_px, std::int32_t* nearest);
};

/// Best for this processor, or those that the environment names in BINPICK_LOOPS when it is first asked for, or that
/// use() was given last.
const Table& table();
/// table() is these from now on. Not while a detection runs: half of it would go either way.
void use(const Table& loops);
/// By their name; null: neither this build nor this processor has them.
const Table* find(std::string_view name);
/// What table() is with that value of BINPICK_LOOPS; null: not set.
const Table& chosen(const char* loops);
/// For comparisons: the portable one.
const Table& portable();
}  // namespace binpick::vision::kernels
