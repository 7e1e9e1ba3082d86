#include "vision/draw.hpp"

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "tests/unit/detect/scenes.hpp"

namespace binpick::vision {
namespace {
std::string png_path() { return (std::filesystem::path{testing::TempDir()} / "binpick_draw_test.png").string(); }

TEST(Draw, WritesAPngWithEverythingOnIt) {
  const DepthImage image =
      scenes::image_of(scenes::bracket_base().mesh(), {scenes::pose(-100, 0, 0, 0), scenes::pose(60, 20, 72, 1.5)}, 2);
  DetectionReport report = detect(image, scenes::kSupply, scenes::bracket_base(), scenes::options());
  ASSERT_FALSE(report.detections.empty());
  report.rejected.push_back({report.detections[0].T_supply_object, 0.1, {}, "edges missing"});
  const GraspChoice choice =
      choose_grasps(report, scenes::bracket_base().symmetry(), {Grasp{}}, scenes::kSupply, {4.0});
  ASSERT_FALSE(choice.reachable.empty());
  std::filesystem::remove(png_path());
  const auto drawn = draw_report(png_path(), image, scenes::bracket_base(), report, &choice.reachable.front());
  ASSERT_TRUE(drawn.has_value()) << drawn.error();
  std::ifstream in{png_path(), std::ios::binary};
  std::string head(24, '\0');
  in.read(head.data(), 24);
  EXPECT_EQ(head.substr(1, 3), "PNG");
  const auto width = static_cast<unsigned char>(head[18]) * 256 + static_cast<unsigned char>(head[19]);
  EXPECT_GE(width, 1000);
  std::filesystem::remove(png_path());
}

TEST(Draw, AnEmptyReportAndAnEmptyPicture) {
  DepthImage blank;
  EXPECT_FALSE(draw_report(png_path(), blank, scenes::bracket_base(), {}).has_value());
  blank.z_mm.setConstant(5, 5, std::numeric_limits<float>::quiet_NaN());
  EXPECT_TRUE(draw_report(png_path(), blank, scenes::bracket_base(), {}).has_value());
  std::filesystem::remove(png_path());
}

TEST(Draw, WallsLeaveTheColoursToTheObjects) {
  constexpr int kSide = 200;
  DepthImage image;
  image.pixel_mm = 2;
  image.z_mm.setConstant(kSide, kSide, 400);                                     // walls, 3 pixels thick
  image.z_mm.block(3, 3, kSide - 6, kSide - 6).setConstant(0);                   // floor
  image.z_mm.block(kSide / 4, kSide / 4, kSide / 2, kSide / 2).setConstant(60);  // an object
  ASSERT_TRUE(draw_report(png_path(), image, scenes::bracket_base(), {}).has_value());
  const cv::Mat picture = cv::imread(png_path(), cv::IMREAD_GRAYSCALE);
  ASSERT_FALSE(picture.empty());
  const int scale = picture.cols / kSide;
  const auto gray = [&](int row, int col) { return int{picture.at<unsigned char>(row * scale, col * scale)}; };
  EXPECT_GT(gray(kSide / 2, kSide / 2), gray(kSide / 8, kSide / 2) + 100);
  EXPECT_GE(gray(0, kSide / 2), gray(kSide / 2, kSide / 2) - 5);  // higher is not darker
  std::filesystem::remove(png_path());
}

TEST(Draw, TheGripperAtTheChosenGraspAndNoWords) {
  const DepthImage image = scenes::image_of(scenes::bracket_base().mesh(), {scenes::pose(0, 0, 0, 0)}, 2);
  const DetectionReport report = detect(image, scenes::kSupply, scenes::bracket_base(), scenes::options());
  const GraspChoice choice =
      choose_grasps(report, scenes::bracket_base().symmetry(), {Grasp{}}, scenes::kSupply, {4.0});
  ASSERT_FALSE(choice.reachable.empty());
  Gripper gripper;
  gripper.jaws = Gripper::Jaws{60, {20, 40, 50}, 0};
  const Grasp grasp;
  const DrawStyle style{.width_min_px = 300, .pen = 1, .words = false, .noise = false, .height_max_mm = 100};
  const auto pink_px = [&](const Gripper* shown) {
    EXPECT_TRUE(
        draw_report(png_path(), image, scenes::bracket_base(), report, &choice.reachable.front(), shown, &grasp, style)
            .has_value());
    const cv::Mat picture = cv::imread(png_path());
    const auto scale = picture.cols / static_cast<int>(image.z_mm.cols());
    EXPECT_EQ(picture.rows, image.z_mm.rows() * scale) << "no legend below";
    cv::Mat pink;
    cv::inRange(picture, cv::Scalar{235, 105, 250}, cv::Scalar{245, 115, 255}, pink);
    return cv::countNonZero(pink) / (scale * scale);
  };
  const double jaws_px = 2 * 20 * 40 / (image.pixel_mm * image.pixel_mm);  // from above
  EXPECT_NEAR(pink_px(&gripper) - pink_px(nullptr), jaws_px, 0.2 * jaws_px);
  std::filesystem::remove(png_path());
}

TEST(Draw, APlaceThatCannotBeWrittenIsAnError) {
  const DepthImage image = scenes::image_of(scenes::bracket_base().mesh(), {}, 2);
  for (const char* path : {"/no/such/folder/x.png", "/tmp/picture.nosuchformat"}) {
    const auto drawn = draw_report(path, image, scenes::bracket_base(), {});
    ASSERT_FALSE(drawn.has_value());
    EXPECT_NE(drawn.error().find(path), std::string::npos);
  }
}
}  // namespace
}  // namespace binpick::vision
