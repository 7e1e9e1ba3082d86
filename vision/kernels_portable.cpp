#include "vision/kernels.hpp"

/// The inner loops for any x86-64 processor.
namespace binpick::vision::kernels {
namespace {
#include "vision/kernels_body.inc"
#include "vision/kernels_dense.inc"
#include "vision/kernels_scene.inc"
}  // namespace
extern const Table kPortable;
const Table kPortable{"portable",   &coarse, &sparse,     &edges,   &match_surface,   &match_edges,
                      &move_points, &draw,   &turn_faces, &dense,   &glance,          &outline,
                      &states,      &clean,  &smooth,     &surface, &column_distance, &nearest_edges};
}  // namespace binpick::vision::kernels
