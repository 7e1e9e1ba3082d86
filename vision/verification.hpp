#pragma once

#include <Eigen/Geometry>

#include "vision/kernels.hpp"
#include "vision/knowledge_base_impl.hpp"
#include "vision/rasteriser.hpp"
#include "vision/scene.hpp"

namespace binpick::vision {
/// Supply from object, single precision: what thousands of hypotheses are tested in.
struct Pose {
  Eigen::Matrix3f R = Eigen::Matrix3f::Identity();
  Eigen::Vector3f t = Eigen::Vector3f::Zero();

  Eigen::Isometry3d iso() const;
};

/// Largest difference between the measured and the rendered height that counts as explained, by slope of the surface:
/// 1.5 sd of the noise (the surface is smoothed over 9 pixels), or the height of a third of a pixel.
float tolerance_of(const Scene& scene);

/// The scene as the inner loops see it, with its single heights or its smoothed surface. Lives as long as the scene.
kernels::Picture picture_of(const Scene& scene, bool single_heights);
kernels::Motion motion_of(const Eigen::Matrix3f& turn, const Eigen::Vector3f& shift);

/// Test of a view on its scattered sample points only: what it explains less what it contradicts, in pixels of the
/// whole silhouette. `p_supply` is the place of the view's first anchor.
float sparse_evidence(const Scene& scene, const KnowledgeBase::Impl& part, std::size_t view,
                      const Eigen::Vector3f& p_supply, float tolerance_mm);
/// The same for a pose that has left the view's own rotation. With fewer samples (a multiple of eight) than the view
/// has, its edges are left out.
float sparse_evidence(const Scene& scene, const KnowledgeBase::Impl& part, std::size_t view, const Pose& pose,
                      float tolerance_mm, std::size_t samples_max = 1000);

/// A pose, rendered and compared pixel by pixel with the measured surface.
struct DenseTest {
  int pixels = 0;               ///< Of the silhouette.
  int explained = 0;            ///< Measured where the model lies.
  int contradicted = 0;         ///< Measured below the model: seen through it.
  int contradicted_border = 0;  ///< Of these, beside an edge of the model: may be half a pixel of pose error.
  int occluded = 0;             ///< Measured above the model: something lies on it.
  int missing = 0;              ///< Not measured, or outside the picture.
  int holes = 0;                ///< Of these, gaps between the points of one surface (shadows.hpp),
  int unseen = 0;               ///< and what nothing hides;
  int ends = 0;                 ///< where the measured surface ends within the part's. None counted by dense_test().
  float fit = 0;                ///< Explained pixels, each weighted by how well, over explained pixels.
  int edges_found = 0;          ///< Depth jumps of the model that the scene has too.
  int edges_missing = 0;        ///< Depth jumps of the model where the measured surface goes on.
  float normal_agreement = 1;   ///< Share of explained pixels whose normals agree.
  float bend_agreement = 1;     ///< Correlation of the curvatures; 1 where the model has none.
  float evidence = 0;           ///< Explained less contradicted pixels and missing edges: what decides the order.

  float visible_fraction() const;
  float contradicted_ratio() const;
  float edge_ratio() const;
};
/// `drawn` is the pose's template (Rasteriser::draw).
DenseTest dense_test(const Scene& scene, const Rasteriser& part, const Pose& pose, const Template& drawn,
                     const kernels::Table& loops = kernels::table());

/// The evidence of a pose, judged by every so-manieth pixel in both directions: drawn with a pixel as wide as that,
/// which lies on these pixels. In pixels of full size, about what dense_test() says, at a fraction of the time.
float glance(const Scene& scene, const Rasteriser& part, const Pose& pose, Template& drawn, int every,
             const kernels::Table& loops = kernels::table());
/// Leaves some forty pixels across a part.
int glance_every(const Scene& scene, double diameter_mm);

/// How one pixel of a template compares with the scene.
enum class PixelState : std::uint8_t { Empty, Explained, Contradicted, Occluded, Missing };
/// Of pixel (r, c) at drawn.at(r, c).
void compare(const Scene& scene, const Rasteriser& part, const Pose& pose, const Template& drawn,
             std::vector<PixelState>& states, const kernels::Table& loops = kernels::table());
}  // namespace binpick::vision
