#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/expected.hpp"

namespace binpick::vision {
/// A whole file. The error is text: what, where, what to do.
Expected<std::vector<std::byte>, std::string> read_file(const std::string& path);
/// FileBytes and whatever keeps them: a mapping or a buffer. Cheap copies.
struct FileBytes {
  std::span<const std::byte> bytes;
  std::shared_ptr<const void> keeper;
};
FileBytes kept(std::vector<std::byte> bytes);
/// A whole file, mapped: nothing is read before it is used. What cannot be mapped (a pipe) is read.
/// The file must be replaced by renaming, as write_file() does, not written over, while it is mapped.
Expected<FileBytes, std::string> map_file(const std::string& path);

/// Written beside `path` under another name first and then renamed: a reader sees the old file or the whole new one. It
/// is on the disk when this returns; a power cut before leaves the old file.
Expected<void, std::string> write_file(const std::string& path, std::span<const std::byte> bytes);
}  // namespace binpick::vision
