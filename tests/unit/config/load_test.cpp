#include <cmath>
#include <gtest/gtest.h>

#include "tests/unit/config/cell_files.hpp"

namespace binpick::config {
namespace {
using namespace std::chrono_literals;

TEST(Load, ExampleCellIsGoodAndInInnerUnits) {
  const CellFolder folder;
  const auto loaded = folder.load();
  ASSERT_TRUE(loaded.has_value()) << folder.findings();
  const Config& c = *loaded;
  EXPECT_EQ(c.name, "demo");
  EXPECT_EQ(c.plc_listen, "0.0.0.0:502");
  EXPECT_EQ(c.plc.word_order, plc::WordOrder::HighWordFirst);
  EXPECT_EQ(c.plc.allow, std::vector<std::string>{"192.168.0.10"});
  EXPECT_EQ(c.plc.heartbeat_timeout, 3000ms);
  EXPECT_EQ(c.plc.part_ids, std::vector<std::uint16_t>{1});
  EXPECT_EQ(c.plc.supply_ids, std::vector<std::uint16_t>{1});
  EXPECT_EQ(c.pivot_can, "can0");
  EXPECT_EQ(c.pivot.module_id, 12);
  EXPECT_EQ(c.pivot.reference_timeout, 30s);
  EXPECT_EQ(c.lms400.frequency_hz, 360);
  EXPECT_NEAR(c.lms400.start.in_deg(), 70, 1e-12);
  EXPECT_EQ(c.robot_listen, "0.0.0.0:5002");
  EXPECT_NEAR(c.reach.tilt_max_rad, 40 * M_PI / 180, 1e-12);
  ASSERT_EQ(c.supplies.size(), 1U);
  EXPECT_EQ(c.supplies[0].size_mm, Eigen::Vector3d(1000, 800, 500));
  EXPECT_NEAR(c.supplies[0].sweep_speed_rad_s, 34 * M_PI / 180, 1e-12);
  ASSERT_EQ(c.recipes.size(), 1U);
  EXPECT_EQ(c.recipes[0].part.mesh_path, folder.path("track_link.stl"));
  EXPECT_EQ(c.recipes[0].part.options.name, "track_link");
  EXPECT_EQ(c.recipes[0].part.options.scanner, vision::ScannerClass::Lms400);
  EXPECT_FALSE(c.recipes[0].part.options.pixel_mm.has_value());
  EXPECT_EQ(c.recipes[0].knowledge_base, folder.path("track_link.kb"));
  EXPECT_FALSE(c.recipes[0].tilt_max_rad.has_value());
  ASSERT_EQ(c.recipes[0].part.grasps.size(), 1U);
  EXPECT_EQ(c.state_dir, "/var/lib/binpick");
  EXPECT_EQ(c.picture_dir, "");
}

TEST(Load, RotationsAreAboutFixedAxesXThenYThenZ) {
  CellFolder folder;
  folder.edit("T_base_pivot = { xyz_mm = [1200, 0, 1860], rpy_deg = [0, 90, 0] }",
              "T_base_pivot = { xyz_mm = [1201, 2, 1863], rpy_deg = [90, 0, 90] }");
  folder.edit("rpy_deg = [180, -90, 0] }", "rpy_deg = [90, -90, 0] }");  // so that it looks down again
  const auto loaded = folder.load();
  ASSERT_TRUE(loaded.has_value()) << folder.findings();
  // x is turned to y by the last turn; y to z by the first, which the last leaves alone; z to -y to x.
  Eigen::Matrix3d expected;
  expected << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  const auto& T = loaded->mount.T_base_pivot.iso;
  EXPECT_TRUE(T.linear().isApprox(expected, 1e-12)) << T.matrix();
  EXPECT_EQ(T.translation(), Eigen::Vector3d(1201, 2, 1863));
}

TEST(Load, ALeuzeScannerHasKeysOfItsOwn) {
  for (const bool hi : {false, true}) {
    CellFolder folder;
    make_leuze(folder, hi ? "lps36hi" : "lps36");
    folder.edit("profile_timeout_ms = 500",
                "profile_timeout_ms = 300\nexposure = \"manual\"\nmanual_exposure_us = 200");
    const auto loaded = folder.load();
    ASSERT_TRUE(loaded.has_value()) << folder.findings();
    const auto options = std::get<drivers::lps36::Options>(loaded->scanner_options());
    EXPECT_EQ(options.hi, hi);
    EXPECT_EQ(options.profile_timeout, 300ms);
    EXPECT_EQ(options.exposure, drivers::lps36::Exposure::Manual);
    EXPECT_EQ(options.manual_exposure, std::chrono::microseconds(200));
    EXPECT_EQ(loaded->scanner_listen_port, 5634);
  }
}

TEST(Load, TheRobotMayCarryTheScanner) {
  for (const char* dialect : {"ur", "fanuc"}) {
    CellFolder folder;
    put_on_robot(folder, dialect);
    const auto loaded = folder.load();
    ASSERT_TRUE(loaded.has_value()) << folder.findings();
    EXPECT_EQ(loaded->carrier, Carrier::Robot);
    EXPECT_EQ(loaded->T_flange_scanner.iso.translation(), Eigen::Vector3d(0, 80, 120));
    EXPECT_EQ(std::holds_alternative<drivers::rtde::Options>(loaded->pose_options()), std::string{dialect} == "ur");
    EXPECT_EQ(loaded->supplies[0].scan_path, 1);
  }
}

TEST(Load, WhatARobotThatCarriesTheScannerNeedsIsAskedFor) {
  const auto findings = [](const std::string& from, const std::string& to) {
    CellFolder folder;
    put_on_robot(folder, "ur");
    folder.edit(from, to);
    return folder.findings();
  };
  const auto expect = [&](const std::string& from, const std::string& to, const std::string& said) {
    EXPECT_NE(findings(from, to).find(said), std::string::npos) << findings(from, to);
  };
  expect("pose_address = \"192.168.0.20:30004\"", "", "robot.pose_address is missing, but the robot carries");
  expect("T_flange_scanner = { xyz_mm = [0, 80, 120], rpy_deg = [0, 0, 0] }", "",
         "scanner.T_flange_scanner is missing in [scanner]");
  expect("dialect = \"ur\"", "dialect = \"kawasaki\"", "robot.pose_listen is missing");
  expect("dialect = \"ur\"", "dialect = \"kawasaki\"", "robot.pose_address is for dialect ur; remove it");
  expect("pose_address =", "pose_listen = \"0.0.0.0:5003\"\npose_address =", "robot.pose_listen is for dialect fanuc");
  expect("T_base_supply", "path_timeout_ms = 15000\nT_base_supply", "supply.path_timeout_ms = 15000 is not less than");
  expect("T_base_supply", "sweep_end_deg = 16\nT_base_supply",
         "supply.sweep_end_deg is for scanner.carrier = pivot only; remove it");
  expect("[scanner]", "[pivot]\ncan = \"can0\"\n[scanner]", "pivot.can is for scanner.carrier = pivot only; remove it");
}

TEST(Load, KeysOfTheOtherScannerAreNamed) {
  CellFolder folder;
  make_leuze(folder, "lps36");
  folder.edit("profile_timeout_ms = 500", "profile_timeout_ms = 500\nstart_deg = 70");
  EXPECT_NE(folder.findings().find("scanner.start_deg is for scanner.model = lms400 only; remove it"),
            std::string::npos)
      << folder.findings();
  folder.edit("start_deg = 70", "manual_exposure_us = 80");
  EXPECT_NE(folder.findings().find("scanner.manual_exposure_us has no effect; write exposure = \"manual\""),
            std::string::npos);
  folder.edit("manual_exposure_us = 80", "manual_exposure_us = 80\nexposure = \"manual\"");
  EXPECT_NE(folder.findings().find("80 is less than an LPS 36 can; use 98 … 1310"), std::string::npos);
}

TEST(Load, EachMakeOfRobotHasItsDialect) {
  using enum drivers::robot::Dialect;
  for (const auto& [name, dialect] : {std::pair{"ur", UniversalRobots}, {"fanuc", Fanuc}, {"kawasaki", Kawasaki}}) {
    CellFolder folder;
    folder.edit("dialect = \"ur\"", std::string("dialect = \"") + name + "\"");
    const auto loaded = folder.load();
    ASSERT_TRUE(loaded.has_value()) << folder.findings();
    EXPECT_EQ(loaded->robot.dialect, dialect) << name;
  }
}

TEST(Load, AbsentKeysHaveTheTablesDefaults) {
  CellFolder folder;
  folder.cell = R"([pivot]
can = "cannelloni://10.0.0.2:20000"
T_base_pivot = { xyz_mm = [0, 0, 1500], rpy_deg = [0, 90, 0] }
[scanner]
model = "lms400"
address = "[fd00::1]:2111"
T_pivot_scanner = { xyz_mm = [0, 0, 0], rpy_deg = [180, -90, 0] }
[[supply]]
id = 7
size_mm = [100, 100, 100.5]
T_base_supply = { xyz_mm = [0, 0, 0], rpy_deg = [0, 0, 0] }
sweep_start_deg = -10
sweep_end_deg = 10
[[part]]
id = 9
file = "track_link.toml"
knowledge_base = "/kb/track_link.kb"
tilt_max_deg = 30
)";
  const auto loaded = folder.load();
  ASSERT_TRUE(loaded.has_value()) << folder.findings();
  EXPECT_EQ(loaded->robot_listen, "");
  EXPECT_EQ(loaded->lms400.range.in_deg(), 70);
  EXPECT_EQ(loaded->plc.detect_timeout, 5000ms);
  EXPECT_EQ(loaded->detection.deadline, 3000ms);
  EXPECT_EQ(loaded->recipes[0].knowledge_base, "/kb/track_link.kb");
  EXPECT_NEAR(*loaded->recipes[0].tilt_max_rad, M_PI / 6, 1e-12);
  EXPECT_EQ(loaded->supplies[0].size_mm.z(), 100.5);
}

TEST(Load, TheRoleOnThePlcsLineAndItsAddressBelongTogether) {
  CellFolder folder;
  folder.edit("role = \"server\"", "role = \"client\"");
  EXPECT_EQ(
      folder.findings(),
      std::to_string(folder.line_of("role = ")) +
          ":8: plc.role is \"client\", but where the PLC's Modbus server is does not stand there; write address = "
          "\"192.168.0.10:502\" below\n" +
          std::to_string(folder.line_of("listen = \"0.0.0.0:502")) +
          ":10: plc.listen is for the role server, but plc.role is \"client\" and nobody connects here; remove it\n");
  folder.edit("listen = \"0.0.0.0:502\"", "").edit("address = \"\"", "address = \"192.168.0.10:502\"");
  folder.edit("unit_id = 255", "unit_id = 1").edit("poll_ms = 20", "poll_ms = 50");
  const auto loaded = folder.load();
  ASSERT_TRUE(loaded.has_value()) << folder.findings();
  EXPECT_EQ(loaded->plc.role, plc::LineRole::Client);
  EXPECT_EQ(loaded->plc_line(), "192.168.0.10:502");
  EXPECT_EQ(loaded->plc.unit_id, 1);
  EXPECT_EQ(loaded->plc.poll, 50ms);
  EXPECT_EQ(loaded->plc.reply_timeout, 1000ms);
  folder.edit("poll_ms = 50", "poll_ms = 1000").edit("heartbeat_timeout_ms = 3000", "heartbeat_timeout_ms = 1500");
  EXPECT_EQ(folder.findings(), std::to_string(folder.line_of("poll_ms = ")) +
                                   ":11: plc.heartbeat_timeout_ms = 1500 is less than two polls of 1000 ms, the PLC "
                                   "would be taken for lost between them; poll more often, or use at least 2000\n");
}

struct Mistake {
  const char* from;
  const char* to;
  const char* at;  ///< Start of the line of the finding, in the spoiled file.
  int column;
  const char* message;
};
class OneMistake : public testing::TestWithParam<Mistake> {};

TEST_P(OneMistake, OneFindingWithPlaceAndRemedy) {
  CellFolder folder;
  folder.edit(GetParam().from, GetParam().to);
  EXPECT_EQ(folder.findings(), std::to_string(folder.line_of(GetParam().at)) + ":" + std::to_string(GetParam().column) +
                                   ": " + GetParam().message + "\n");
}

INSTANTIATE_TEST_SUITE_P(
    Keys, OneMistake,
    testing::Values(
        Mistake{"frequency_hz = 360", "frequncy_hz = 360", "frequncy_hz", 1,
                "unknown key \"frequncy_hz\" in [scanner]; did you mean \"frequency_hz\"?"},
        Mistake{"frequency_hz = 360", "speed = 3", "speed", 1,
                "unknown key \"speed\" in [scanner]; remove it, or look the name up in docs/configuration.md"},
        Mistake{"[reach]", "[raech]", "[raech]", 2, "unknown section \"raech\"; did you mean \"reach\"?"},
        Mistake{"[cell]", "threads = 2\n[cell]", "threads", 1,
                "unknown key \"threads\" before any section; put it under [detection]"},
        Mistake{"frequency_hz = 360", "frequency_hz = 149.9", "frequency_hz", 16,
                "scanner.frequency_hz = 149.9 is outside 150 … 500; use at least 150"},
        Mistake{"frequency_hz = 360", "frequency_hz = nan", "frequency_hz", 16,
                "scanner.frequency_hz = nan is not a finite number; give one within 150 … 500"},
        Mistake{"frequency_hz = 360", "frequency_hz = -inf", "frequency_hz", 16,
                "scanner.frequency_hz = -inf is not a finite number; give one within 150 … 500"},
        Mistake{"frequency_hz = 360", "frequency_hz = \"360\"", "frequency_hz", 16,
                "scanner.frequency_hz = \"360\" is not a number; write it as frequency_hz = 360"},
        Mistake{"filter_mask = 0", "filter_mask = 1.5", "filter_mask", 15,
                "scanner.filter_mask = 1.5 is not a whole number; write it as filter_mask = 0"},
        Mistake{"extended_remission = false", "extended_remission = 0", "extended_remission", 22,
                "scanner.extended_remission = 0 is not a flag; write it as extended_remission = false"},
        Mistake{"model = \"lms400\"", "model = \"lms511\"", "model", 9,
                "scanner.model = \"lms511\" is not one of \"lms400\", \"lps36\", \"lps36hi\"; use one of them"},
        Mistake{"# exposure = \"device\"", "exposure = \"dark\"", "exposure", 12,
                "scanner.exposure is for scanner.model = lps36, lps36hi only; remove it"},
        Mistake{"model = \"lms400\"\n", "", "[scanner]", 1,
                "scanner.model is missing in [scanner]; add, for example: model = \"lms400\""},
        Mistake{"address = \"192.168.0.1:2111\"", "address = \"192.168.0.1\"", "address = \"192", 11,
                "scanner.address = \"192.168.0.1\" has no port; write it as host:port"},
        Mistake{"address = \"192.168.0.1:2111\"", "address = \"192.168.0.300:2111\"", "address = \"192", 11,
                "scanner.address = \"192.168.0.300:2111\" has no valid IPv4 address; it has four numbers of 0 … 255"},
        Mistake{"address = \"192.168.0.1:2111\"", "address = \"scanner:99999\"", "address = \"scanner", 11,
                "scanner.address = \"scanner:99999\" has the port \"99999\"; give a number of 1 … 65535"},
        Mistake{"address = \"192.168.0.1:2111\"", "address = \"fd00::1:2111\"", "address = \"fd00", 11,
                "scanner.address = \"fd00::1:2111\" has a host with colons; put an IPv6 address in brackets, "
                "[address]:port"},
        Mistake{"allow = [\"192.168.0.10\"]", "allow = [\"192.168.0.10\", \"plc1\"]", "allow", 26,
                "plc.allow: \"plc1\" is no IP address; write each as \"192.168.0.10\""},
        Mistake{"can = \"can0\"", "can = \"slcan://x\"", "can = ", 7,
                "pivot.can = \"slcan://x\" has an unknown scheme; use cannelloni://HOST:PORT"},
        Mistake{"can = \"can0\"", "can = \"cannelloni://10.0.0.2:0\"", "can = ", 7,
                "pivot.can = \"cannelloni://10.0.0.2:0\" has the port 0; give the port of the bridge, 1 … 65535"},
        Mistake{
            "can = \"can0\"", "can = \"an_interface_far_too_long\"", "can = ", 7,
            "pivot.can = \"an_interface_far_too_long\" is no network interface; use can0 or cannelloni://HOST:PORT"},
        Mistake{"size_mm = [1000, 800, 500]", "size_mm = [1000, 800]", "size_mm", 11,
                "supply.size_mm is a list of 2; give three numbers, [x, y, z]"},
        Mistake{"size_mm = [1000, 800, 500]", "size_mm = [1000, -800, 500]", "size_mm", 18,
                "supply.size_mm[1] = -800 is outside 0 … 5000; use at least 0"}));

TEST(Load, KeysOfATransformAreCheckedOneByOne) {
  CellFolder folder;
  folder.edit("xyz_mm = [60, 0, 0], rpy_deg", "xyz_m = [0.06, 0, 0], rpy_deg");
  const std::string line = std::to_string(folder.line_of("T_pivot_scanner"));
  EXPECT_EQ(folder.findings(), line + ":19: scanner.T_pivot_scanner has no xyz_mm; add xyz_mm = [x, y, z]\n" + line +
                                   ":21: unknown key \"xyz_m\" in scanner.T_pivot_scanner; did you mean \"xyz_mm\"?\n");
}

INSTANTIATE_TEST_SUITE_P(Sections, OneMistake,
                         testing::Values(Mistake{"[[supply]]", "[supply]", "[supply]", 1,
                                                 "[supply] is a list; write it in double brackets, [[supply]]"},
                                         Mistake{"[pivot]", "[[pivot]]", "[[pivot]]", 3,
                                                 "[[pivot]] stands for one thing only; write [pivot]"}));

TEST(Load, AScannerThatLooksPastTheSupplyIsAMistake) {
  const std::string supply = "T_base_supply = { xyz_mm = [1200, 0, 0], rpy_deg = [0, 0, 0] }";
  const std::string pivot = "T_base_pivot = { xyz_mm = [1200, 0, 1860], rpy_deg = [0, 90, 0] }";
  const std::string head = "in the middle of the sweep the scanner does not look into the supply: ";
  struct Wrong {
    std::string from, to, why;
  };
  for (const Wrong& wrong :
       {Wrong{supply, "T_base_supply = { xyz_mm = [1.2, 0, 0], rpy_deg = [0, 0, 0] }",
              "it meets the floor at x = 1199, y = 0 mm"},
        Wrong{pivot, "T_base_pivot = { xyz_mm = [1200, 0, 1860], rpy_deg = [0, 2, 0] }", "it never looks down into it"},
        Wrong{pivot, "T_base_pivot = { xyz_mm = [1.2, 0, 1.86], rpy_deg = [0, 90, 0] }",
              "the scanner stands at z = -58 mm, below the walls' tops"}}) {
    CellFolder folder;
    folder.edit(wrong.from, wrong.to);
    EXPECT_FALSE(folder.load().has_value());
    EXPECT_NE(folder.findings().find(head + wrong.why), std::string::npos) << folder.findings();
  }
}

TEST(Load, AScannerOutOfItsRangeIsAMistake) {
  CellFolder folder;
  folder.edit("xyz_mm = [1200, 0, 1860]", "xyz_mm = [1200, 0, 3160]");
  EXPECT_NE(folder.findings().find("the scanner is 3100 mm from the supply's floor and 2850 mm from half its walls' "
                                   "height, but an LMS 400 measures from 700 to 3000 mm; mount it nearer"),
            std::string::npos)
      << folder.findings();
  const auto leuze = [](const std::string& model, const std::string& height_mm) {
    CellFolder small;
    make_leuze(small, model);
    small.edit("xyz_mm = [1200, 0, 560]", "xyz_mm = [1200, 0, " + height_mm + "]");
    return small.findings();
  };
  EXPECT_EQ(leuze("lps36", "860"), "");
  EXPECT_NE(leuze("lps36", "310").find("but an LPS 36 measures from 200 to 800 mm; mount it farther away"),
            std::string::npos);
  EXPECT_NE(leuze("lps36hi", "760").find("but an LPS 36 HI measures from 200 to 600 mm; mount it nearer"),
            std::string::npos);
}

TEST(Load, RadiansForDegreesAreAMistakeInAnyTransform) {
  const auto said = [](const std::string& rpy) {
    CellFolder folder;
    folder.edit("T_base_supply = { xyz_mm = [1200, 0, 0], rpy_deg = [0, 0, 0] }",
                "T_base_supply = { xyz_mm = [1200, 0, 0], rpy_deg = " + rpy + " }");
    return folder.findings();
  };
  EXPECT_NE(said("[0, 0, 3.14159]").find("supply.T_base_supply.rpy_deg: 3.14159 looks like radians; write 180\n"),
            std::string::npos);
  EXPECT_NE(said("[0, 0, -1.5708]").find("supply.T_base_supply.rpy_deg: -1.5708 looks like radians; write -90\n"),
            std::string::npos);
  for (const char* degrees : {"[0, 0, 1.57]", "[0, 0, 3.1]", "[0, 0, 180]", "[0, 0, 0.0001]"})
    EXPECT_EQ(said(degrees), "") << degrees;
}

TEST(Load, WhereTheRobotCarriesTheScannerMetresAreAMistakeToo) {
  const auto said = [](const std::string& from, const std::string& to) {
    CellFolder folder;
    put_on_robot(folder, "ur");
    folder.edit(from, to);
    return folder.findings();
  };
  const std::string supply = "T_base_supply = { xyz_mm = [1200, 0, 0]";
  EXPECT_NE(
      said(supply, "T_base_supply = { xyz_mm = [1.2, 0, 0]")
          .find("supply.T_base_supply puts the robot's base into the supply, 1.2 mm from the middle of its floor; "
                "give xyz_mm in mm\n"),
      std::string::npos);
  EXPECT_EQ(said(supply, "T_base_supply = { xyz_mm = [0, 0, -1500]"), "") << "a robot above the supply";
  EXPECT_NE(
      said("T_flange_scanner = { xyz_mm = [0, 80, 120]", "T_flange_scanner = { xyz_mm = [0, 0.08, 0.12]")
          .find("scanner.T_flange_scanner puts the scanner 0.144 mm from the flange's middle; give xyz_mm in mm\n"),
      std::string::npos);
}

TEST(Load, ABaseThatDoesNotPointUpIsAMistake) {
  const auto said = [](const std::string& rpy_deg) {
    CellFolder folder;
    put_on_robot(folder, "ur");
    folder.edit("T_base_supply = { xyz_mm = [1200, 0, 0], rpy_deg = [0, 0, 0]",
                "T_base_supply = { xyz_mm = [1200, 0, 0], rpy_deg = " + rpy_deg);
    return folder.findings();
  };
  EXPECT_EQ(said("[20, 0, 90]"), "") << "a supply that stands slanted";
  EXPECT_NE(said("[180, 0, 0]")
                .find("are lifted, are 180 deg apart, 60 are allowed; correct rpy_deg, or give the arm "
                      "on a ceiling or wall a user frame whose z points up\n"),
            std::string::npos)
      << said("[180, 0, 0]");
  EXPECT_NE(said("[0, 90, 0]").find("90 deg apart"), std::string::npos) << said("[0, 90, 0]");
}

TEST(Load, ASupplyThatNobodyReachesIsAMistake) {
  CellFolder folder;
  folder.edit("radius_max_mm = 0", "radius_max_mm = 690");
  EXPECT_NE(folder.findings().find("no place of the supply is nearer than 700 mm to the robot's base, beyond "
                                   "reach.radius_max_mm = 690; correct T_base_supply (mm), or the reach\n"),
            std::string::npos)
      << folder.findings();
  folder.edit("radius_max_mm = 690", "radius_max_mm = 710");
  EXPECT_EQ(folder.findings(), "");
}

TEST(Load, TwoSocketsOnOnePortAndADeviceThatIsTheCellItselfAreMistakes) {
  const auto said = [](const std::string& from, const std::string& to) {
    CellFolder folder;
    put_on_robot(folder, "ur");
    folder.edit(from, to);
    return folder.findings();
  };
  const std::string address = "pose_address = \"192.168.0.20:30004\"";
  EXPECT_NE(said(address, "pose_address = \"127.0.0.1:5002\"")
                .find("robot.pose_address = \"127.0.0.1:5002\" is also where robot.listen is; give each device's own "
                      "address and port\n"),
            std::string::npos);
  EXPECT_NE(said(address, "pose_address = \"192.168.0.1:2111\"").find("is also where scanner.address is"),
            std::string::npos);
  EXPECT_EQ(said(address, "pose_address = \"192.168.0.20:5002\""), "") << "on another machine";
  EXPECT_NE(said("dialect = \"ur\"\n" + address, "dialect = \"fanuc\"\npose_listen = \"0.0.0.0:502\"")
                .find("robot.pose_listen has the same port as plc.listen, 502; use another, such as 5003\n"),
            std::string::npos);
}

INSTANTIATE_TEST_SUITE_P(
    AcrossKeys, OneMistake,
    testing::Values(
        Mistake{
            "range_deg = 40", "range_deg = 55.5", "range_deg", 13,
            "scanner.start_deg + scanner.range_deg = 125.5 is beyond the field of view, 55 … 125; use range_deg = 55 "
            "at most"},
        Mistake{"sample_period_ms = 10", "sample_period_ms = 100.5", "sample_period_ms", 20,
                "pivot.sample_period_ms = 100.5 is not a whole number; write it as sample_period_ms = 10"},
        Mistake{"setpoint_horizon_ms = 200", "setpoint_horizon_ms = 19", "setpoint_horizon_ms", 23,
                "pivot.setpoint_horizon_ms = 19 is outside 20 … 2000; use at least 20"},
        Mistake{
            "module_id = 12", "module_id = 32", "module_id", 13,
            "pivot.module_id = 32 is above 31, the last number of a PowerCube module; correct it, or set protocol = "
            "\"motion\""},
        Mistake{"can_listen_port = 0", "can_listen_port = 20000", "can_listen_port", 19,
                "pivot.can_listen_port is for cannelloni, but pivot.can is a network interface; remove it"},
        Mistake{"detect_timeout_ms = 5000", "detect_timeout_ms = 3000", "deadline_ms", 15,
                "detection.deadline_ms = 3000 is not shorter than plc.detect_timeout_ms = 3000; use less, or a longer "
                "time-out"},
        Mistake{
            "heartbeat_timeout_ms = 3000", "heartbeat_timeout_ms = 50", "heartbeat_timeout_ms", 24,
            "plc.heartbeat_timeout_ms = 50 is shorter than a PLC's cycle may be; use 0 (not watched) or at least 100"},
        Mistake{"listen = \"0.0.0.0:5002\"", "listen = \"127.0.0.1:502\"", "listen = \"127", 10,
                "robot.listen has the same port as plc.listen, 502; use another, such as 5002"},
        Mistake{"address = \"\"", "address = \"192.168.0.10:502\"", "address = \"192.168.0.10", 11,
                "plc.address is for the role client, but plc.role is \"server\"; remove it, or write role = \"client\" "
                "and remove listen"},
        Mistake{"sweep_end_deg = 16", "sweep_end_deg = -16.5", "sweep_end_deg", 17,
                "supply.sweep_end_deg is 0.5 deg from sweep_start_deg, that is no sweep; use at least 1"},
        Mistake{
            "sweep_speed_deg_s = 34", "sweep_speed_deg_s = 2", "sweep_speed_deg_s", 21,
            "supply: the sweep takes 16 s, not less than plc.scan_timeout_ms = 15000; sweep faster, or use a longer "
            "time-out"},
        Mistake{"sweep_end_deg = 16", "sweep_end_deg = -14.5", "sweep_speed_deg_s", 21,
                "supply: the sweep gives 15 profiles; sweep slower or farther, 20 are the least"}));

TEST(Load, APivotThatWouldHaltBetweenSetPointsIsRefused) {
  CellFolder folder;
  folder.edit("sample_period_ms = 10", "sample_period_ms = 60")
      .edit("setpoint_horizon_ms = 200", "setpoint_horizon_ms = 100");
  EXPECT_EQ(folder.findings(),
            std::to_string(folder.line_of("setpoint_horizon_ms")) +
                ":23: pivot.setpoint_horizon_ms = 100 is less than two sample periods of 60 ms, the pivot "
                "would halt between set-points; use at least 120\n");
}

TEST(Load, ARadiusWithinTheOneToKeepOutOfIsRefused) {
  CellFolder folder;
  folder.edit("axis_min_mm = 0", "axis_min_mm = 300");
  EXPECT_EQ(folder.findings(), "");
  folder.edit("radius_max_mm = 0", "radius_max_mm = 250");
  EXPECT_EQ(folder.findings(), std::to_string(folder.line_of("radius_max_mm")) +
                                   ":17: reach.radius_max_mm = 250 leaves nothing outside of reach.axis_min_mm = 300; "
                                   "use more, or 0 for no limit\n");
}

TEST(Load, WhatIsMissingIsSaidOfTheWholeFile) {
  CellFolder folder;
  folder.cell = "[cell]\nname = \"empty\"\n";
  EXPECT_EQ(folder.findings(),
            "0:1: section [pivot] is missing; add it, with can, T_base_pivot\n"
            "0:1: section [scanner] is missing; add it, with model, address, T_pivot_scanner\n"
            "0:1: there is no [[supply]]; add one for each charge carrier\n"
            "0:1: there is no [[part]]; add one for each part that the PLC can ask for\n");
}

TEST(Load, ASectionWithASlipIsNotMissingToo) {
  for (const auto& [name, slip] : {std::pair{"[scanner]", "[scaner]"}, {"[[supply]]", "[[suply]]"}}) {
    CellFolder folder;
    folder.edit(name, slip);
    const std::string findings = folder.findings();
    EXPECT_NE(findings.find("unknown section"), std::string::npos) << findings;
    EXPECT_EQ(findings.find("is missing"), std::string::npos) << findings;
    EXPECT_EQ(findings.find("there is no"), std::string::npos) << findings;
  }
}

TEST(Load, AForgottenCarrierIsSaidWhereItBelongs) {
  CellFolder folder;
  put_on_robot(folder, "ur");
  folder.edit("carrier = \"robot\"\n", "");
  const std::string findings = folder.findings();
  EXPECT_NE(
      findings.find(std::to_string(folder.line_of("[scanner]")) +
                    ":1: section [pivot] is missing; add it, with can, T_base_pivot; or, if the robot carries the "
                    "scanner, write carrier = \"robot\" in [scanner]\n"),
      std::string::npos)
      << findings;
  EXPECT_NE(findings.find("scanner.T_flange_scanner is for scanner.carrier = robot only; remove it, or write carrier = "
                          "\"robot\" in [scanner]\n"),
            std::string::npos)
      << findings;
}

TEST(Load, AnAddressThatIsBadIsNotMissingToo) {
  CellFolder folder;
  put_on_robot(folder, "ur");
  folder.edit("pose_address = \"192.168.0.20:30004\"", "pose_address = \"192.168.0.20\"");
  EXPECT_EQ(folder.findings(), std::to_string(folder.line_of("pose_address")) +
                                   ":16: robot.pose_address = \"192.168.0.20\" has no port; write it as host:port\n");
}

TEST(Load, APartFileIsNoCellFileNorTheOtherWayRound) {
  CellFolder folder;
  ASSERT_EQ(folder.findings(), "");
  const auto cell = load(folder.path("track_link.toml"));
  ASSERT_FALSE(cell.has_value());
  ASSERT_EQ(cell.error().size(), 1U);
  EXPECT_EQ(cell.error()[0].message, "this is a part file; give the cell file that names it under [[part]]");
  const auto part = load_part(folder.path("cell.toml"));
  ASSERT_FALSE(part.has_value());
  ASSERT_EQ(part.error().size(), 1U);
  EXPECT_EQ(part.error()[0].message, "this is a cell file; give one of the part files that it names under [[part]]");
}

TEST(Load, IdsAreUnique) {
  CellFolder folder;
  folder.cell += "[[part]]\nid = 1\nfile = \"track_link.toml\"\nknowledge_base = \"b.kb\"\n";
  const int last = folder.line_of("[[part]]") + 20;
  ASSERT_GT(last, 0);
  const std::string findings = folder.findings();
  EXPECT_NE(findings.find(": part.id = 1 stands also in line "), std::string::npos) << findings;
  EXPECT_EQ(std::count(findings.begin(), findings.end(), '\n'), 1) << findings;
}

TEST(Load, AThousandMistakesAreCutShort) {
  CellFolder folder;
  for (int i = 0; i < 1000; ++i) folder.cell += "bad" + std::to_string(i) + " = 1\n";
  const auto loaded = folder.load();
  ASSERT_FALSE(loaded.has_value());
  EXPECT_EQ(loaded.error().size(), 101U);
  EXPECT_EQ(loaded.error().back().message, "900 more findings are not shown; correct these first");
}

TEST(Part, FindingsNameThePartFile) {
  CellFolder folder;
  folder.edit_part("mesh = \"track_link.stl\"", "mesh = \"gone.stl\"")
      .edit_part("approach_mm = 100", "aproach_mm = 100");
  EXPECT_EQ(
      folder.findings(),
      std::string{"track_link.toml:7:8: mesh: there is no file gone.stl; give its path from the folder of this file\n"
                  "track_link.toml:"} +
          folder.part_line_of("aproach_mm") +
          ":1: unknown key \"aproach_mm\" in [[grasp]]; did you mean \"approach_mm\"?\n");
}

TEST(Part, TheExampleHasAGripperAndAGraspForIt) {
  const CellFolder folder;
  const auto loaded = folder.load();
  ASSERT_TRUE(loaded.has_value()) << folder.findings();
  const Part& part = loaded->recipes[0].part;
  ASSERT_TRUE(part.gripper && part.gripper->jaws);
  EXPECT_EQ(part.gripper->jaws->opening_max_mm, 140);
  EXPECT_EQ(part.gripper->jaws->size_mm, Eigen::Vector3d(12, 40, 80));
  EXPECT_EQ(part.gripper->jaws->beyond_mm, 20);
  ASSERT_EQ(part.gripper->body.size(), 1U);
  EXPECT_EQ(part.gripper->body[0].shape, vision::Gripper::Solid::Shape::Box);
  EXPECT_EQ(part.gripper->body[0].size_mm, Eigen::Vector3d(170, 90, 120));
  EXPECT_EQ(part.gripper->body[0].T_tcp_solid.translation(), Eigen::Vector3d(0, 0, -120));
  ASSERT_EQ(part.grasps.size(), 1U);
  EXPECT_FALSE(part.grasps[0].opening_mm.has_value());
  EXPECT_EQ(part.grasps[0].holding_mm, 120.0);
  EXPECT_EQ(part.grasps[0].retreat_mm, 0);
  EXPECT_EQ(part.grasps[0].preference, 0);
  EXPECT_EQ(loaded->reach.unmeasured, vision::Unmeasured::Blocked);
  EXPECT_FALSE(loaded->reach.clearance_mm.has_value());
}

TEST(Part, AGripperWithoutJawsIsItsBody) {
  CellFolder folder;
  folder.part = R"(mesh = "track_link.stl"
[[gripper_body]]
shape = "cylinder"
size_mm = [40, 40, 60]
T_tcp_solid = { xyz_mm = [0, 0, -30], rpy_deg = [0, 0, 0] }
[[gripper_body]]
shape = "box"
size_mm = [100, 80, 60]
T_tcp_solid = { xyz_mm = [0, 0, -90], rpy_deg = [0, 0, 45] }
[[grasp]]
T_object_tcp = { xyz_mm = [0, 0, 0], rpy_deg = [180, 0, 0] }
retreat_mm = 50
preference = -1.5
)";
  const auto loaded = folder.load();
  ASSERT_TRUE(loaded.has_value()) << folder.findings();
  const Part& part = loaded->recipes[0].part;
  ASSERT_TRUE(part.gripper.has_value());
  EXPECT_FALSE(part.gripper->jaws.has_value());
  ASSERT_EQ(part.gripper->body.size(), 2U);
  EXPECT_EQ(part.gripper->body[0].shape, vision::Gripper::Solid::Shape::Cylinder);
  EXPECT_NEAR(part.gripper->body[1].T_tcp_solid.linear()(1, 0), std::sqrt(0.5), 1e-12);
  EXPECT_EQ(part.grasps[0].retreat_mm, 50);
  EXPECT_EQ(part.grasps[0].preference, -1.5);
}

TEST(Part, GraspsFitTheirGripper) {
  struct Wrong {
    const char *from, *to, *line, *said;
  };
  for (const Wrong& wrong : {
           Wrong{"# opening_mm = 140", "opening_mm = 150", "opening_mm",
                 ":14: grasp.opening_mm = 150 is more than gripper.opening_max_mm = 140; use less, or correct the "
                 "gripper\n"},
           Wrong{"holding_mm = 120", "holding_mm = 140.5", "holding_mm",
                 ":14: grasp.holding_mm = 140.5 is more than gripper.opening_max_mm = 140; use less, or correct the "
                 "gripper\n"},
           Wrong{"holding_mm = 120", "", "[[grasp]]",
                 ":1: grasp.holding_mm is missing in [[grasp]], but the gripper has jaws; add how far they stand apart "
                 "when they hold the part, for example: holding_mm = 120\n"},
           Wrong{
               "holding_mm = 120", "holding_mm = 140", "holding_mm",
               ":14: grasp.holding_mm = 140 is as wide as the jaws stand on the way in, so they never close; use less "
               "(or more, for a grip from within), or another opening_mm\n"},
           Wrong{"shape = \"box\"", "shape = \"cylinder\"", "size_mm",
                 ":11: gripper_body.size_mm of a cylinder has two diameters, 170 and 90; write [diameter, diameter, "
                 "length]\n"},
           Wrong{"holding_mm = 120", "holding_mm = -1", "holding_mm",
                 ":14: grasp.holding_mm = -1 is outside 0 … 5000; use at least 0\n"},
           Wrong{"opening_max_mm = 140", "opening_max_mm = 0", "opening_max_mm",
                 ":18: gripper.opening_max_mm = 0 is outside 0.1 … 5000; use at least 0.1\n"},
       }) {
    CellFolder folder;
    folder.edit_part(wrong.from, wrong.to);
    EXPECT_EQ(folder.findings(), "track_link.toml:" + folder.part_line_of(wrong.line) + wrong.said);
  }
}

TEST(Part, OpeningsWithoutJawsAreNamed) {
  CellFolder folder;
  const std::size_t from = folder.part.find("[gripper]"), to = folder.part.find("[[gripper_body]]");
  folder.part.erase(from, to - from);
  folder.edit_part("# opening_mm = 140", "opening_mm = 130");
  const std::string remedy =
      " is for a gripper with jaws, but there is no section [gripper]; add it, with opening_max_mm and jaw_size_mm, or "
      "remove this\n";
  EXPECT_EQ(folder.findings(), "track_link.toml:" + folder.part_line_of("opening_mm") + ":14: grasp.opening_mm" +
                                   remedy + "track_link.toml:" + folder.part_line_of("holding_mm") +
                                   ":14: grasp.holding_mm" + remedy);
}

TEST(Part, APartWithoutGraspCannotBePickedButTrained) {
  CellFolder folder;
  folder.part = "mesh = \"track_link.stl\"\n";
  EXPECT_EQ(folder.findings(),
            std::to_string(folder.line_of("file = ")) +
                ":8: part.file: track_link.toml has no [[grasp]], so nothing can be picked; add one\n");
  const auto part = load_part(folder.path("track_link.toml"));
  ASSERT_TRUE(part.has_value());
  EXPECT_EQ(part->options.name, "track_link");
  EXPECT_EQ(part->mesh_unit_mm, 1);
  EXPECT_FALSE(part->options.symmetry.has_value());
}

TEST(Part, SymmetryIsMadeFromItsKind) {
  CellFolder folder;
  const auto symmetry = [&](const std::string& keys) {
    const auto part = load_part_text(folder.path("p.toml"), "mesh = \"track_link.stl\"\n[symmetry]\n" + keys);
    EXPECT_TRUE(part.has_value()) << (part ? "" : part.error().front().message);
    return part ? part->options.symmetry.value() : vision::Symmetry{};
  };
  using Kind = vision::Symmetry::Kind;
  EXPECT_EQ(symmetry("kind = \"none\"").kind, Kind::None);
  EXPECT_EQ(symmetry("kind = \"revolution\"\naxis = [0, 1, 0]").axis, Eigen::Vector3d::UnitY());
  const auto centre = [&](const std::string& keys) {
    return load_part_text(folder.path("p.toml"), "mesh = \"track_link.stl\"\n[symmetry]\nkind = \"sphere\"\n" + keys)
        ->options.symmetry_centre_mm;
  };
  EXPECT_EQ(centre("centre_mm = [1, 2, 3]"), Eigen::Vector3d(1, 2, 3));
  EXPECT_FALSE(centre("").has_value());
  const auto cyclic = symmetry("kind = \"cyclic\"\nfold = 3");
  EXPECT_EQ(cyclic.kind, Kind::Finite);
  ASSERT_EQ(cyclic.rotations.size(), 3U);
  EXPECT_TRUE(cyclic.rotations[0].isIdentity());
  EXPECT_TRUE((cyclic.rotations[1] * cyclic.rotations[2]).isIdentity(1e-12));
  const auto dihedral = symmetry("kind = \"dihedral\"\nfold = 2");
  ASSERT_EQ(dihedral.rotations.size(), 4U);
  for (const auto& a : dihedral.rotations) {
    EXPECT_NEAR(a.determinant(), 1, 1e-12);
    for (const auto& b : dihedral.rotations)
      EXPECT_TRUE(std::any_of(dihedral.rotations.begin(), dihedral.rotations.end(), [&](const auto& c) {
        return c.isApprox(a * b, 1e-9);
      })) << "not closed";
  }
  const auto skew = load_part_text(
      folder.path("p.toml"), "mesh = \"track_link.stl\"\n[symmetry]\nkind = \"dihedral\"\nflip_axis = [0, 1, 1]\n");
  ASSERT_FALSE(skew.has_value());
  EXPECT_EQ(skew.error().front().message,
            "symmetry.flip_axis is not at right angles to symmetry.axis; use one that is");
}

TEST(Part, UnitsOfTheMesh) {
  const CellFolder folder;
  const auto part = load_part_text(folder.path("p.toml"),
                                   "mesh = \"track_link.stl\"\nmesh_unit = \"inch\"\npicking = \"conveyor\"\n");
  ASSERT_TRUE(part.has_value());
  EXPECT_EQ(part->mesh_unit_mm, 25.4);
  EXPECT_EQ(part->options.picking, vision::Picking::Conveyor);
}

TEST(NeedsRestart, NamesTheKeysThatDiffer) {
  CellFolder folder;
  const auto before = folder.load();
  ASSERT_TRUE(before.has_value());
  EXPECT_EQ(needs_restart(*before, *before), std::vector<std::string>{});
  folder.edit("listen = \"0.0.0.0:502\"", "listen = \"0.0.0.0:1502\"")
      .edit("frequency_hz = 360", "frequency_hz = 300")
      .edit("can = \"can0\"", "can = \"can1\"")
      .edit("word_order = \"s7\"", "word_order = \"logix\"")
      .edit("tilt_max_deg = 40", "tilt_max_deg = 30")
      .edit("size_mm = [1000, 800, 500]", "size_mm = [900, 800, 500]")
      .edit("heartbeat_timeout_ms = 3000", "heartbeat_timeout_ms = 2000");
  const auto after = folder.load();
  ASSERT_TRUE(after.has_value()) << folder.findings();
  EXPECT_EQ(needs_restart(*before, *after),
            (std::vector<std::string>{"plc.listen", "plc.word_order", "pivot.can", "scanner.frequency_hz"}));
  EXPECT_FALSE(before->supplies[0] == after->supplies[0]);
  EXPECT_TRUE(before->supplies[0] == before->supplies[0]);
}
}  // namespace
}  // namespace binpick::config
