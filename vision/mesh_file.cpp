#include "vision/mesh_file.hpp"

#include <charconv>
#include <cstdint>
#include <optional>

#include "vision/ply.hpp"
#include "vision/text_reader.hpp"

namespace binpick::vision {
namespace {
constexpr std::size_t kStlTitleBytes = 80, kStlTriangleBytes = 50;

Expected<Mesh, std::string> read_binary_stl(TextReader& reader, std::uint32_t count) {
  Mesh mesh;
  mesh.vertices_mm.reserve(3 * std::size_t{count});
  mesh.triangles.reserve(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    reader.skip(12);  // The normal: the order of the corners says it better.
    for (int k = 0; k < 3; ++k) {
      const auto x = reader.raw<float>(), y = reader.raw<float>(), z = reader.raw<float>();
      if (!x || !y || !z) return unexpected(std::string("is truncated; copy or export it again"));
      mesh.vertices_mm.emplace_back(*x, *y, *z);
    }
    mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    reader.skip(2);
  }
  return mesh;
}

Expected<Mesh, std::string> read_ascii_stl(TextReader& reader) {
  Mesh mesh;
  std::uint32_t corners = 0;  // Of the loop that is open.
  for (int line_number = 1;; ++line_number) {
    const auto line = reader.line(true);
    if (!line) break;
    const auto words = words_of(*line);
    if (words.empty()) continue;
    const auto bad = [&](const std::string& why) {
      return unexpected("line " + std::to_string(line_number) + ": " + why + "; export it again");
    };
    if (words[0] == "vertex") {
      if (words.size() < 4) return bad("a vertex needs three numbers");
      const auto x = number_of(words[1]), y = number_of(words[2]), z = number_of(words[3]);
      if (!x || !y || !z) return bad("a vertex needs three numbers");
      mesh.vertices_mm.emplace_back(Eigen::Vector3d(*x, *y, *z).cast<float>());
      ++corners;
      const auto last = static_cast<std::uint32_t>(mesh.vertices_mm.size() - 1);
      if (corners >= 3) mesh.triangles.push_back({last + 1 - corners, last - 1, last});
    } else if (words[0] == "endloop" || words[0] == "facet") {
      corners = 0;
    }
  }
  return mesh;
}

/// The vertex that a corner like "7", "7/2", "7//3" or "-1" names.
std::optional<std::uint32_t> corner_of(std::string_view word, std::size_t vertices) {
  word = word.substr(0, word.find('/'));
  std::int64_t index = 0;
  const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), index);
  if (error != std::errc() || stop != word.data() + word.size()) return std::nullopt;
  const auto count = static_cast<std::int64_t>(vertices);
  if (index < 0) index += count + 1;
  if (index < 1 || index > count) return std::nullopt;
  return static_cast<std::uint32_t>(index - 1);
}
}  // namespace

Expected<Mesh, std::string> read_stl(std::span<const std::byte> bytes) {
  TextReader reader(bytes);
  reader.skip(kStlTitleBytes);
  const auto count = reader.raw<std::uint32_t>();
  const std::size_t wanted = count ? std::size_t{*count} * kStlTriangleBytes : 0;
  if (count && reader.left() == wanted) return read_binary_stl(reader, *count);
  TextReader text(bytes);
  if (text.word() == "solid") {
    TextReader whole(bytes);
    return read_ascii_stl(whole);
  }
  if (!count) return unexpected(std::string("is too short for an STL file; export it again"));
  if (reader.left() < wanted)
    return unexpected("is truncated: it says " + std::to_string(*count) + " triangles and holds " +
                      std::to_string(reader.left() / kStlTriangleBytes) + "; copy or export it again");
  return read_binary_stl(reader, *count);  // Some programs write more behind the triangles.
}

Expected<Mesh, std::string> read_obj(std::span<const std::byte> bytes) {
  TextReader reader(bytes);
  Mesh mesh;
  for (int line_number = 1;; ++line_number) {
    const auto line = reader.line(true);
    if (!line) break;
    const auto words = words_of(*line);
    if (words.empty()) continue;
    const auto bad = [&](const std::string& why) {
      return unexpected("line " + std::to_string(line_number) + ": " + why + "; export it again");
    };
    if (words[0] == "v") {
      if (words.size() < 4) return bad("a vertex needs three numbers");
      const auto x = number_of(words[1]), y = number_of(words[2]), z = number_of(words[3]);
      if (!x || !y || !z) return bad("a vertex needs three numbers");
      mesh.vertices_mm.emplace_back(Eigen::Vector3d(*x, *y, *z).cast<float>());
    } else if (words[0] == "f") {
      std::uint32_t first = 0, before = 0;
      for (std::size_t i = 1; i < words.size(); ++i) {
        const auto corner = corner_of(words[i], mesh.vertices_mm.size());
        if (!corner) return bad("a face names a vertex that is not there");
        if (i == 1) first = *corner;
        if (i >= 3) mesh.triangles.push_back({first, before, *corner});
        before = *corner;
      }
    }
  }
  return mesh;
}

Expected<Mesh, std::string> read_ply_mesh(std::span<const std::byte> bytes) {
  auto ply = parse_ply(bytes, true);
  if (!ply) return unexpected(ply.error());
  Mesh mesh;
  mesh.vertices_mm = std::move(ply->vertices);
  mesh.triangles = std::move(ply->triangles);
  return mesh;
}
}  // namespace binpick::vision
