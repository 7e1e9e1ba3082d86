#include "tests/emulators/world/example_parts.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>
#include <map>
#include <numbers>
#include <set>
#include <sstream>

#include "config/config.hpp"
#include "tests/emulators/world/grip.hpp"
#include "tests/emulators/world/solid_contact.hpp"

namespace binpick::emulators {
namespace {
struct Expected {
  std::string name;
  Eigen::Vector3f size_mm;
  double volume_min_cm3, volume_max_cm3;
};
class Parts : public testing::TestWithParam<Expected> {};

INSTANTIATE_TEST_SUITE_P(Example, Parts,
                         testing::Values(Expected{"gear_shaft", {60, 60, 180}, 200, 300},
                                         Expected{"track_link", {200, 120, 50}, 400, 620},
                                         Expected{"steering_wheel", {370, 370, 77}, 800, 1500},
                                         Expected{"contact_bridge", {60, 18, 12}, 6, 9}),
                         [](const auto& each) { return each.param.name; });

TEST_P(Parts, HasTheStatedSizeAndOneToFiveThousandTriangles) {
  const ExamplePart part = example_part(GetParam().name);
  Eigen::AlignedBox3f box;
  for (const auto& v : part.mesh.vertices_mm) box.extend(v);
  EXPECT_LT((box.sizes() - GetParam().size_mm).cwiseAbs().maxCoeff(), 0.8F) << box.sizes().transpose();
  EXPECT_GE(part.mesh.triangles.size(), 1000U);
  EXPECT_LE(part.mesh.triangles.size(), 5000U);
}

TEST_P(Parts, IsClosedAndTurnedOutwards) {
  const ExamplePart part = example_part(GetParam().name);
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  double volume_mm3 = 0;
  for (const auto& [a, b, c] : part.mesh.triangles) {
    const auto &p = part.mesh.vertices_mm[a], &q = part.mesh.vertices_mm[b], &r = part.mesh.vertices_mm[c];
    EXPECT_GT((q - p).cross(r - p).norm(), 1e-3F) << "degenerate triangle";
    volume_mm3 += static_cast<double>(p.dot(q.cross(r))) / 6;
    ++edges[{a, b}];
    ++edges[{b, c}];
    ++edges[{c, a}];
  }
  for (const auto& [edge, count] : edges) {
    ASSERT_EQ(count, 1) << "edge used twice in one direction";
    ASSERT_TRUE(edges.contains({edge.second, edge.first})) << "open edge";
  }
  EXPECT_GT(volume_mm3 / 1000, GetParam().volume_min_cm3);
  EXPECT_LT(volume_mm3 / 1000, GetParam().volume_max_cm3);
}

/// Whether turning by `degrees` about z maps the set of vertices onto itself.
bool same_when_turned(const vision::Mesh& mesh, double degrees) {
  const Eigen::AngleAxisf turn{static_cast<float>(degrees * std::numbers::pi / 180), Eigen::Vector3f::UnitZ()};
  return std::ranges::all_of(mesh.vertices_mm, [&](const Eigen::Vector3f& v) {
    const Eigen::Vector3f turned = turn * v;
    return std::ranges::any_of(mesh.vertices_mm, [&](const auto& w) { return (w - turned).norm() < 0.05F; });
  });
}

TEST(ExampleParts, SymmetriesAreAsStated) {
  EXPECT_TRUE(same_when_turned(example_part("gear_shaft").mesh, 15));
  EXPECT_FALSE(same_when_turned(example_part("gear_shaft").mesh, 7.5));
  EXPECT_FALSE(same_when_turned(example_part("track_link").mesh, 180));
  EXPECT_TRUE(same_when_turned(example_part("steering_wheel").mesh, 120));
  EXPECT_FALSE(same_when_turned(example_part("steering_wheel").mesh, 60));
  EXPECT_TRUE(same_when_turned(example_part("contact_bridge").mesh, 180));
}

TEST_P(Parts, PiecesCoverTheMesh) {
  // A mesh vertex lies in the bounding box of some piece, and the pieces reach nowhere beyond the mesh's box.
  const ExamplePart part = example_part(GetParam().name);
  std::vector<Eigen::AlignedBox3f> boxes;
  Eigen::AlignedBox3f all, mesh_box;
  for (const auto& v : part.mesh.vertices_mm) mesh_box.extend(v);
  for (const auto& piece : part.pieces) {
    Eigen::AlignedBox3f box;
    for (const auto& p : piece.points_mm) box.extend(p);
    boxes.push_back(Eigen::AlignedBox3f{(box.min().array() - 3).matrix(), (box.max().array() + 3).matrix()});
    all.extend(box);
  }
  for (const auto& v : part.mesh.vertices_mm)
    EXPECT_TRUE(std::ranges::any_of(boxes, [&](const auto& box) { return box.contains(v); })) << v.transpose();
  EXPECT_LT((all.sizes() - mesh_box.sizes()).cwiseAbs().maxCoeff(), 6);
}

TEST_P(Parts, GraspsComeFreelyAndHoldAsWideAsTheySay) {
  const ExamplePart part = example_part(GetParam().name);
  const RayMesh mesh{part.mesh};
  ASSERT_GE(part.grasps.size(), 10U);
  std::set<std::string> names;
  for (const ExampleGrasp& each : part.grasps) {
    const vision::Grasp grasp = each.grasp();
    EXPECT_TRUE(names.insert(grasp.name).second) << grasp.name;
    ASSERT_LE(*grasp.opening_mm, part.gripper.jaws->opening_max_mm) << grasp.name;
    for (double back = 0; back <= grasp.approach_mm; back += 1)
      for (const auto& solid : vision::solids_of(part.gripper, *grasp.opening_mm))
        ASSERT_FALSE(
            meets(solid, grasp.T_object_tcp.iso * Eigen::Translation3d(0, 0, -back) * solid.T_tcp_solid, 0, mesh))
            << grasp.name << ", " << back << " mm from the grasp";
    const auto closed = closed_on(mesh, part.gripper, grasp, GripRules::of(part));
    ASSERT_TRUE(closed) << grasp.name;
    EXPECT_NEAR(closed->jaws_mm, *grasp.holding_mm, 1) << grasp.name;
    EXPECT_NEAR(closed->off_middle_mm, 0, 1) << grasp.name;
  }
}

TEST(ExampleParts, AreWrittenAsStlAndToml) {
  const std::string folder = testing::TempDir() + "example_parts";
  const std::string path = write_example_part("track_link", folder);
  EXPECT_EQ(path, folder + "/track_link.toml");
  std::ifstream in{path};
  std::stringstream text;
  text << in.rdbuf();
  EXPECT_NE(text.str().find("mesh = \"track_link.stl\"\nscanner = \"lms400\"\n"), std::string::npos);
  EXPECT_NE(
      text.str().find("[[grasp]]\nname = \"bridge_top\"\nT_object_tcp = { xyz_mm = [0, 0, -14], rpy_deg = [180, 0, "
                      "90] }\napproach_mm = 50\nopening_mm = 95\nholding_mm = 80\n"),
      std::string::npos);
  const auto read = config::load_part(path);
  ASSERT_TRUE(read) << to_string(read.error().front());
  const ExamplePart part = example_part("track_link");
  ASSERT_TRUE(read->gripper);
  EXPECT_EQ(read->gripper->body.size(), part.gripper.body.size());
  EXPECT_EQ(read->gripper->jaws->size_mm, part.gripper.jaws->size_mm);
  ASSERT_EQ(read->grasps.size(), part.grasps.size());
  for (std::size_t i = 0; i < part.grasps.size(); ++i) {
    const vision::Grasp told = part.grasps[i].grasp();
    EXPECT_LT((read->grasps[i].T_object_tcp.iso.matrix() - told.T_object_tcp.iso.matrix()).norm(), 1e-3) << told.name;
    EXPECT_EQ(read->grasps[i].opening_mm, told.opening_mm);
    EXPECT_EQ(read->grasps[i].holding_mm, told.holding_mm);
  }
  const auto triangles = example_part("track_link").mesh.triangles.size();
  EXPECT_EQ(std::filesystem::file_size(folder + "/track_link.stl"), 84 + 50 * triangles);
}

TEST(ExampleParts, UnwritableFolderIsNamed) {
  try {
    write_example_part("track_link", "/proc/no_such_place");
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string{error.what()}.find("/proc/no_such_place"), std::string::npos);
  }
}
}  // namespace
}  // namespace binpick::emulators
