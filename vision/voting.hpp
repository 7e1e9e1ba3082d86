#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "vision/depth_image.hpp"
#include "vision/knowledge_base_impl.hpp"
#include "vision/team.hpp"

namespace binpick::vision {
/// The part in the rotation of one view, its anchor at one maximum of the scene.
struct Ballot {
  std::uint32_t maximum = 0;
  std::uint16_t view = 0;
  float votes = 0;  ///< Relative to what the view could expect.
};

struct VoteOptions {
  std::size_t ballots_max = 4096;  ///< In all; each maximum gets its share.
  double reach_mm = 10;            ///< A vote counts for a maximum this near to the place it points at.
  double height_mm = 5;            ///< … and when the heights agree so well.
  float z_floor_mm = 0;            ///< Poses that would reach deeper are not counted; -infinity: unknown.
  int threads = 2;
};

/// Each feature of the depth image looks up its votes; a vote counts when it points at a maximum; votes are clustered
/// in (maximum, rotation); the strongest of each maximum come back, maxima in order, best first within each.
std::vector<Ballot> vote(const DepthImage& image, const KnowledgeBase::Impl& part,
                         const std::vector<Eigen::Vector3f>& maxima, const VoteOptions& options,
                         const Deadline& deadline);
}  // namespace binpick::vision
