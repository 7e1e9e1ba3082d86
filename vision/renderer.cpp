#include "vision/renderer.hpp"

#include <GL/gl.h>
#include <GL/osmesa.h>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <vector>

#include "base/check.hpp"

namespace binpick::vision {
namespace {
constexpr int kSideMax = 8192;  ///< Pixels; llvmpipe draws up to 16384.

/// llvmpipe's own threads cost more than they bring with small images, and we run one context per thread anyway.
void keep_mesa_on_one_thread() {
  static const bool done = ::setenv("LP_NUM_THREADS", "0", 1) == 0;
  BINPICK_CHECK(done);
}

class OsmesaRenderer final : public DepthRenderer {
 public:
  explicit OsmesaRenderer(const Mesh& mesh) {
    keep_mesa_on_one_thread();
    // Small numbers keep their digits: the mesh is moved to its own middle before it becomes float for good.
    Eigen::AlignedBox3d box;
    for (const Eigen::Vector3f& v : mesh.vertices_mm) box.extend(v.cast<double>());
    if (!box.isEmpty()) middle_ = box.center();
    for (const Eigen::Vector3f& v : mesh.vertices_mm) vertices_.push_back((v.cast<double>() - middle_).cast<float>());
    for (const auto& triangle : mesh.triangles) indices_.insert(indices_.end(), triangle.begin(), triangle.end());
    constexpr int kAttributes[] = {OSMESA_FORMAT,
                                   OSMESA_RGBA,
                                   OSMESA_DEPTH_BITS,
                                   32,
                                   OSMESA_PROFILE,
                                   OSMESA_COMPAT_PROFILE,
                                   OSMESA_CONTEXT_MAJOR_VERSION,
                                   2,
                                   0};
    context_ = OSMesaCreateContextAttribs(kAttributes, nullptr);
    BINPICK_CHECK(context_ != nullptr);
  }
  ~OsmesaRenderer() override {
    if (OSMesaGetCurrentContext() == context_) OSMesaMakeCurrent(nullptr, nullptr, GL_UNSIGNED_BYTE, 0, 0);
    OSMesaDestroyContext(context_);
  }
  OsmesaRenderer(const OsmesaRenderer&) = delete;
  OsmesaRenderer& operator=(const OsmesaRenderer&) = delete;

  void render(const Eigen::Isometry3d& T_supply_object, DepthImage& image) override {
    const auto rows = static_cast<int>(image.z_mm.rows()), cols = static_cast<int>(image.z_mm.cols());
    image.z_mm.setConstant(std::numeric_limits<float>::quiet_NaN());
    if (rows == 0 || cols == 0 || indices_.empty()) return;
    BINPICK_CHECK(rows <= kSideMax && cols <= kSideMax);
    bind(rows, cols);

    // The depth range is as tight as the part in this rotation, so that the buffer's steps are far below a micrometre.
    const Eigen::Vector3f down = T_supply_object.linear().row(2).cast<float>().transpose();
    float low = std::numeric_limits<float>::infinity(), high = -low;
    for (const Eigen::Vector3f& v : vertices_) {
      const float z = down.dot(v);
      low = std::min(low, z);
      high = std::max(high, z);
    }
    const double margin = 0.01 * (double{high} - double{low}) + 0.01;
    const double span = double{high} - double{low} + 2 * margin;
    const Eigen::Vector3d middle = T_supply_object * middle_;
    const double top = middle.z() + double{high} + margin;

    // Object to clip coordinates at once, in double: pixel centres on whole pixels of the image, the highest nearest.
    Eigen::Matrix4d clip = Eigen::Matrix4d::Zero();
    const double width = cols * image.pixel_mm, height = rows * image.pixel_mm;
    clip.block<1, 3>(0, 0) = 2 / width * T_supply_object.linear().row(0);
    clip(0, 3) = 2 / width * (middle.x() - image.origin_mm.x() + 0.5 * image.pixel_mm) - 1;
    clip.block<1, 3>(1, 0) = 2 / height * T_supply_object.linear().row(1);
    clip(1, 3) = 2 / height * (middle.y() - image.origin_mm.y() + 0.5 * image.pixel_mm) - 1;
    clip.block<1, 3>(2, 0) = -2 / span * T_supply_object.linear().row(2);
    clip(2, 3) = 2 * (top - middle.z()) / span - 1;
    clip(3, 3) = 1;
    const Eigen::Matrix4f clip_f = clip.cast<float>();

    glViewport(0, 0, cols, rows);
    glClear(GL_DEPTH_BUFFER_BIT);
    glLoadMatrixf(clip_f.data());
    glDrawElements(GL_TRIANGLES, static_cast<GLsizei>(indices_.size()), GL_UNSIGNED_INT, indices_.data());
    depth_.resize(static_cast<std::size_t>(rows) * static_cast<std::size_t>(cols));
    glReadPixels(0, 0, cols, rows, GL_DEPTH_COMPONENT, GL_FLOAT, depth_.data());
    BINPICK_CHECK(glGetError() == GL_NO_ERROR);
    float* z = image.z_mm.data();
    for (std::size_t i = 0; i < depth_.size(); ++i)
      if (depth_[i] < 1.0F) z[i] = static_cast<float>(top - double{depth_[i]} * span);
  }

 private:
  void bind(int rows, int cols) {
    // A frame of just this image, whatever was drawn before: Mesa counts rows from the frame's top, and the rounding of
    // heights must not depend on history.
    if (rows == bound_rows_ && cols == bound_cols_ && OSMesaGetCurrentContext() == context_) return;
    bound_rows_ = rows;
    bound_cols_ = cols;
    colour_.resize(static_cast<std::size_t>(rows) * static_cast<std::size_t>(cols) * 4);
    BINPICK_CHECK(OSMesaMakeCurrent(context_, colour_.data(), GL_UNSIGNED_BYTE, cols, rows) == GL_TRUE);
    glEnable(GL_DEPTH_TEST);
    glDepthFunc(GL_LESS);
    glDisable(GL_CULL_FACE);  // A mesh with flipped normals looks the same.
    glDisable(GL_DITHER);
    glColorMask(GL_FALSE, GL_FALSE, GL_FALSE, GL_FALSE);
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
    glMatrixMode(GL_MODELVIEW);
    glLoadIdentity();
    glMatrixMode(GL_PROJECTION);
    glEnableClientState(GL_VERTEX_ARRAY);
    glVertexPointer(3, GL_FLOAT, sizeof(Eigen::Vector3f), vertices_.data());
  }

  OSMesaContext context_ = nullptr;
  Eigen::Vector3d middle_ = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3f> vertices_;  ///< Relative to middle_.
  std::vector<GLuint> indices_;
  std::vector<unsigned char> colour_;  ///< OSMesa wants one, nobody draws in it.
  int bound_rows_ = 0, bound_cols_ = 0;
  std::vector<float> depth_;
};
}  // namespace

std::unique_ptr<DepthRenderer> make_osmesa_renderer(const Mesh& mesh) { return std::make_unique<OsmesaRenderer>(mesh); }
}  // namespace binpick::vision
