#include <cstdio>
#include <fstream>

#include "plc/page.hpp"

/// Writes docs/plc-registers.md: `plc_docs docs/plc-registers.md`.
int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "plc_docs: give the file to write, docs/plc-registers.md\n");
    return 2;
  }
  std::ofstream out{argv[1], std::ios::binary};
  out << binpick::plc::registers_page();
  if (!out.flush()) {
    std::fprintf(stderr, "plc_docs: cannot write %s\n", argv[1]);
    return 1;
  }
  return 0;
}
