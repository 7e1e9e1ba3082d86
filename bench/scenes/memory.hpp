#pragma once

#include <map>
#include <string>
#include <vector>

#include "bench/scenes/run.hpp"

namespace binpick::bench {
/// What one detection takes, MiB:
/// * "file": the knowledge base; of it "views" is what both searches read (rotations, anchors, samples, edges), "votes"
///   what only voting reads (votes and where each feature's begin);
/// * "working": how much the process grew in detection, which is its first: pictures, the knowledge base's lists as the
///   loops want them, hypotheses. The whole file was read before, so that none of it counts;
/// * "peak": the most that the process ever had, file, points and program included.
/// The last two are measured (VmRSS before, VmHWM after) in a process of its own, this program again as
/// `memory REQUEST`; the others are counted.
std::map<std::string, double> memory_mib(const Scene& scene, const std::string& base_file,
                                         const vision::DetectorOptions& options, const std::string& folder);

/// The process of its own: detects once, adds its figures to the request.
void measure_memory(const std::string& request_file);
}  // namespace binpick::bench
