#pragma once

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <unistd.h>

#include "config/config.hpp"

/// A folder with a good cell file, for tests that spoil it.
namespace binpick::config {
inline std::string read_text(const std::string& path) {
  std::ifstream file{path, std::ios::binary};
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

inline std::string in_source(const std::string& name) { return std::string{BINPICK_SOURCE_DIR} + "/" + name; }

/// A folder of its own, removed at the end: the example cell as `cell.toml`, its part and an (empty) mesh.
class CellFolder {
 public:
  CellFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "binpick-config-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary folder");
    folder_ = name;
    cell = read_text(in_source("config/cell.example.toml"));
    part = read_text(in_source("config/part.example.toml"));
    write("track_link.stl", "");
  }
  ~CellFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  CellFolder(const CellFolder&) = delete;
  CellFolder& operator=(const CellFolder&) = delete;

  std::string path(const std::string& name) const { return folder_ + "/" + name; }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream{path(name), std::ios::binary} << text;
  }
  /// Puts `to` in the place of the first `from`; a test that finds nothing to replace is wrong itself.
  CellFolder& edit(const std::string& from, const std::string& to) {
    replace(cell, from, to);
    return *this;
  }
  CellFolder& edit_part(const std::string& from, const std::string& to) {
    replace(part, from, to);
    return *this;
  }
  Expected<Config, std::vector<Diagnostic>> load() const {
    write("cell.toml", cell);
    write("track_link.toml", part);
    return config::load(path("cell.toml"));
  }
  /// "line:column: message" of each finding, one line each; of other files "name:line:column: …". Empty: a good file.
  std::string findings() const {
    const auto loaded = load();
    if (loaded) return {};
    std::string text;
    for (const auto& d : loaded.error()) {
      const std::string name = std::filesystem::path{d.file}.filename().string();
      std::string message = d.message;
      for (std::size_t at = 0; (at = message.find(folder_ + "/")) != std::string::npos;)
        message.erase(at, folder_.size() + 1);
      text += (name == "cell.toml" ? "" : name + ":") + std::to_string(d.line) + ":" + std::to_string(d.column) + ": " +
              message + "\n";
    }
    return text;
  }
  /// The line of the cell file that begins with `start`.
  int line_of(const std::string& start) const { return line_of(cell, start); }
  std::string part_line_of(const std::string& start) const { return std::to_string(line_of(part, start)); }

  std::string cell;
  std::string part;

 private:
  static void replace(std::string& text, const std::string& from, const std::string& to) {
    const std::size_t at = text.find(from);
    if (at == std::string::npos) throw std::runtime_error("nothing to replace: " + from);
    text.replace(at, from.size(), to);
  }

  static int line_of(const std::string& text, const std::string& start) {
    int line = 1;
    for (std::size_t at = 0; at < text.size(); ++line) {
      if (text.compare(at, start.size(), start) == 0) return line;
      at = text.find('\n', at);
      if (at == std::string::npos) break;
      ++at;
    }
    throw std::runtime_error("no line begins with " + start);
  }

  std::string folder_;
};

/// The example cell with a Leuze scanner over a small box in the place of the SICK over a lattice box.
inline void make_leuze(CellFolder& folder, const std::string& model) {
  const std::size_t from = folder.cell.find("frequency_hz = 360"), to = folder.cell.find("profile_timeout_ms");
  folder.cell.erase(from, to - from);
  folder.edit("model = \"lms400\"", "model = \"" + model + "\"");
  folder.edit("address = \"192.168.0.1:2111\"", "address = \"192.168.60.3:9008\"");
  folder.edit("xyz_mm = [1200, 0, 1860]", "xyz_mm = [1200, 0, 560]");
  folder.edit("size_mm = [1000, 800, 500]", "size_mm = [300, 300, 120]");
}

/// The example cell with its scanner on the robot.
inline void put_on_robot(CellFolder& folder, const std::string& dialect) {
  const std::size_t from = folder.cell.find("[pivot]"), to = folder.cell.find("[scanner]");
  folder.cell.erase(from, to - from);
  folder.edit("[scanner]\n",
              "[scanner]\ncarrier = \"robot\"\nT_flange_scanner = { xyz_mm = [0, 80, 120], rpy_deg = [0, 0, 0] }\n");
  folder.edit("\ncarrier = \"pivot\"", "\n");
  folder.edit("T_pivot_scanner = { xyz_mm = [60, 0, 0], rpy_deg = [180, -90, 0] }", "");
  folder.edit("dialect = \"ur\"",
              "dialect = \"" + dialect + "\"\n" +
                  (dialect == "ur" ? "pose_address = \"192.168.0.20:30004\"" : "pose_listen = \"0.0.0.0:5003\""));
  for (const char* key : {"sweep_start_deg = -16", "sweep_end_deg = 16", "sweep_speed_deg_s = 34"})
    folder.edit(key, "");
}
}  // namespace binpick::config
