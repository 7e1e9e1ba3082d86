#include <algorithm>
#include <gtest/gtest.h>
#include <set>

#include "tests/support/cell_file.hpp"
#include "tests/support/emulated_cell.hpp"
#include "tests/support/scenes.hpp"

/// One scan is good for several picks, and failed ones are remembered.
namespace binpick::support {
namespace {
using namespace std::chrono_literals;

struct Picks : testing::Test {
  std::shared_ptr<const daemon::CellData> data = [] {
    CellFile file = coarse_cell();
    file.picks_per_scan = 4;
    return test_folder().load(file);
  }();
  EmulatedCell cell{data, scene_of("track_link", 4, 11), 11};

  void SetUp() override {
    ASSERT_TRUE(cell.run_until_ready());
    cell.robot.on_grasp = [this](const drivers::robot::Pick& pick) { return take_nearest(cell.world, *data, pick); };
  }
  /// The object that the pick is for, or 0.
  int object_of(const emulators::PlcResult& result) const {
    const auto& supply = data->config.supplies[0];
    int nearest = 0;
    double least = 120;
    for (const auto& object : cell.world.objects())
      if (const double apart = (supply.T_base_supply.inverse() * result.T_base_grasp.iso.translation() -
                                object.T_supply_object.iso.translation())
                                   .norm();
          apart < least)
        least = apart, nearest = object.id;
    return nearest;
  }
  /// The retreat pose belongs to the grasp that was sent, be it the best one of an object (0) or the other one (1).
  int expect_own_retreat(const drivers::robot::Pick& pick) const {
    const Eigen::Isometry3d T_supply_base = data->config.supplies[0].T_base_supply.iso.inverse();
    const auto at = [&](const auto& T_base_tcp, const auto& T_supply_tcp) {
      return (T_supply_base * T_base_tcp.iso.translation() - T_supply_tcp.iso.translation()).norm() < 0.01;
    };
    for (const auto& one : cell.results().back().choice.reachable) {
      if (at(pick.T_base_grasp, one.T_supply_grasp)) {
        EXPECT_TRUE(at(pick.T_base_retreat, one.T_supply_retreat));
        return 0;
      }
      if (one.other && at(pick.T_base_grasp, one.other->T_supply_grasp)) {
        EXPECT_TRUE(at(pick.T_base_retreat, one.other->T_supply_retreat));
        return 1;
      }
    }
    ADD_FAILURE() << "a grasp that nobody chose";
    return 0;
  }
  bool robot_is_back() {
    return cell.run_until([&] { return cell.robot.clear_of_view() && cell.plc.ready(); });
  }
};
}  // namespace

TEST_F(Picks, TheNextOneComesAtOnceFromTheSameScan) {
  std::set<int> objects;
  double sweeps = 0;
  for (int pick = 0; pick < 4; ++pick) {
    const auto before = cell.sweeps();
    const TimePoint asked = cell.now();
    const auto result = cell.pick();
    ASSERT_TRUE(result && result->code == plc::ResultCode::PickFound);
    if (cell.sweeps() == before) {
      EXPECT_LT(in_ms(cell.now() - asked), 300) << "some polls of the PLC, no sweep";
    }
    EXPECT_TRUE(objects.insert(object_of(*result)).second) << "no object is offered twice";
    ASSERT_TRUE(cell.run_until([&] { return cell.robot.picks_done() == static_cast<std::uint64_t>(pick + 1); }));
    ASSERT_TRUE(robot_is_back());
    sweeps = static_cast<double>(cell.sweeps());
  }
  EXPECT_FALSE(objects.contains(0)) << "each is where an object lies";
  EXPECT_LT(sweeps, 4);
}

TEST_F(Picks, AChangedSupplyIsScannedAnew) {
  ASSERT_TRUE(cell.pick());
  ASSERT_TRUE(cell.run_until([&] { return cell.robot.picks_done() == 1; }));
  ASSERT_TRUE(robot_is_back());
  cell.plc.set_new_scan(true);
  cell.world = empty_scene();
  const auto result = cell.pick();
  ASSERT_TRUE(result);
  EXPECT_EQ(result->code, plc::ResultCode::SupplyEmpty);
  EXPECT_EQ(cell.sweeps(), 2);
}

TEST_F(Picks, AnObjectThatCannotBeGrippedDoesNotHoldUpTheOthers) {
  const auto first = cell.pick();
  ASSERT_TRUE(first);
  // Whoever tries to take this one gets nothing.
  const int stubborn = object_of(*first);
  ASSERT_NE(stubborn, 0);
  const auto take = cell.robot.on_grasp;
  std::vector<int> tried;
  int by_others = 0;
  cell.robot.on_grasp = [&](const drivers::robot::Pick& pick) {
    by_others += expect_own_retreat(pick);
    emulators::PlcResult as_result;
    as_result.T_base_grasp = pick.T_base_grasp;
    tried.push_back(object_of(as_result));
    return tried.back() != stubborn && take(pick);
  };
  std::optional<emulators::PlcResult> result = first;
  for (int requests = 0; requests < 12 && result->code == plc::ResultCode::PickFound; ++requests) {
    ASSERT_TRUE(cell.run_until([&] { return tried.size() == static_cast<std::size_t>(requests + 1); }));
    ASSERT_TRUE(robot_is_back());
    ASSERT_TRUE((result = cell.pick()));
  }
  EXPECT_EQ(result->code, plc::ResultCode::NotReachable);
  EXPECT_EQ(cell.world.objects().size(), 1) << "all others were taken";
  EXPECT_EQ(std::ranges::count(tried, stubborn), 2) << "and it was tried once more";
  EXPECT_EQ(by_others, 1) << "by another grasp";
}
}  // namespace binpick::support
