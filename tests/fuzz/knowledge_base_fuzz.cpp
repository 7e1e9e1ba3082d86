#include <cstdlib>
#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <unistd.h>
#include <vector>

#include "vision/file.hpp"
#include "vision/knowledge_base_impl.hpp"

namespace {
using namespace binpick::vision;

/// A small but whole file: one triangle, one view, one vote.
std::vector<std::byte> good_file() {
  auto part = std::make_shared<KnowledgeBase::Impl>();
  part->part_name = "triangle";
  part->diameter_mm = 10;
  part->mesh.vertices_mm = {{0, 0, 0}, {10, 0, 0}, {0, 5, 0}};
  part->mesh.triangles = {{0, 1, 2}};
  View view;
  view.R_supply_object.setIdentity();
  view.anchors_object_mm = {{1, 1, 0}};
  view.surface = {{{0, 0, 0}, {0, 0, 1}}};
  view.edges_mm = {{1, 0, 0}};
  part->views = {view};
  part->offsets.assign(kFeatureCount + 1, 1);
  part->offsets[0] = 0;
  part->votes = {Vote{}};
  const std::string path = "/tmp/binpick_fuzz_" + std::to_string(::getpid()) + ".kb";
  if (!KnowledgeBase(part).save(path)) std::abort();
  auto bytes = read_file(path);
  ::unlink(path.c_str());
  if (!bytes || !KnowledgeBase::parse(*bytes, "good")) std::abort();
  return *bytes;
}

void use(const KnowledgeBase& base) {
  const auto& part = base.impl();
  for (std::size_t f = 0; f < kFeatureCount; ++f)
    for (std::uint32_t k = part.offsets[f]; k < part.offsets[f + 1]; ++k)
      if (part.votes[k].rotation >= part.views.size()) std::abort();
  for (const auto& triangle : part.mesh.triangles)
    for (const std::uint32_t v : triangle)
      if (!part.mesh.vertices_mm.at(v).allFinite()) std::abort();
  for (const auto& view : part.views)
    if (!view.anchors_object_mm.at(0).allFinite()) std::abort();
}
}  // namespace

/// Once as it is; once as changes (place, byte) to a good file whose length and checksum are then made right again, so
/// that the content itself is tried and not only its seal.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  if (const auto base = KnowledgeBase::parse(std::as_bytes(std::span(bytes, size)), "fuzz.kb")) use(*base);
  static const std::vector<std::byte> good = good_file();
  static std::vector<std::byte> file = good;
  // The long list of offsets lies between what is worth changing: places count from both ends.
  constexpr std::size_t kEnd = 1024;
  std::vector<std::size_t> changed;
  for (std::size_t i = 0; i + 2 < size; i += 3) {
    const std::size_t from = (static_cast<std::size_t>(bytes[i]) << 8 | bytes[i + 1]) % (2 * kEnd);
    const std::size_t place = from < kEnd ? from : file.size() - 2 * kEnd + from;
    file[place] = static_cast<std::byte>(bytes[i + 2]);
    changed.push_back(place);
  }
  const std::uint64_t length = file.size();
  std::memcpy(file.data() + kKnowledgeBaseLengthAt, &length, 8);
  const std::uint64_t sum = knowledge_base_checksum(file);
  std::memcpy(file.data() + kKnowledgeBaseChecksumAt, &sum, 8);
  if (const auto base = KnowledgeBase::parse(file, "forged.kb")) use(*base);
  for (const std::size_t place : changed) file[place] = good[place];
  return 0;
}
