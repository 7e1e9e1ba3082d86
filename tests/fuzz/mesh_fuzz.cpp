#include <cmath>
#include <cstdlib>
#include <span>

#include "vision/mesh.hpp"

/// The first byte chooses the format, the rest is the file: a mesh that can be measured, or a message.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  if (size == 0) return 0;
  static const char* const kFormats[] = {"stl", "obj", "ply"};
  const auto mesh =
      binpick::vision::parse_mesh(std::as_bytes(std::span(bytes + 1, size - 1)), kFormats[bytes[0] % 3], 1, "fuzz");
  if (!mesh) {
    if (mesh.error().text.empty()) std::abort();
    return 0;
  }
  if (mesh->triangles.empty()) std::abort();
  for (const auto& triangle : mesh->triangles)
    for (const std::uint32_t v : triangle)
      if (v >= mesh->vertices_mm.size()) std::abort();
  if (std::isnan(mesh->diameter_mm())) std::abort();
  static_cast<void>(binpick::vision::mesh_hash(*mesh));
  return 0;
}
