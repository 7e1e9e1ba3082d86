#include <immintrin.h>

#include "vision/kernels.hpp"
/// The inner loops for an x86-64-v3 processor.
namespace binpick::vision::kernels {
namespace {
#include "vision/kernels_body.inc"
#include "vision/kernels_dense.inc"
#include "vision/kernels_scene.inc"
}  // namespace
extern const Table kAvx2;
const Table kAvx2{"avx2",       &coarse, &sparse,     &edges,   &match_surface,   &match_edges,
                  &move_points, &draw,   &turn_faces, &dense,   &glance,          &outline,
                  &states,      &clean,  &smooth,     &surface, &column_distance, &nearest_edges};
}  // namespace binpick::vision::kernels
