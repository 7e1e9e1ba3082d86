#pragma once

#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>

namespace binpick::daemon {
/// Where files never wait for a disk, if this machine has such a place.
inline std::filesystem::path folder_in_memory() {
  return std::filesystem::exists("/dev/shm") ? "/dev/shm" : std::filesystem::temp_directory_path();
}

/// A folder of one test, removed at its end.
class OwnFolder {
 public:
  explicit OwnFolder(const std::filesystem::path& under = std::filesystem::temp_directory_path()) {
    std::string name = (under / "binpick-daemon-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder");
    folder_ = name;
  }
  ~OwnFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  OwnFolder(const OwnFolder&) = delete;
  OwnFolder& operator=(const OwnFolder&) = delete;

  std::string path(const std::string& name) const { return folder_ + "/" + name; }

 private:
  std::string folder_;
};
}  // namespace binpick::daemon
