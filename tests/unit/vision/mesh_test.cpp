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

TEST(Mesh, ReadsAsciiStlWithAnyLineEnds) {
  const std::string text =
      "solid \r\n facet normal 0 0 1\r\n  outer loop\r\n vertex 0 0 0\r\n vertex 1e1 0 0\r\n vertex 0 +20 0\r\n"
      "  endloop\r\n endfacet\r\n facet normal 0 0 1\n outer loop\n vertex 10 0 0\n vertex 10 20 0\n vertex 0 20 0\n"
      " endloop\n endfacet\nendsolid";
  const auto mesh = load_mesh(written("ascii.STL", text), 1);
  ASSERT_TRUE(mesh) << mesh.error().text;
  EXPECT_EQ(mesh->vertices_mm.size(), 4U);
  EXPECT_EQ(mesh->triangles.size(), 2U);
}

TEST(Mesh, ABinaryStlMayBeginWithSolid) {
  const std::string path = testing::TempDir() + "solid_binary.stl";
  ASSERT_TRUE(save_stl(shapes::box(1, 2, 3), path));
  auto bytes = *read_file(path);
  std::memcpy(bytes.data(), "solid box", 9);
  EXPECT_EQ(parse_mesh(bytes, "stl", 1, "b.stl")->triangles.size(), 12U);
  bytes.resize(bytes.size() - 30);
  bytes[0] = std::byte{'x'};
  EXPECT_EQ(parse_mesh(bytes, "stl", 1, "b.stl").error().text,
            "mesh b.stl: is truncated: it says 12 triangles and holds 11; copy or export it again");
}

TEST(Mesh, ObjCornersMayNameTextureAndNormalAndCountBackwards) {
  const std::string text =
      "mtllib x.mtl\nv 0 0 0\nv 1 0 0 0.5 0.5 0.5\nv 0 1 0\nvn 0 0 1\nvt 0 0\nf 1/1 2//1 3/1/1\nv 0 0 1\nf -1 -2 -3\n";
  const auto mesh = parse_mesh(std::as_bytes(std::span(text)), "obj", 1, "t.obj");
  ASSERT_TRUE(mesh) << mesh.error().text;
  EXPECT_EQ(mesh->triangles.size(), 2U);
  EXPECT_EQ(mesh->vertices_mm.size(), 4U);
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
  const auto obj = [&](const std::string& content) { return text(written("wrong.obj", content)); };
  EXPECT_NE(obj("v 0 0 0\nf 1 2 3\n").find("line 2: a face names a vertex that is not there"), std::string::npos);
  EXPECT_NE(obj("v 0 zero 0\n").find("line 1: a vertex needs three numbers"), std::string::npos);
  EXPECT_NE(text(written("cut.ply", "ply\nformat ascii 1.0\nelement vertex 2\n")).find("truncated"), std::string::npos);
  EXPECT_NE(text(written("wrong.ply",
                         "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float "
                         "z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n3 0 0 1\n"))
                .find("face 0 names a vertex that is not there"),
            std::string::npos);
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
