#include <gtest/gtest.h>

#include "tests/unit/config/cell_files.hpp"

namespace binpick::config {
// The whole text that an integrator sees; reviewed like code.
constexpr const char* kExpected =
    R"(broken.toml:3:8: this is no TOML value; put a text in "quotes", write a number as 1.5, a flag as true or false
  3 | name = demo
    |        ^~~~
broken.toml:6:14: plc.word_order = "s5" is not one of "s7", "logix"; did you mean "s7"?
  6 | word_order = "s5"
    |              ^~~~
broken.toml:10:13: pivot.module_id = "twelve" is not a whole number; write it as module_id = 12
  10 | module_id = "twelve"
     |             ^~~~~~~~
broken.toml:16:16: scanner.frequency_hz = 900 is outside 150 … 500; use at most 500
  16 | frequency_hz = 900
     |                ^~~
broken.toml:18:13: scanner.start_deg + scanner.range_deg = 130 is beyond the field of view, 55 … 125; use range_deg = 55 at most
  18 | range_deg = 60
     |             ^~
broken.toml:19:38: scanner.T_pivot_scanner.xyz_mm[2] = nan is not a finite number; give one within -20000 … 20000
  19 | T_pivot_scanner = { xyz_mm = [60, 0, nan], rpy_deg = [180, -90, 0] }
     |                                      ^~~
broken.toml:22:1: unknown key "tilt_max_degree" in [reach]; did you mean "tilt_max_deg"?
  22 | tilt_max_degree = 30
     | ^~~~~~~~~~~~~~~
broken.toml:31:1: supply.size_mm is missing in [[supply]]; add, for example: size_mm = [1000, 800, 500]
  31 | [[supply]]
     | ^~~~~~~~~~
broken.toml:32:6: supply.id = 1 stands also in line 25; give each entry its own
  32 | id = 1
     |      ^
broken.toml:39:8: part.file: no_such_part.toml cannot be opened: No such file or directory; check the path and who may read it
  39 | file = "no_such_part.toml"
     |        ^~~~~~~~~~~~~~~~~~~
)";

TEST(Broken, TenMistakesTenFindingsAllAtOnce) {
  const std::string text = read_text(in_source("tests/data/broken.toml"));
  ASSERT_FALSE(text.empty());
  const auto loaded = load_text("broken.toml", text);
  ASSERT_FALSE(loaded.has_value());
  EXPECT_EQ(loaded.error().size(), 10U);
  std::string shown;
  for (const auto& finding : loaded.error()) shown += to_string(finding) + "\n";
  EXPECT_EQ(shown, kExpected);
}
}  // namespace binpick::config
