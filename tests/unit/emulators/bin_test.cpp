#include "tests/emulators/program/bin.hpp"

#include <filesystem>
#include <gtest/gtest.h>
#include <string>
#include <unistd.h>

#include "base/rotation.hpp"
#include "tests/emulators/program/pick_line.hpp"
#include "tests/emulators/world/example_parts.hpp"

namespace binpick::emulators {
namespace {
/// A cell with one supply that stands turned and shifted, and one example part.
class EmulatedBin : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::filesystem::temp_directory_path() / ("binpick-bin-test-" + std::to_string(::getpid()));
    config_ = new config::Config;
    config::Supply supply;
    supply.id = 1;
    supply.size_mm = {1000, 800, 500};
    supply.T_base_supply.iso.translation() = Eigen::Vector3d{1200, -300, 50};
    supply.T_base_supply.iso.linear() = from_wpr_deg({0, 0, 30});
    config_->supplies.push_back(supply);
    const auto part = config::load_part(write_example_part("steering_wheel", folder_.string()));
    ASSERT_TRUE(part);
    config::Recipe recipe;
    recipe.id = 1;
    recipe.part = *part;
    recipe.knowledge_base = (folder_ / "none.kb").string();
    config_->recipes.push_back(recipe);
  }
  static void TearDownTestSuite() {
    delete config_;
    std::filesystem::remove_all(folder_);
  }

  /// The tcp at the first grasp of an object, moved by a transform in the object's own frame.
  Transform<frame::Base, frame::Tcp> grasp_of(const World::Object& object, const Eigen::Isometry3d& moved) const {
    Transform<frame::Object, frame::Object> T_object_moved{moved};
    return config_->supplies[0].T_base_supply * object.T_supply_object * T_object_moved *
           config_->recipes[0].part.grasps[0].T_object_tcp;
  }
  static Eigen::Isometry3d shift(double x_mm) { return Eigen::Isometry3d{Eigen::Translation3d{x_mm, 0, 0}}; }
  static Eigen::Isometry3d turn(double deg) {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = from_wpr_deg({0, 0, deg});
    return T;
  }

  static inline std::filesystem::path folder_;
  static inline config::Config* config_ = nullptr;
};
}  // namespace

TEST_F(EmulatedBin, TellsHowFarAPickIsOff) {
  const Bin bin{*config_, {.objects = 4, .seed = 3}};
  const World::Object& object = bin.world().objects().front();
  const auto exact = bin.nearest(grasp_of(object, Eigen::Isometry3d::Identity()));
  ASSERT_TRUE(exact);
  EXPECT_EQ(exact->object, object.id);
  EXPECT_NEAR(exact->error.centroid_mm, 0, 1e-6);
  EXPECT_NEAR(exact->error.angle_rad, 0, 1e-6);
  EXPECT_NEAR(bin.nearest(grasp_of(object, shift(4)))->error.centroid_mm, 4, 0.01);
  // Three equal spokes: a third of a turn is the same pose, 125 degrees are 5 off.
  EXPECT_NEAR(bin.nearest(grasp_of(object, turn(120)))->error.angle_rad, 0, 1e-3);
  EXPECT_NEAR(Angle::rad(bin.nearest(grasp_of(object, turn(125)))->error.angle_rad).in_deg(), 5, 0.1);
}

TEST_F(EmulatedBin, WithoutAGripperWhatIsNearIsTaken) {
  config::Config config = *config_;
  config.recipes[0].part.gripper.reset();
  Bin bin{config, {.objects = 3, .seed = 3}};
  const World::Object object = bin.world().objects().front();
  const auto take = [&](const Eigen::Isometry3d& moved) {
    const auto T = grasp_of(object, moved);
    return bin.take(T, T, T).kind;
  };
  EXPECT_EQ(take(shift(400)), GripResult::Kind::Missed);
  EXPECT_EQ(take(turn(15)), GripResult::Kind::Missed);
  EXPECT_EQ(bin.objects_left(), 3U);
  EXPECT_EQ(take(shift(10)), GripResult::Kind::Taken);
  EXPECT_EQ(bin.objects_left(), 2U);
  EXPECT_EQ(bin.world().find(object.id), nullptr);
  EXPECT_EQ(take(Eigen::Isometry3d::Identity()), GripResult::Kind::Missed) << "it is gone";
}

TEST_F(EmulatedBin, TheGripperTakesWhatItsJawsEnclose) {
  Bin bin{*config_, {.objects = 1, .seed = 3}};
  const World::Object object = bin.world().objects().front();
  const Transform<frame::Base, frame::Object> T_base_object =
      config_->supplies[0].T_base_supply * object.T_supply_object;
  const auto& grasps = config_->recipes[0].part.grasps;
  const auto from_above = [&](const vision::Grasp& grasp) {
    return (T_base_object * grasp.T_object_tcp).iso.linear()(2, 2) < -0.9;
  };
  const auto grasp = std::ranges::find_if(grasps, from_above);
  ASSERT_NE(grasp, grasps.end());
  const auto take = [&](double across_mm, const Eigen::Vector3d& way_out_mm = {0, 0, 100}) {
    const Transform<frame::Base, frame::Tcp> T{(T_base_object * grasp->T_object_tcp).iso *
                                               Eigen::Translation3d{across_mm, 0, 0}};
    return bin
        .take({T.iso * Eigen::Translation3d{0, 0, -grasp->approach_mm}}, T, {Eigen::Translation3d{way_out_mm} * T.iso})
        .kind;
  };
  EXPECT_EQ(take(20), GripResult::Kind::Collision) << grasp->name << ": a jaw on the rim";
  EXPECT_EQ(take(70), GripResult::Kind::Missed) << grasp->name << ": the rim is beside both jaws";
  EXPECT_EQ(take(3, {2000, 0, 100}), GripResult::Kind::Collision) << grasp->name << ": out through the wall";
  EXPECT_EQ(bin.objects_left(), 1U) << "it stays where it is";
  EXPECT_EQ(take(3), GripResult::Kind::Taken) << grasp->name;
  EXPECT_EQ(bin.objects_left(), 0U);
}

TEST_F(EmulatedBin, IsEmptiedFromAboveAndFilledAnew) {
  Bin bin{*config_, {.objects = 5, .seed = 3}};
  EXPECT_GE(bin.overlapping(), 2U) << "five wheels of 370 mm hardly lie side by side in 1000 x 800";
  EXPECT_LE(bin.overlapping(), 5U);
  double last_top = 1e9;
  while (bin.objects_left() > 0) {
    double top = 0;
    for (const auto& object : bin.world().objects()) top = std::max(top, double{object.box.max().z()});
    EXPECT_LE(top, last_top);
    last_top = top;
    EXPECT_TRUE(bin.take_highest());
  }
  EXPECT_FALSE(bin.take_highest());
  EXPECT_EQ(bin.overlapping(), 0U);
  EXPECT_FALSE(bin.poll_refill());
  bin.start_refill();
  while (!bin.poll_refill()) continue;
  EXPECT_EQ(bin.objects_left(), 5U);
  EXPECT_EQ(bin.seed(), 4U);
}

TEST_F(EmulatedBin, WithoutWallsObjectsLieByThemselvesOnABelt) {
  config::Config config = *config_;
  config.supplies[0].size_mm = {1500, 1000, 0};
  Bin bin{config, {.objects = 4, .seed = 3}};
  EXPECT_TRUE(bin.is_belt());
  const std::size_t before = bin.objects_left();
  EXPECT_GE(before, 2U);
  EXPECT_LE(before, 4U);
  EXPECT_EQ(bin.overlapping(), 0U);
  const auto first = bin.world().objects().front().T_supply_object.iso.matrix();
  bin.start_refill();
  while (!bin.poll_refill()) continue;
  EXPECT_NE(bin.world().objects().front().T_supply_object.iso.matrix(), first) << "the belt has moved on";
  config.supplies[0].size_mm = {300, 300, 0};
  EXPECT_THROW((Bin{config, {.objects = 4, .seed = 3}}), std::runtime_error) << "a wheel is 370 mm wide";
}

TEST(PickLine, GivesTheFiguresAndTheVerdict) {
  PickSeen seen;
  PlcResult result;
  result.sequence = 3;
  result.figures = {1020, 367, 58310, 512, 143};
  result.T_base_grasp.iso.translation() = Eigen::Vector3d{1203.4, -102.1, 153.4};
  seen.result = result;
  drivers::robot::Pick read;
  read.pick_id = 7;
  read.T_base_grasp = result.T_base_grasp;
  seen.read = read;
  seen.nearest = Bin::Nearest{1, {1.26, Angle::deg(0.83).in_rad()}};
  seen.grip = GripResult{.kind = GripResult::Kind::Taken, .object = 1, .what = ""};
  seen.how = "done";
  EXPECT_TRUE(judge(seen, 5, 3).right);
  EXPECT_EQ(
      judge(seen, 5, 3).line,
      "sequence 3, sweep 1.02 s, 367 profiles, 58310 points, 512 hypotheses, detection 143 ms, error 1.3 mm 0.8 deg, "
      "robot read pick 7 at (1.2034 -0.1021 0.1534) m, taken, done");
  EXPECT_FALSE(judge(seen, 1, 3).right);
  EXPECT_FALSE(judge(seen, 5, 0.5).right);
  seen.how = "FAILED";
  EXPECT_FALSE(judge(seen, 5, 3).right);
  seen.how = "done";
  seen.grip->kind = GripResult::Kind::Missed;
  seen.grip->what = "nothing between the jaws";
  EXPECT_FALSE(judge(seen, 5, 3).right) << "the robot says that it holds what it does not";
  seen.how = "FAILED";
  EXPECT_TRUE(judge(seen, 5, 3).right) << "a right pose, at which the grip failed";
  EXPECT_FALSE(judge(seen, 5, 3).taken);
  EXPECT_NE(judge(seen, 5, 3).line.find("missed: nothing between the jaws"), std::string::npos);
  seen.grip->kind = GripResult::Kind::Taken;
  seen.how = "done";
  EXPECT_TRUE(judge(seen, 5, 3).taken);
  seen.read->T_base_grasp.iso.translation().x() += 0.2;
  EXPECT_FALSE(judge(seen, 5, 3).right) << "PLC and robot were told different things";
  seen.read->T_base_grasp = result.T_base_grasp;
  EXPECT_TRUE(judge(seen, 5, 3).right);
  seen.read->T_base_retreat.iso.translation().z() += 0.2;
  EXPECT_FALSE(judge(seen, 5, 3).right) << "different ways out";
  seen.read.reset();
  EXPECT_TRUE(judge(seen, 5, 3).right) << "a robot that is not played here is not judged";
  seen.nearest.reset();
  EXPECT_FALSE(judge(seen, 5, 3).right);
}
}  // namespace binpick::emulators
