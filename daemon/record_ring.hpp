#pragma once

#include <cstdint>
#include <deque>
#include <string>

#include "base/bytes.hpp"
#include "base/expected.hpp"
#include "daemon/cycle/record.hpp"

namespace binpick::daemon {
/// "cycle-00012-00000345.bpr": sorts by start and cycle.
std::string record_name(const RecordOrigin& origin);

/// A folder of records that stays below a size: the oldest go. What a killed writer left unfinished counts as well.
/// Used by one thread; slow, as disks are.
class RecordRing {
 public:
  explicit RecordRing(std::string dir) : dir_{std::move(dir)} {}

  const std::string& dir() const { return dir_; }
  /// Whole and on the disk when it returns, or not there under this name; the error says why. Makes the folder if it
  /// has to.
  Expected<void, std::string> write(const std::string& name, ByteView bytes, std::uint64_t bytes_max);
  std::uint64_t bytes() const { return bytes_; }  ///< On the disk, as far as is known.

 private:
  struct File {
    std::string name;
    std::uint64_t bytes = 0;
  };
  Expected<void, std::string> look();
  void forget(const std::string& name);

  std::string dir_;
  bool known_ = false;       // files_ is what lies in the folder
  std::deque<File> files_;   // oldest first
  std::uint64_t bytes_ = 0;  // of files_
};
}  // namespace binpick::daemon
