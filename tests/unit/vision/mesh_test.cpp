#include "vision/mesh.hpp"

#include <cstring>
#include <filesystem>
#include <fstream>
#include <gtest/gtest.h>

#include "tests/unit/vision/shapes.hpp"
#include "vision/file.hpp"

namespace binpick::vision {
namespace {
std::string written(const std::string& name, const std::string& text) {
  const std::string path = testing::TempDir() + name;
  std::ofstream(path, std::ios::binary) << text;
  return path;
}

TEST(Mesh, StlComesBackAsItWasSaved) {
  const Mesh box = shapes::box(40, 20, 10);
  const std::string path = testing::TempDir() + "box.stl";
  ASSERT_TRUE(save_stl(box, path));
  const auto loaded = load_mesh(path, 1);
  ASSERT_TRUE(loaded) << loaded.error().text;
  EXPECT_EQ(loaded->vertices_mm.size(), 8U);
  EXPECT_EQ(loaded->triangles.size(), 12U);
  EXPECT_NEAR(loaded->diameter_mm(), std::sqrt(1600.0 + 400 + 100), 1e-4);
  EXPECT_EQ(mesh_hash(*loaded), mesh_hash(cleaned(box)));
}

TEST(Mesh, ReadsObjAndPlyInTheirUnit) {
  const std::string obj = written("t.obj", "v 0 0 0\nv 1 0 0\nv 0 2 0\nv 1 2 0\nf 1 2 4 3\n");
  const auto from_obj = load_mesh(obj, 1000);
  ASSERT_TRUE(from_obj) << from_obj.error().text;
  EXPECT_EQ(from_obj->triangles.size(), 2U);
  EXPECT_NEAR(from_obj->diameter_mm(), 1000 * std::sqrt(5.0), 1e-2);
  const std::string ply = written("t.ply",
                                  "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                                  "property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
                                  "end_header\n0 0 0\n3 0 0\n0 4 0\n3 0 1 2\n");
  const auto from_ply = load_mesh(ply, 1);
  ASSERT_TRUE(from_ply) << from_ply.error().text;
  EXPECT_NEAR(from_ply->diameter_mm(), 5, 1e-5);
  EXPECT_NEAR((from_ply->centroid_mm() - Eigen::Vector3d(1, 4.0 / 3, 0)).norm(), 0, 1e-5);
}

TEST(Mesh, SaysWhatIsWrong) {
  const auto text = [](const std::string& path) {
    const auto mesh = load_mesh(path, 1);
    return mesh ? std::string("no error") : mesh.error().text;
  };
  EXPECT_NE(text("/nowhere/part.stl").find("cannot read /nowhere/part.stl: No such file"), std::string::npos);
  EXPECT_NE(text("part.step").find("use .stl, .obj or .ply"), std::string::npos);
  EXPECT_NE(text(written("empty.stl", "")).find("the file is empty"), std::string::npos);
  const std::string points = "v 0 0 0\nv 1 0 0\nv 0 2 0\n";
  EXPECT_NE(text(written("points.obj", points)).find("triangle"), std::string::npos);
  EXPECT_NE(text(written("line.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")).find("no triangle"), std::string::npos);
  EXPECT_NE(text(written("solid.stl", "solid nothing\nendsolid nothing\n")).find("triangle"), std::string::npos);

  const std::string path = testing::TempDir() + "nan.stl";
  ASSERT_TRUE(save_stl(shapes::box(1, 1, 1), path));
  auto bytes = *read_file(path);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(bytes.data() + 84 + 12, &nan, 4);
  ASSERT_TRUE(write_file(path, bytes));
  EXPECT_NE(text(path).find("not a finite number"), std::string::npos);
  EXPECT_FALSE(load_mesh(testing::TempDir() + "box.stl", 0));
}

TEST(Mesh, CleanedMergesAndDrops) {
  Mesh mesh;
  mesh.vertices_mm = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {9, 9, 9}};
  mesh.triangles = {{0, 1, 2}, {4, 5, 3}, {0, 0, 1}, {0, 3, 1}};
  const Mesh clean = cleaned(mesh);
  EXPECT_EQ(clean.vertices_mm.size(), 3U);
  EXPECT_EQ(clean.triangles.size(), 1U);
}

TEST(Mesh, DiameterOfManyVerticesIsThatOfAll) {
  const Mesh ball = shapes::moved(shapes::sphere(100, 160), Eigen::Isometry3d(Eigen::Translation3d(500, 0, 0)));
  ASSERT_GT(ball.vertices_mm.size(), 10'000U);
  EXPECT_NEAR(ball.diameter_mm(), 200, 0.1);
  EXPECT_NEAR((ball.centroid_mm() - Eigen::Vector3d(500, 0, 0)).norm(), 0, 1e-3);
}

TEST(Mesh, HashTellsMeshesApart) { EXPECT_NE(mesh_hash(shapes::box(1, 2, 3)), mesh_hash(shapes::box(1, 2, 3.0001F))); }
}  // namespace
}  // namespace binpick::vision
