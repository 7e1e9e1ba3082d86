#include "daemon/boot_count.hpp"

#include <ctime>
#include <filesystem>
#include <fstream>

#include "base/log.hpp"
#include "vision/file.hpp"

namespace binpick::daemon {
std::uint16_t next_boot_count(const std::string& state_dir) {
  const auto from_clock = [] { return static_cast<std::uint16_t>(1 + std::time(nullptr) % 65535); };
  if (state_dir.empty()) return from_clock();
  const auto path = (std::filesystem::path(state_dir) / "boot_count").string();
  unsigned last = 0;
  std::ifstream(path) >> last;
  const auto count = static_cast<std::uint16_t>(last >= 65535 ? 1 : last + 1);
  std::error_code ignored;  // what is wrong with the folder shows when the file is written
  std::filesystem::create_directories(state_dir, ignored);
  const std::string line = std::to_string(count) + '\n';
  if (const auto written = vision::write_file(path, std::as_bytes(std::span{line})); !written) {
    BINPICK_LOG(Warning, "daemon", "%s: the boot count comes from the clock; see cell.state_dir",
                written.error().c_str());
    return from_clock();
  }
  return count;
}
}  // namespace binpick::daemon
