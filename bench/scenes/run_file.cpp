#include "bench/scenes/run_file.hpp"

#include <filesystem>
#include <stdexcept>

namespace binpick::bench {
RunFile::RunFile(const std::string& folder, const RunHeader& header, const std::string& name)
    : before_{read_run(folder)}, path_{folder + "/" + name + ".jsonl"} {
  if (before_.header && *before_.header != header)
    throw std::runtime_error{folder + ": holds a run made as " + to_json(*before_.header) + ", this one is " +
                             to_json(header) + "; use another folder"};
  std::filesystem::create_directories(folder);
  out_.open(path_, std::ios::app);
  out_ << '\n' << to_json(header) << '\n' << std::flush;
}

void RunFile::write(const SceneLine& line) {
  out_ << to_json(line) << '\n' << std::flush;
  if (!out_) throw std::runtime_error{path_ + ": cannot be written; check folder and free space"};
}

std::string shard_name(const std::string& split, std::size_t shard, std::size_t shards) {
  return split + "-" + std::to_string(shard) + "of" + std::to_string(shards);
}
}  // namespace binpick::bench
