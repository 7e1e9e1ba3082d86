#include <cstdio>
#include <fstream>
#include <string>

#include "config/wording.hpp"

/// Writes the files that are generated from the key tables: `config_docs ROOT` puts them into a source tree.
int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: config_docs SOURCE_TREE\n");
    return 2;
  }
  const std::string root = argv[1];
  const auto write = [&](const std::string& name, const std::string& text) {
    std::ofstream file{root + "/" + name, std::ios::binary};
    file << text;
    if (file.flush()) return true;
    std::fprintf(stderr, "config_docs: %s/%s cannot be written\n", root.c_str(), name.c_str());
    return false;
  };
  using namespace binpick::config;
  const bool good = write("config/cell.example.toml", example_cell()) &&
                    write("config/part.example.toml", example_part()) && write("docs/configuration.md", reference());
  return good ? 0 : 1;
}
