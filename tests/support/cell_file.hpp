#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "daemon/cycle/cell_data.hpp"

namespace binpick::support {
/// What tests vary in a cell file; the rest is one cell: an LMS 400 over a lattice box, or an LPS 36 over a small box.
struct CellFile {
  std::string scanner = "lms400";  ///< scanner.model; size and place of the supply and the sweep go with it.
  std::uint16_t scan_path = 0;     ///< Other than 0: the robot carries the scanner, along this path (scan_paths.hpp).
  std::string word_order = "s7";
  std::string plc_role = "server";                  ///< plc.role: what the daemon is.
  std::string pivot = "powercube";                  ///< pivot.protocol.
  std::string robot = "ur";                         ///< robot.dialect and plc.pose_convention.
  std::vector<std::string> parts = {"track_link"};  ///< Example parts that the build has trained; ids 1, 2, ….
  bool own_copies = false;                          ///< Each recipe gets a knowledge base file of its own.
  bool second_supply = false;                       ///< Id 2: a place on the floor beside the box, see kBeside_mm.
  double tilt_max_deg = 45;
  double score_min = 0.5;
  double sweep_speed_deg_s = 25;
  double frequency_hz = 360;
  double resolution_deg = 0.25;
  double scanner_latency_ms = 0;
  std::uint16_t pose_port = 30004;
  double pose_latency_ms = 0;  ///< Where the robot carries the scanner.
  int detect_timeout_ms = 5000;
  int picks_per_scan = 1;
  bool locate = false;  ///< The first supply, by its rim.
  bool belt = false;    ///< The supply has no walls, and the parts are trained for picking = "conveyor".
  std::string state_dir;
  std::string picture_dir;
  std::string record_dir;
  // Sockets, for tests that use them; in memory nobody looks at them.
  std::uint16_t plc_port = 1502, can_port = 20000, can_listen_port = 0, scanner_port = 2111;
  std::uint16_t robot_port = 5002;  ///< 0: no robot connects.
};

/// A third of the points: for tests that look at the sequence and not at millimetres, and have to keep pace under a
/// sanitizer.
CellFile coarse_cell();

/// Middle of the second supply in the first one's frame; 600 × 600 mm, an LMS 400 on the pivot sees both.
inline const Eigen::Vector3d kBeside_mm{0, 1000, 0};

std::string to_toml(const CellFile& file);

/// A folder of its own for one test program, removed at its end.
class TestFolder {
 public:
  TestFolder();
  ~TestFolder();
  TestFolder(const TestFolder&) = delete;
  TestFolder& operator=(const TestFolder&) = delete;

  const std::string& path() const { return path_; }
  /// Returns the path of what was written.
  std::string write(const CellFile& file, const std::string& name = "cell.toml");
  /// write() and load: a file that tests wrote is good.
  std::shared_ptr<const daemon::CellData> load(const CellFile& file);

 private:
  std::string path_;
};

/// The program's one folder.
TestFolder& test_folder();
}  // namespace binpick::support
