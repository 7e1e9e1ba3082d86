#include "vision/cloud.hpp"

#include <cstring>
#include <gtest/gtest.h>

namespace binpick::vision {
namespace {
Expected<std::vector<Eigen::Vector3f>, CloudError> parse(const std::string& text) {
  return parse_cloud(std::as_bytes(std::span(text)), "t.ply");
}
std::string error_of(const std::string& text) {
  const auto cloud = parse(text);
  return cloud ? "no error" : cloud.error().text;
}
template <class T>
void put(std::string& to, T value) {
  to.append(reinterpret_cast<const char*>(&value), sizeof value);
}
constexpr char kXyz[] = "property float x\nproperty float y\nproperty float z\n";

TEST(Cloud, ComesBackAsItWasSaved) {
  const std::vector<Eigen::Vector3f> points = {{1, 2, 3}, {-4.5F, 0, 1e-3F}};
  const std::string path = testing::TempDir() + "cloud.ply";
  ASSERT_TRUE(save_cloud(path, points));
  const auto loaded = load_cloud(path);
  ASSERT_TRUE(loaded) << loaded.error().text;
  EXPECT_EQ(*loaded, points);
}

TEST(Cloud, ReadsAsciiWithOtherPropertiesAndElements) {
  const auto cloud = parse(
      "ply\r\nformat ascii 1.0\r\ncomment hello\r\nelement camera 2\r\nproperty list uchar float pose\r\n"
      "element vertex 3\r\nproperty uchar red\r\nproperty double x\r\nproperty double y\r\nproperty list uchar int "
      "tag\r\n"
      "property double z\r\nelement face 1\r\nproperty list uchar int vertex_indices\r\nend_header\r\n"
      "2 0.5 0.5\r\n0\r\n255 1 2 2 7 7 3\r\n0 nan 0 0 1\r\n1 +4 -5e1 1 9 6\r\n3 0 1 2\r\n");
  ASSERT_TRUE(cloud) << cloud.error().text;
  EXPECT_EQ(*cloud, (std::vector<Eigen::Vector3f>{{1, 2, 3}, {4, -50, 6}}));
}

TEST(Cloud, ReadsBinaryOfMixedTypesAfterAnotherElement) {
  std::string text =
      "ply\nformat binary_little_endian 1.0\nelement face 1\nproperty list uint8 int32 vertex_indices\n"
      "element vertex 2\nproperty int16 intensity\nproperty float64 x\nproperty float32 y\nproperty float "
      "z\nend_header\n";
  put<std::uint8_t>(text, 2);
  put<std::int32_t>(text, 0);
  put<std::int32_t>(text, 1);
  for (int i = 0; i < 2; ++i) {
    put<std::int16_t>(text, 77);
    put<double>(text, 10.0 + i);
    put<float>(text, 20);
    put<float>(text, 30);
  }
  const auto cloud = parse(text);
  ASSERT_TRUE(cloud) << cloud.error().text;
  EXPECT_EQ(*cloud, (std::vector<Eigen::Vector3f>{{10, 20, 30}, {11, 20, 30}}));
}

TEST(Cloud, EveryTruncationIsAnErrorAndNeverRead) {
  std::string text = std::string("ply\nformat binary_little_endian 1.0\nelement vertex 3\n") + kXyz + "end_header\n";
  for (int i = 0; i < 9; ++i) put<float>(text, 1);
  ASSERT_TRUE(parse(text));
  for (std::size_t n = 0; n < text.size(); ++n) EXPECT_FALSE(parse(text.substr(0, n))) << n;
}

TEST(Cloud, SaysWhatIsWrong) {
  const std::string ascii = "ply\nformat ascii 1.0\n";
  EXPECT_EQ(error_of(""), "cloud t.ply: the file is empty; scan or save it again");
  EXPECT_EQ(error_of("hello\n"), "cloud t.ply: is not a PLY file; save it as PLY");
  EXPECT_EQ(error_of("ply\nformat binary_big_endian 1.0\n"),
            "cloud t.ply: line 2: format binary_big_endian is not read; save it as ascii or binary_little_endian");
  EXPECT_EQ(error_of(ascii + "element vertex 0\n" + kXyz + "end_header\n"), "cloud t.ply: holds no point; scan again");
  EXPECT_EQ(error_of(ascii + "element vertex 2\n" + kXyz + "end_header\nnan nan nan\n1 inf 2\n"),
            "cloud t.ply: holds 2 points, none of them finite; scan again");
  EXPECT_EQ(error_of(ascii + "element vertex 1\nproperty float x\nproperty float y\nend_header\n1 2\n"),
            "cloud t.ply: has no vertex properties x, y, z of type float or double; save them");
  EXPECT_EQ(error_of(ascii + "element vertex 1\nproperty list float int x\nend_header\n"),
            "cloud t.ply: line 4: unknown property type; use float or double for x, y and z");
  EXPECT_EQ(error_of(ascii + "element vertex x\n"),
            "cloud t.ply: line 3: the number of elements is no number; save it again");
  EXPECT_EQ(error_of(ascii + "nonsense\n"), "cloud t.ply: line 3: cannot be understood; save it again as PLY");
  EXPECT_EQ(error_of(ascii + "end_header\n"),
            "cloud t.ply: has no element vertex with properties; save it as PLY with x, y, z");
  EXPECT_EQ(error_of("ply\nend_header\n"), "cloud t.ply: names no format in its header; save it again as PLY");
  EXPECT_EQ(error_of(ascii + "element vertex 9999999999999\n" + kXyz + "end_header\n1 2 3\n"),
            "cloud t.ply: is truncated or damaged: vertex 1 of 9999999999999 cannot be read at byte 118; "
            "copy or save it again");
  EXPECT_NE(load_cloud("/nowhere/c.ply").error().text.find("cannot read /nowhere/c.ply: No such file"),
            std::string::npos);
}
}  // namespace
}  // namespace binpick::vision
