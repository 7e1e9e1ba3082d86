#include "daemon/record_ring.hpp"

#include <algorithm>
#include <cinttypes>
#include <cstdio>
#include <filesystem>
#include <vector>

#include "vision/file.hpp"

namespace binpick::daemon {
namespace {
namespace fs = std::filesystem;

/// A file takes whole blocks.
std::uint64_t on_disk(std::uint64_t bytes) { return (bytes + 4095) / 4096 * 4096; }

/// A record, or what is left of one that was being written ("….bpr.part4711").
bool is_ours(const std::string& name) { return name.starts_with("cycle-") && name.find(".bpr") != std::string::npos; }

std::string megabytes(std::uint64_t bytes) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f MB", static_cast<double>(bytes) / 1e6);
  return text;
}
}  // namespace

std::string record_name(const RecordOrigin& origin) {
  char name[64];
  std::snprintf(name, sizeof name, "cycle-%05u-%08" PRIu64 ".bpr", origin.boot_count, origin.cycle_id);
  return name;
}

Expected<void, std::string> RecordRing::look() {
  files_.clear();
  bytes_ = 0;
  std::error_code failure;
  fs::create_directories(dir_, failure);
  struct Found {
    fs::file_time_type at;
    File file;
  };
  std::vector<Found> found;
  for (fs::directory_iterator it{dir_, failure}, end; !failure && it != end; it.increment(failure)) {
    const std::string name = it->path().filename().string();
    std::error_code gone;  // between two looks: it takes no room any more
    if (!is_ours(name) || !it->is_regular_file(gone)) continue;
    const auto bytes = it->file_size(gone);
    const auto at = it->last_write_time(gone);
    if (!gone) found.push_back({at, {name, on_disk(bytes)}});
  }
  if (failure)
    return unexpected("the folder of the records cannot be used, " + dir_ + ": " + failure.message() +
                      "; see record.dir");
  std::ranges::sort(
      found, [](const Found& a, const Found& b) { return a.at != b.at ? a.at < b.at : a.file.name < b.file.name; });
  for (Found& one : found) {
    bytes_ += one.file.bytes;
    files_.push_back(std::move(one.file));
  }
  known_ = true;
  return {};
}

void RecordRing::forget(const std::string& name) {
  const auto file = std::ranges::find(files_, name, &File::name);
  if (file == files_.end()) return;
  bytes_ -= file->bytes;
  files_.erase(file);
}

Expected<void, std::string> RecordRing::write(const std::string& name, ByteView bytes, std::uint64_t bytes_max) {
  if (!known_)
    if (auto looked = look(); !looked) return looked;
  const std::uint64_t needed = on_disk(bytes.size());
  if (needed > bytes_max)
    return unexpected(name + " takes " + megabytes(needed) + ", all records together may take " + megabytes(bytes_max) +
                      "; raise record.size_max_mb");
  while (!files_.empty() && bytes_ + needed > bytes_max) {
    const std::string oldest = dir_ + "/" + files_.front().name;
    std::error_code failure;
    fs::remove(oldest, failure);  // what somebody else has removed is gone as well
    if (failure) {
      known_ = false;
      return unexpected("cannot remove " + oldest + ": " + failure.message() + "; see record.dir");
    }
    bytes_ -= files_.front().bytes;
    files_.pop_front();
  }
  if (auto written = vision::write_file(dir_ + "/" + name, bytes); !written) {
    known_ = false;  // the folder may have gone, or another disk stands in its place
    return written;
  }
  if (!files_.empty() && name <= files_.back().name) forget(name);  // a boot count that was lost begins anew
  files_.push_back({name, needed});
  bytes_ += needed;
  return {};
}
}  // namespace binpick::daemon
