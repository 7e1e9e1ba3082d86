#include "bench/scenes/classes.hpp"

#include <algorithm>

#include "base/check.hpp"

namespace binpick::bench {
const std::array<ClassSetting, 3>& class_settings() {
  using enum vision::ScannerClass;
  static const std::array<ClassSetting, 3> settings{
      ClassSetting{Lps36Hi, "lps36hi", {180, 180, 60}, true, 110, 0.1, 0.03, 0.0001, 0.8, 0.4},
      ClassSetting{Lps36, "lps36", {300, 300, 120}, true, 110, 0.1, 0.1, 0.00017, 1.5, 0.8},
      ClassSetting{Lms400, "lms400", {1000, 800, 500}, false, 0, 0, 0, 0.0001, 3.0, 3.0}};
  return settings;
}

const ClassSetting& setting_of(vision::ScannerClass scanner) {
  const auto it = std::ranges::find(class_settings(), scanner, &ClassSetting::scanner);
  BINPICK_CHECK(it != class_settings().end());
  return *it;
}

const ClassSetting* find_setting(std::string_view name) {
  const auto it = std::ranges::find(class_settings(), name, &ClassSetting::name);
  return it == class_settings().end() ? nullptr : &*it;
}
}  // namespace binpick::bench
