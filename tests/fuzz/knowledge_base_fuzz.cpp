#include <cstdlib>
#include <span>
#include <vector>

#include "vision/knowledge_base_impl.hpp"

namespace {
using namespace binpick::vision;

/// A small but whole file: one triangle, one view, one vote.
std::vector<std::byte> good_file() {
  TrainedPart part;
  part.part_name = "triangle";
  part.diameter_mm = 10;
  part.mesh.vertices_mm = {{0, 0, 0}, {10, 0, 0}, {0, 5, 0}};
  part.mesh.triangles = {{0, 1, 2}};
  TrainedView view;
  view.R_supply_object.setIdentity();
  view.anchors_object_mm = {{1, 1, 0}};
  view.surface = {{{0, 0, 0}, {0, 0, 1}}};
  view.edges_mm = {{1, 0, 0}};
  part.views = {view};
  part.offsets.assign(kFeatureCount + 1, 1);
  part.offsets[0] = 0;
  part.votes = {Vote{}};
  std::vector<std::byte> bytes = encoded(part);
  const auto base = KnowledgeBase::parse(bytes, "good");
  if (!base || !base->verify()) std::abort();
  return bytes;
}

/// Every list from end to end, as detection may read it; opened alone, its numbers may still be anything.
float sum_of(const KnowledgeBase& base) {
  const auto& part = base.impl();
  float sum = 0;
  for (std::size_t f = 0; f < kFeatureCount; ++f)
    for (std::uint32_t k = part.offsets[f]; k < part.offsets[f + 1]; ++k) sum += static_cast<float>(part.votes[k].dz);
  for (const auto& triangle : part.mesh.triangles)
    for (const std::uint32_t v : triangle) {
      if (!part.mesh.vertices_mm.at(v).allFinite()) std::abort();
      sum += part.mesh.vertices_mm[v].x();
    }
  for (const auto& view : part.views) {
    sum += view.anchors_object_mm.front().x();
    for (const auto& p : view.anchors_object_mm) sum += p.sum();
    for (const auto& p : view.edges_mm) sum += p.sum();
    for (const auto& sample : view.surface) sum += sample.p_mm.sum() + sample.normal.sum();
  }
  return sum;
}

void use(const KnowledgeBase& base) {
  volatile float sink = sum_of(base);
  static_cast<void>(sink);
  if (!base.verify()) return;
  const auto& part = base.impl();
  for (const Vote& vote : part.votes)
    if (vote.rotation >= part.views.size()) std::abort();
  for (const auto& view : part.views)
    for (const auto& p : view.anchors_object_mm)
      if (!p.allFinite()) std::abort();
}
}  // namespace

/// Once as it is; once as changes (place, byte) to a good file whose length and checksums are then made right again, so
/// that the content itself is tried and not only its seal.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  if (const auto base = KnowledgeBase::parse(std::as_bytes(std::span(bytes, size)), "fuzz.kb")) use(*base);
  static const std::vector<std::byte> good = good_file();
  static std::vector<std::byte> file = good;
  std::vector<std::size_t> changed;
  for (std::size_t i = 0; i + 2 < size; i += 3) {
    const std::size_t place = (static_cast<std::size_t>(bytes[i]) << 8 | bytes[i + 1]) % file.size();
    file[place] = static_cast<std::byte>(bytes[i + 2]);
    changed.push_back(place);
  }
  seal_knowledge_base(file);
  if (const auto base = KnowledgeBase::parse(file, "forged.kb")) use(*base);
  for (const std::size_t place : changed) file[place] = good[place];
  return 0;
}
