#include "plc/page.hpp"

#include <fstream>
#include <gtest/gtest.h>
#include <sstream>

namespace binpick::plc {
TEST(Page, TheCommittedPageIsFresh) {
  std::ifstream file{BINPICK_SOURCE_DIR "/docs/plc-registers.md", std::ios::binary};
  std::stringstream text;
  text << file.rdbuf();
  EXPECT_EQ(text.str(), registers_page())
      << "write it anew: cmake --build build/release --target plc_docs_write, then commit it";
}

TEST(Page, EveryLineHasWhatAReaderLooksFor) {
  const std::string page = registers_page();
  EXPECT_NE(page.find("| 17 | 40018 | 400018 | `status` | bits |"), std::string::npos);
  EXPECT_NE(page.find("| 62 | 40063 | 400063 | `grasp_x` | f32 | m or mm |"), std::string::npos);
  EXPECT_NE(page.find("| 74 | 40075 | 400075 | `retreat_x` | f32 | m or mm |"), std::string::npos);
  EXPECT_NE(page.find("| 87 | 40088 | 400088 | `result_sequence_tail` | u16 |"), std::string::npos);
  EXPECT_NE(page.find("| 11 | nothing found |"), std::string::npos);
  EXPECT_NE(page.find("| 102 | pivot without motor supply |"), std::string::npos);
  EXPECT_NE(page.find("Ready --> Scanning: NewRequest\n"), std::string::npos);
  EXPECT_NE(page.find("| Scanning | Deadline | Fault |"), std::string::npos);
}
}  // namespace binpick::plc
