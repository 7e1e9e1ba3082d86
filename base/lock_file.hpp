#pragma once

#include <string>

namespace binpick {
/// A file that one process holds at a time; the system takes it back when the process ends, however it ends.
class LockFile {
 public:
  /// Makes the file where it can. A folder that cannot be written locks nothing.
  explicit LockFile(const std::string& path);
  ~LockFile();
  LockFile(const LockFile&) = delete;
  LockFile& operator=(const LockFile&) = delete;

  bool held_by_another() const { return held_by_another_; }

  /// Whether some process holds it, without touching it.
  static bool is_held(const std::string& path);

 private:
  int fd_ = -1;
  bool held_by_another_ = false;
};
}  // namespace binpick
