#include "tests/unit/plc/rig.hpp"

#include <algorithm>

#include "base/log.hpp"

namespace binpick::plc::test {
LogLines::LogLines() {
  log::set_sink([this](log::Level, std::string_view, std::string_view text) { lines_.emplace_back(text); });
}
LogLines::~LogLines() { log::set_sink({}); }

long LogLines::count(std::string_view text) const {
  return std::ranges::count_if(lines_, [&](const std::string& line) { return line.find(text) != std::string::npos; });
}
}  // namespace binpick::plc::test
