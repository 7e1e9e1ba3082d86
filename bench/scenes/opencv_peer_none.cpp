#include <stdexcept>

#include "bench/scenes/opencv_peer.hpp"

namespace binpick::bench {
struct OpencvPeer::Impl {};
OpencvPeer::OpencvPeer(const ScenePart&, const Judge&) {
  throw std::runtime_error{"built without OpenCV's surface_matching; .ci/install bench, then configure again"};
}
OpencvPeer::~OpencvPeer() = default;
bool OpencvPeer::built() { return false; }
double OpencvPeer::training_s() const { return 0; }
void OpencvPeer::detect(const std::vector<Eigen::Vector3f>&, SceneLine&) const {}
}  // namespace binpick::bench
