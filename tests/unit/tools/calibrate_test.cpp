#include <CLI/CLI.hpp>
#include <cstdio>
#include <gtest/gtest.h>

#include "base/rotation.hpp"
#include "daemon/cycle/record_codec.hpp"
#include "tests/support/sphere_scans.hpp"
#include "tests/unit/config/cell_files.hpp"
#include "tools/commands.hpp"

namespace binpick::tools {
namespace {
using Eigen::Isometry3d;
using support::SphereCarrier;
using vision::calibration::Mount;

struct Answer {
  int exit_status = 0;
  std::string out, err;
};
Answer calibrate(std::vector<std::string> words) {
  CLI::App app;
  Answer answer;
  add_calibrate(app, answer.exit_status);
  words.insert(words.begin(), "calibrate");
  std::ranges::reverse(words);  // CLI11 takes them from the back
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  app.parse(words);
  answer.out = testing::internal::GetCapturedStdout();
  answer.err = testing::internal::GetCapturedStderr();
  return answer;
}

std::string in_toml(const Isometry3d& T) {
  const Eigen::Vector3d xyz = T.translation(), rpy = to_wpr_deg(T.linear());
  char text[200];
  std::snprintf(text, sizeof text, "{ xyz_mm = [%.9g, %.9g, %.9g], rpy_deg = [%.9g, %.9g, %.9g] }", xyz.x(), xyz.y(),
                xyz.z(), rpy.x(), rpy.y(), rpy.z());
  return text;
}

/// The key's line of a text, without its line end.
std::string line_of(const std::string& text, const std::string& key) {
  const std::size_t at = text.find("\n" + key + " = ");
  return at == std::string::npos ? "" : text.substr(at + 1, text.find('\n', at + 1) - at - 1);
}

/// A cell whose scanner stands as the emulated scans' present mount, and the records of these scans.
struct Cell {
  explicit Cell(SphereCarrier carrier) : emulated{support::scan_spheres({.carrier = carrier, .scans = 8})} {
    folder.edit("T_base_supply = { xyz_mm = [1200, 0, 0]", "T_base_supply = { xyz_mm = [1200, 100, 0]");
    const Mount& mount = emulated.question.present.mount;
    if (mount.on_pivot) {
      put(folder.cell, "T_base_pivot", in_toml(mount.T_base_root));
      put(folder.cell, "T_pivot_scanner", in_toml(mount.T_carrier_scanner));
    }
    EXPECT_EQ(folder.findings(), "");
    for (std::size_t k = 0; k < emulated.question.scans.size(); ++k) {
      const auto& scan = emulated.question.scans[k];
      daemon::Record record;
      record.scan.emplace();
      for (const auto& profile : scan.profiles) {
        drivers::sweep::RegisteredProfile registered;
        registered.profile.x_mm = profile.x_mm;
        registered.profile.z_mm = profile.z_mm;
        const Eigen::Matrix3d& R = profile.T_root_carrier.linear();
        if (mount.on_pivot)
          registered.carrier = Angle::rad(std::atan2(R(1, 0), R(0, 0)));
        else
          registered.carrier = Transform<frame::Base, frame::Flange>{profile.T_root_carrier};
        record.scan->profiles.push_back(std::move(registered));
      }
      const Bytes bytes = daemon::encode(record);
      names.push_back("scan" + std::to_string(k + 1) + ".record");
      folder.write(names.back(), {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
      const Eigen::Vector3d xyz = scan.T_base_holder.translation(),
                            turn = to_rotation_vector(scan.T_base_holder.linear());
      char row[200];
      std::snprintf(row, sizeof row, "%s,%.6f,%.6f,%.6f,%.9f,%.9f,%.9f\n", names.back().c_str(), xyz.x(), xyz.y(),
                    xyz.z(), turn.x(), turn.y(), turn.z());
      poses += row;
    }
    folder.write("poses.csv", poses);
  }
  static void put(std::string& text, const std::string& key, const std::string& value) {
    const std::string line = line_of(text, key);
    ASSERT_FALSE(line.empty()) << key;
    text.replace(text.find(line), line.size(), key + " = " + value);
  }

  config::CellFolder folder;
  support::EmulatedScans emulated;
  std::vector<std::string> names;
  std::string poses = "scan,x_mm,y_mm,z_mm,rx_rad,ry_rad,rz_rad\n";
};
}  // namespace

TEST(Calibrate, TheLinesOfAPivotsScannerGoIntoTheCellFileAsTheyAre) {
  Cell cell{SphereCarrier::Pivot};
  const std::string before = cell.folder.cell;
  const Answer answer = calibrate({cell.folder.path("cell.toml"), "--sphere-mm", "200", "--poses",
                                   cell.folder.path("poses.csv"), "--tolerance-mm", "9"});
  ASSERT_EQ(answer.exit_status, 0) << answer.err;
  EXPECT_NE(answer.out.find("Hold-out error: the new mount displaces points of the supply by "), std::string::npos)
      << answer.out;
  EXPECT_NE(answer.out.find("--tolerance-mm: it suffices: half of 9.00 mm is for calibration\n"), std::string::npos)
      << answer.out;
  EXPECT_EQ(config::read_text(cell.folder.path("cell.toml")), before) << "it writes no file";
  for (const char* key : {"T_base_pivot", "T_pivot_scanner"}) {
    const std::string line = line_of(answer.out, key);
    ASSERT_FALSE(line.empty()) << answer.out;
    Cell::put(cell.folder.cell, key, line.substr(line.find('{')));
  }
  const auto pasted = cell.folder.load();
  ASSERT_TRUE(pasted.has_value()) << cell.folder.findings();
  vision::calibration::Answer calibrated;
  calibrated.mount = vision::calibration::on_pivot(pasted->mount);
  EXPECT_LT(support::true_error_mm(cell.emulated, calibrated), 2);
}

TEST(Calibrate, WhatDoesNotFitTogetherIsNamed) {
  const Cell cell{SphereCarrier::Robot};
  const std::string path = cell.folder.path("cell.toml");
  const auto error_of = [&](const std::vector<std::string>& words) {
    const Answer answer = calibrate(words);
    EXPECT_EQ(answer.exit_status, 2);
    EXPECT_EQ(std::ranges::count(answer.err, '\n'), 1) << answer.err;
    return answer.err;
  };
  const std::vector<std::string> common{path, "--sphere-mm", "200", "--tolerance-mm", "9"};
  EXPECT_EQ(error_of(common),
            "binpick: the pivot carries the scanner: name the scans in --poses POSES.csv, with where "
            "the robot held the sphere in each; see docs/calibration.md\n");
  auto with_poses = common;
  with_poses.insert(with_poses.end(), {"--poses", cell.folder.path("poses.csv")});
  EXPECT_EQ(error_of(with_poses), "binpick: " + cell.folder.path("scan1.record") +
                                      ": the robot carried the scanner in this scan, the cell file says the pivot\n");
  cell.folder.write("scan1.record", "no record");
  EXPECT_NE(error_of(with_poses).find("scan1.record"), std::string::npos);
}
}  // namespace binpick::tools
