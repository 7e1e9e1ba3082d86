#include <cstdio>
#include <gtest/gtest.h>
#include <numbers>

#include "tests/support/cell_file.hpp"
#include "tests/support/emulated_cell.hpp"
#include "tests/support/scenes.hpp"

/// The forklift leaves the supply beside its place, and the robot takes the objects where they are.
namespace binpick::support {
namespace {
Eigen::Isometry3d stands(double x_mm, double y_mm, double turn_deg) {
  return Eigen::Translation3d{x_mm, y_mm, 0} *
         Eigen::AngleAxisd{turn_deg * std::numbers::pi / 180, Eigen::Vector3d::UnitZ()};
}

struct Located : testing::TestWithParam<const char*> {
  std::shared_ptr<const daemon::CellData> load(bool locate) const {
    CellFile file;
    file.scanner = GetParam();
    if (file.scanner == "lps36") file.parts = {"contact_bridge"};
    file.locate = locate;
    return test_folder().load(file);
  }
  static emulators::World scene() {
    return std::string{GetParam()} == "lps36" ? scene_of("contact_bridge", 8, 5, kSmallBox_mm)
                                              : scene_of("track_link", 8, 5);
  }
};
}  // namespace

TEST_P(Located, PosesAreRightWhereverTheSupplyStands) {
  const auto data = load(true);
  EmulatedCell cell{data, scene(), 7};
  ASSERT_TRUE(cell.run_until_ready());
  for (const auto& place : {stands(0, 0, 0), stands(65, -70, 8), stands(-75, 40, -9)}) {
    cell.T_said_stands.iso = place;
    const auto result = cell.pick();
    ASSERT_TRUE(result && result->code == plc::ResultCode::PickFound);
    const auto& seen = cell.results().back();
    const Eigen::Isometry3d error = place.inverse() * seen.place.T_said_found;
    EXPECT_LT(error.translation().norm(), 4);
    EXPECT_LT(Eigen::AngleAxisd{error.linear()}.angle(), 0.006);
    // What the robot is sent, seen from the supply as it stands.
    const auto& chosen = seen.choice.reachable.front();
    const Eigen::Isometry3d T_base_stands = data->config.supplies[0].T_base_supply.iso * place;
    const Eigen::Isometry3d T_supply_object = T_base_stands.inverse() * result->T_base_grasp.iso *
                                              chosen.T_supply_grasp.iso.inverse() *
                                              seen.report.detections[chosen.detection].T_supply_object.iso;
    const auto off = error_to_nearest(cell.world, data->knowledge_bases[0], {T_supply_object});
    const double limit_mm = std::string{GetParam()} == "lps36" ? 1.5 : 5;
    EXPECT_LT(off.centroid_mm, limit_mm);
    std::printf("%s: place off by %.1f mm and %.2f deg, pose by %.2f mm\n", GetParam(), error.translation().norm(),
                Eigen::AngleAxisd{error.linear()}.angle() * 180 / std::numbers::pi, off.centroid_mm);
    ASSERT_TRUE(cell.run_until([&] { return cell.robot.clear_of_view() && cell.plc.ready(); }));
  }
}

TEST_P(Located, OneThatStandsTooFarOffIsRefusedWithItsReason) {
  EmulatedCell cell{load(true), scene(), 7};
  ASSERT_TRUE(cell.run_until_ready());
  cell.T_said_stands.iso = stands(0, 95, 0);
  cell.plc.raise_request(1, 1);
  ASSERT_TRUE(cell.run_until([&] { return cell.plc.fault(); }));
  EXPECT_EQ(static_cast<plc::Alarm>(cell.plc.first_alarm()), plc::Alarm::SupplyNotFound);
  const std::string reason = cell.results().back().not_located;
  // At an LPS 36 one wall is out of sight then.
  EXPECT_NE(reason.find(std::string{GetParam()} == "lms400" ? "95 mm in y" : "wall"), std::string::npos) << reason;
  // The forklift comes back.
  cell.T_said_stands.iso = stands(0, 20, 0);
  cell.plc.raise_reset();
  ASSERT_TRUE(cell.run_until_ready());
  const auto result = cell.pick();
  ASSERT_TRUE(result);
  EXPECT_EQ(result->code, plc::ResultCode::PickFound);
}

INSTANTIATE_TEST_SUITE_P(Scanners, Located, testing::Values("lms400", "lps36"),
                         [](const auto& one) { return std::string{one.param}; });
}  // namespace binpick::support
