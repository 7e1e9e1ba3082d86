#pragma once

#include <fstream>
#include <string>

#include "bench/scenes/lines.hpp"

namespace binpick::bench {
/// One shard of a run: what its folder has already is not run again, what is new is added line by line, so that a run
/// may be stopped at any time.
class RunFile {
 public:
  /// `name`: of the file, without its ending. Throws std::runtime_error where the folder holds a run that was made
  /// otherwise.
  RunFile(const std::string& folder, const RunHeader& header, const std::string& name);

  bool has(const SceneLine& line) const { return before_.scenes.contains(line.key()); }
  void write(const SceneLine& line);

 private:
  RunFolder before_;
  std::string path_;
  std::ofstream out_;
};

/// "tune-0of2".
std::string shard_name(const std::string& split, std::size_t shard, std::size_t shards);
}  // namespace binpick::bench
