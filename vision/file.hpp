#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "base/expected.hpp"

namespace binpick::vision {
/// A whole file. The error is text: what, where, what to do.
Expected<std::vector<std::byte>, std::string> read_file(const std::string& path);
/// Written beside `path` under another name first and then renamed: a reader sees the old file or the whole new one.
Expected<void, std::string> write_file(const std::string& path, std::span<const std::byte> bytes);
}  // namespace binpick::vision
