#include "vision/calibration/pose_list.hpp"

#include <gtest/gtest.h>
#include <numbers>

namespace binpick::vision::calibration {
namespace {
std::string trouble_of(std::string_view text) {
  const auto list = parse_pose_list(text, "poses.csv");
  return list ? "none" : list.error();
}
}  // namespace

TEST(PoseList, EachMakesWayToWriteAPose) {
  for (const char* text : {"scan,x_mm,y_mm,z_mm,rx_rad,ry_rad,rz_rad\na.record,1,2,3,0,0,1.5707963267948966\n",
                           "# of cell 4\nscan; x_mm; y_mm; z_mm; w_deg; p_deg; r_deg\n\na.record; 1; 2; 3; 0; 0; 90\n",
                           "o_deg,a_deg,t_deg,x_mm,y_mm,z_mm,scan\r\n60,0,30,1,2,3,a.record\r\n"}) {
    const auto list = parse_pose_list(text, "poses.csv");
    ASSERT_TRUE(list.has_value()) << list.error();
    EXPECT_FALSE(list->places_only);
    ASSERT_EQ(list->rows.size(), 1U);
    EXPECT_EQ(list->rows[0].scan, "a.record");
    EXPECT_EQ(list->rows[0].T_base_holder.translation(), Eigen::Vector3d(1, 2, 3));
    EXPECT_LT((list->rows[0].T_base_holder.linear() * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm(),
              1e-12);
  }
}

TEST(PoseList, PlacesAloneAreTheSpheresCentre) {
  const auto list = parse_pose_list("scan,x_mm,y_mm,z_mm\na,1,2,3\nb,-4.5,5e1,+6", "poses.csv");
  ASSERT_TRUE(list.has_value()) << list.error();
  EXPECT_TRUE(list->places_only);
  ASSERT_EQ(list->rows.size(), 2U);
  EXPECT_EQ(list->rows[1].T_base_holder.translation(), Eigen::Vector3d(-4.5, 50, 6));
}

TEST(PoseList, WhatIsWrongIsNamedWithItsLine) {
  EXPECT_EQ(trouble_of(""), "poses.csv: no poses; the first line names the columns, each other is a scan");
  EXPECT_EQ(trouble_of("x_mm,y_mm,z_mm\n"), "poses.csv:1: no column \"scan\"; name them in the first line");
  EXPECT_EQ(trouble_of("scan,x,y,z\n"), "poses.csv:1: no columns \"x_mm, y_mm, z_mm\"; name them in the first line");
  EXPECT_TRUE(
      trouble_of("scan,x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg\n").starts_with("poses.csv:1: the columns are not "));
  const std::string names = "scan,x_mm,y_mm,z_mm\n";
  EXPECT_EQ(trouble_of(names + "a,1,5,2,3\n"),
            "poses.csv:2: 5 columns, the first line names 4; a decimal comma would be one column too many");
  EXPECT_EQ(trouble_of(names + "a,1,2,none\n"), "poses.csv:2: x_mm, y_mm, z_mm are not three numbers of millimetres");
  EXPECT_EQ(trouble_of(names + "a,1,2,nan\n"), "poses.csv:2: x_mm, y_mm, z_mm are not three numbers of millimetres");
  EXPECT_EQ(trouble_of(names + ",1,2,3\n"),
            "poses.csv:2: no file in the column \"scan\"; name the scan that was taken at this pose");
  EXPECT_EQ(trouble_of(names + "a,1,2,3\na,4,5,6\n"), "poses.csv:3: \"a\" stands twice; each scan has one pose");
}
}  // namespace binpick::vision::calibration
