#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/expected.hpp"
#include "daemon/cycle/detection.hpp"
#include "daemon/cycle/record.hpp"

/// A recorded cycle once more: the same profiles through the same code.
namespace binpick::daemon {
/// What a replay takes in the place of what was recorded; empty: nothing.
struct ReplayChanges {
  std::string part;            ///< Part file of the recipe that was asked for.
  std::string knowledge_base;  ///< Of it.
};

struct Replayed {
  DetectRequest request;  ///< With its image.
  DetectResult result;
};

/// Repeats the record's detection, without a deadline, on the inner loops that are in use (vision/kernels.hpp). The
/// error is a text: what is missing, and what to do.
Expected<Replayed, std::string> replay(const Record& record, const ReplayChanges& changes);

/// What differs in the outcome, a line each; empty: every number is the same. Times do not count.
std::vector<std::string> differences(const DetectResult& recorded, const DetectResult& now);
}  // namespace binpick::daemon
