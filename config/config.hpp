#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/expected.hpp"
#include "base/frames.hpp"
#include "drivers/pivot/session.hpp"
#include "drivers/robot/pose_source.hpp"
#include "drivers/robot/session.hpp"
#include "drivers/scanner/any/scanner.hpp"
#include "plc/session.hpp"
#include "vision/detector.hpp"
#include "vision/grasp.hpp"
#include "vision/gripper.hpp"
#include "vision/knowledge_base.hpp"
#include "vision/registration.hpp"
#include "vision/supply_place.hpp"

/// The cell file as values: what `binpick check` validates and the daemon runs on.
namespace binpick::config {
struct Supply {
  std::uint16_t id = 0;
  std::string name;
  Eigen::Vector3d size_mm = Eigen::Vector3d::Zero();  ///< Inner x, y, wall height.
  Transform<frame::Base, frame::Supply> T_base_supply;
  /// It is found by its rim in each scan, at most so far from T_base_supply.
  bool locate = false;
  vision::SupplyPlaceLimits place_limits;
  /// The sweep over it.
  Angle sweep_start, sweep_end;
  double sweep_speed_rad_s = 0.5;
  /// The same where the robot carries the scanner.
  std::uint16_t scan_path = 1;
  std::chrono::milliseconds path_timeout{10000};
  friend bool operator==(const Supply&, const Supply&);
};

/// A PART.toml.
struct Part {
  std::string path;       ///< Of the PART.toml.
  std::string text;       ///< Its content, as it was read.
  std::string mesh_path;  ///< Resolved against the PART.toml's folder.
  double mesh_unit_mm = 1;
  vision::PartOptions options;
  std::vector<vision::Grasp> grasps;
  std::optional<vision::Gripper> gripper;  ///< Nothing: only the tcp itself is kept clear of the walls.
};

/// One [[part]] entry of the cell file.
struct Recipe {
  std::uint16_t id = 0;
  Part part;
  std::string knowledge_base;          ///< Path, resolved against the cell file's folder.
  double score_min = 0.5;              ///< A detection below is not offered.
  std::optional<double> tilt_max_rad;  ///< Overrides the cell's.
};

struct Detection {
  int threads = 2;
  std::chrono::milliseconds deadline{3000};
  vision::Search search = vision::Search::Exhaustive;
};

/// How far one scan goes.
struct Picks {
  int per_scan = 1;
  std::chrono::milliseconds scan_valid{60000};
  double margin_mm = 10;
  int failed_scans = 10;
};

enum class ScannerModel { Lms400, Lps36, Lps36Hi };
enum class Carrier { Pivot, Robot };

/// A file of each cycle (docs/records.md).
struct Records {
  std::string dir;           ///< Empty: none.
  double size_max_mb = 500;  ///< Of all of them, in 10^6 bytes; the oldest go.
};

/// One finding, in the form file:line:col: message, the line, a caret, the remedy.
struct Diagnostic {
  std::string file;
  int line = 0;
  int column = 0;
  int length = 1;       ///< Caret and tildes.
  std::string message;  ///< What is wrong; what to do.
  std::string source;   ///< The line itself.
};
/// Three lines without a final line end; one where there is no line to show.
std::string to_string(const Diagnostic& diagnostic);

struct Config {
  std::string path;
  std::string text;  ///< Its content, as it was read.
  std::string name;
  std::string plc_listen;  ///< "host:port"; plc.address in the role of a client.
  plc::Options plc;
  std::string pivot_can;                    ///< "can0" or "cannelloni://HOST:PORT".
  std::uint16_t pivot_can_listen_port = 0;  ///< Local UDP port for cannelloni, 0: any.
  drivers::pivot::Options pivot;
  Duration pivot_latency{0};                 ///< Added to the time of each position sample.
  std::string scanner_address;               ///< "host:port".
  std::uint16_t scanner_listen_port = 5634;  ///< Own UDP port for an LPS 36, 0: any.
  ScannerModel scanner_model = ScannerModel::Lms400;
  drivers::lms400::Options lms400;  ///< Its profile_timeout is that of any model.
  drivers::lps36::Options lps36;
  std::optional<int> manual_exposure_us;
  drivers::scanner::Options scanner_options() const;  ///< Of the model that is configured.
  Duration scanner_latency{0};                        ///< Measured this much before the smoothed receive time.
  Carrier carrier = Carrier::Pivot;
  vision::ScannerMount mount;                                 ///< On the pivot.
  Transform<frame::Flange, frame::Scanner> T_flange_scanner;  ///< On the robot.
  std::string robot_listen;
  std::vector<std::string> robot_allow;
  drivers::robot::Options robot;
  std::string pose_address;  ///< "host:port" of RTDE.
  std::string pose_listen;   ///< "host:port" for makes that send lines.
  Duration pose_latency{0};  ///< Measured this much before the time stamp.
  Transform<frame::Flange, frame::Tcp> T_flange_tcp;
  drivers::robot::PoseSource::Options pose_options() const;
  std::vector<Supply> supplies;
  std::vector<Recipe> recipes;
  vision::ReachLimits reach;
  Detection detection;
  Picks picks;
  std::string picture_dir;  ///< A PNG per cycle goes here; empty: none.
  Records record;
  std::string state_dir;  ///< boot_count lives here.

  /// Where the PLC is, as `plc.role` says: where it connects to, or where it is asked.
  const std::string& plc_line() const { return plc.role == plc::LineRole::Client ? plc.address : plc_listen; }
  /// Held by a daemon in the role of a client (base/lock_file.hpp).
  std::string lock_path() const { return state_dir.empty() ? "" : state_dir + "/lock"; }

  /// Where the values stand that the file gives, without a message, by name: "cell.state_dir",
  /// "part[0].knowledge_base".
  std::map<std::string, Diagnostic, std::less<>> stands_at;
  /// A finding about one of them; about the file as a whole where it does not stand there.
  Diagnostic finding(const std::string& key, std::string message) const;
};

/// Training needs a part's mesh; a cell that has been trained works without.
enum class MeshFile { Needed, OfNoMatter };

/// Validates everything and returns all findings at once. Part files are read too; knowledge bases are not opened.
Expected<Config, std::vector<Diagnostic>> load(const std::string& path, MeshFile mesh = MeshFile::Needed);
/// The same for one PART.toml.
Expected<Part, std::vector<Diagnostic>> load_part(const std::string& path);
/// The same from text in memory. `path` names it in findings, and paths in it are relative to that one's folder.
Expected<Config, std::vector<Diagnostic>> load_text(const std::string& path, std::string_view text);
Expected<Part, std::vector<Diagnostic>> load_part_text(const std::string& path, std::string_view text);

/// Text of a file as it once was.
struct FileText {
  std::string path, text;
};
/// A cell file with part files as they once were: what `parts` lacks cannot be opened, and meshes need not be there.
Expected<Config, std::vector<Diagnostic>> load_texts(const FileText& cell, std::span<const FileText> parts);

/// Keys whose change takes effect only with a restart, by name ("plc.listen"), of those that differ between two files.
std::vector<std::string> needs_restart(const Config& running, const Config& edited);
}  // namespace binpick::config
