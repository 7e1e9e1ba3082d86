#include "tools/output.hpp"

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>
#include <unistd.h>

namespace binpick::tools {
std::string cannot_be_written(const std::string& path) {
  namespace fs = std::filesystem;
  std::error_code none;
  if (fs::is_directory(path, none)) return path + ": is a folder; name a file in it";
  const fs::path parent = fs::path{path}.parent_path();
  const std::string folder = parent.empty() ? "." : parent.string();
  if (!fs::is_directory(folder, none)) return path + ": there is no folder " + folder + "; make it first";
  if (::access(folder.c_str(), W_OK) != 0)
    return path + ": cannot be written: " + std::strerror(errno) + "; check who may write to " + folder;
  return {};
}
}  // namespace binpick::tools
