#include "tests/support/cell_file.hpp"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <unistd.h>

namespace binpick::support {
namespace fs = std::filesystem;

CellFile coarse_cell() {
  CellFile file;
  file.frequency_hz = 200;
  file.resolution_deg = 0.4;
  file.sweep_speed_deg_s = 20;
  return file;
}

namespace {
/// Where the supply is and how it is swept, by what the scanner can see.
struct Layout {
  Eigen::Vector3d size_mm;
  int pivot_height_mm, sweep_deg;
};
Layout layout_of(const CellFile& file) {
  // To be located the supply's rim has to be seen, wherever it stands.
  if (file.scanner == "lms400") return {{1000, 800, file.belt ? 0.0 : 500.0}, 1860, file.locate ? 26 : 15};
  return {{300, 300, file.belt ? 0.0 : 120.0}, file.locate ? 800 : 560, file.locate ? 26 : 19};
}

void write_scanner(std::ostream& out, const CellFile& file) {
  out << "[scanner]\nmodel = \"" << file.scanner << "\"\naddress = \"127.0.0.1:" << file.scanner_port
      << "\"\nlatency_ms = " << file.scanner_latency_ms
      << (file.scan_path == 0
              ? "\nT_pivot_scanner = { xyz_mm = [60, 0, 0], rpy_deg = [180, -90, 0] }\n"
              : "\ncarrier = \"robot\"\nT_flange_scanner = { xyz_mm = [0, 80, 120], rpy_deg = [0, 0, 0] }\n");
  if (file.scanner == "lms400")
    out << "frequency_hz = " << file.frequency_hz << "\nresolution_deg = " << file.resolution_deg
        << (file.locate ? "\nstart_deg = 55\nrange_deg = 70\n" : "\nstart_deg = 70\nrange_deg = 40\n");
  else
    out << "listen_port = 0\n";
}
}  // namespace

std::string to_toml(const CellFile& file) {
  const Layout layout = layout_of(file);
  std::ostringstream out;
  if (!file.record_dir.empty()) out << "[record]\ndir = \"" << file.record_dir << "\"\n\n";
  out << "[cell]\nname = \"test\"\nstate_dir = \"" << file.state_dir << "\"\npicture_dir = \"" << file.picture_dir
      << "\"\n\n[plc]\nrole = \"" << file.plc_role << (file.plc_role == "client" ? "\"\naddress" : "\"\nlisten")
      << " = \"127.0.0.1:" << file.plc_port << "\"\nword_order = \"" << file.word_order << "\"\npose_convention = \""
      << file.robot << "\"\nallow = []\ndetect_timeout_ms = " << file.detect_timeout_ms << "\n\n";
  if (file.scan_path == 0)
    out << "[pivot]\ncan = \"cannelloni://127.0.0.1:" << file.can_port
        << "\"\ncan_listen_port = " << file.can_listen_port << "\nprotocol = \"" << file.pivot
        << "\"\nmodule_id = 12\nT_base_pivot = { xyz_mm = [1200, 0, " << layout.pivot_height_mm
        << "], rpy_deg = [0, 90, 0] }\n\n";
  write_scanner(out, file);
  out << "\n[robot]\ndialect = \"" << file.robot << "\"\nsilence_max_s = 5\nlisten = \""
      << (file.robot_port == 0 ? "" : "127.0.0.1:" + std::to_string(file.robot_port)) << "\"\nallow = []\n";
  if (file.scan_path != 0)
    out << (file.robot == "ur" ? "pose_address" : "pose_listen") << " = \"127.0.0.1:" << file.pose_port
        << "\"\npose_latency_ms = " << file.pose_latency_ms << "\n";
  out << "\n[reach]\ntilt_max_deg = " << file.tilt_max_deg << "\n\n[detection]\nthreads = 2\ndeadline_ms = 4500\n\n"
      << "[picks]\nper_scan = " << file.picks_per_scan << "\n\n[[supply]]\nid = 1\nname = \"lattice box\"\nsize_mm = ["
      << layout.size_mm.x() << ", " << layout.size_mm.y() << ", " << layout.size_mm.z() << "]\n"
      << "T_base_supply = { xyz_mm = [1200, 0, 0], rpy_deg = [0, 0, 0] }\nlocate = " << (file.locate ? "true" : "false")
      << "\n";
  if (file.scan_path != 0)
    out << "scan_path = " << file.scan_path << "\npath_timeout_ms = 4500\n";
  else
    out << "sweep_start_deg = " << -layout.sweep_deg << "\nsweep_end_deg = " << layout.sweep_deg
        << "\nsweep_speed_deg_s = "
        << (file.scanner == "lms400" ? file.sweep_speed_deg_s : file.sweep_speed_deg_s * 0.4) << "\n";
  if (file.second_supply)
    out << "\n[[supply]]\nid = 2\nname = \"beside it\"\nsize_mm = [600, 600, 300]\nT_base_supply = { xyz_mm = ["
        << 1200 + kBeside_mm.x() << ", " << kBeside_mm.y() << ", " << kBeside_mm.z()
        << "], rpy_deg = [0, 0, 0] }\nsweep_start_deg = 20\nsweep_end_deg = 38\nsweep_speed_deg_s = "
        << file.sweep_speed_deg_s << "\n";
  int id = 0;
  const std::string folder = std::string{BINPICK_TEST_PARTS} + (file.belt ? "/belt/" : "/");
  for (const auto& part : file.parts) {
    ++id;
    out << "\n[[part]]\nid = " << id << "\nfile = \"" << folder << part << ".toml\"\nknowledge_base = \"";
    if (file.own_copies)
      out << "part" << id << ".kb";
    else
      out << folder << part << ".kb";
    out << "\"\nscore_min = " << file.score_min << "\n";
  }
  return out.str();
}

TestFolder::TestFolder() {
  std::string pattern = (fs::temp_directory_path() / "binpick-test-XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("no temporary folder: " + pattern);
  path_ = pattern;
}

TestFolder::~TestFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

std::string TestFolder::write(const CellFile& file, const std::string& name) {
  const std::string file_path = path_ + "/" + name;
  std::ofstream(file_path) << to_toml(file);
  for (std::size_t i = 0; file.own_copies && i < file.parts.size(); ++i)
    fs::copy_file(std::string{BINPICK_TEST_PARTS} + "/" + file.parts[i] + ".kb",
                  path_ + "/part" + std::to_string(i + 1) + ".kb", fs::copy_options::overwrite_existing);
  return file_path;
}

std::shared_ptr<const daemon::CellData> TestFolder::load(const CellFile& file) {
  auto loaded = daemon::load_cell(write(file));
  if (loaded) return *loaded;
  std::string text;
  for (const auto& finding : loaded.error()) text += finding + "\n";
  throw std::runtime_error(text);
}

TestFolder& test_folder() {
  static TestFolder folder;
  return folder;
}
}  // namespace binpick::support
