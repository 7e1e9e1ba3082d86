#include "daemon/boot_count.hpp"

#include <ctime>
#include <filesystem>
#include <fstream>

#include "base/log.hpp"

namespace binpick::daemon {
std::uint16_t next_boot_count(const std::string& state_dir) {
  const auto from_clock = [] { return static_cast<std::uint16_t>(1 + std::time(nullptr) % 65535); };
  if (state_dir.empty()) return from_clock();
  const auto path = std::filesystem::path(state_dir) / "boot_count";
  unsigned last = 0;
  std::ifstream(path) >> last;
  const auto count = static_cast<std::uint16_t>(last >= 65535 ? 1 : last + 1);
  // Written beside and renamed: a power cut leaves the old count or the new one, never half a file.
  const auto fresh = path.string() + ".new";
  std::error_code failed;
  std::filesystem::create_directories(state_dir, failed);
  {
    std::ofstream out(fresh);
    out << count << '\n';
    out.flush();
    if (!out) failed = std::make_error_code(std::errc::io_error);
  }
  if (!failed) std::filesystem::rename(fresh, path, failed);
  if (failed) {
    BINPICK_LOG(Warning, "daemon", "%s cannot be written (%s): the boot count comes from the clock; see cell.state_dir",
                path.c_str(), failed.message().c_str());
    return from_clock();
  }
  return count;
}
}  // namespace binpick::daemon
