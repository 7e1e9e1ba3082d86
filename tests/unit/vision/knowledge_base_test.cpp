#include "vision/knowledge_base.hpp"

#include <cstring>
#include <gtest/gtest.h>

#include "tests/unit/vision/shapes.hpp"
#include "vision/file.hpp"
#include "vision/knowledge_base_impl.hpp"

namespace binpick::vision {
namespace {
using Kind = KnowledgeBaseError::Kind;
using Bytes = std::vector<std::byte>;

const KnowledgeBase& small_base() {
  static const KnowledgeBase base = [] {
    PartOptions options;
    options.name = "bracket";
    options.rotations = 40;
    return train(shapes::l_shape(), options, {}, nullptr, 1).value();
  }();
  return base;
}

const Bytes& file() {
  static const Bytes bytes = [] {
    const std::string path = testing::TempDir() + "small.kb";
    EXPECT_TRUE(small_base().save(path));
    return *read_file(path);
  }();
  return bytes;
}

/// Length and checksum made right again: what remains is what the content itself says.
Bytes forged(Bytes bytes) {
  const std::uint64_t length = bytes.size();
  std::memcpy(bytes.data() + kKnowledgeBaseLengthAt, &length, 8);
  const std::uint64_t sum = knowledge_base_checksum(bytes);
  std::memcpy(bytes.data() + kKnowledgeBaseChecksumAt, &sum, 8);
  return bytes;
}

TEST(KnowledgeBase, ComesBackWholeFromItsFile) {
  const auto opened = KnowledgeBase::parse(file(), "small.kb");
  ASSERT_TRUE(opened) << opened.error().text;
  const auto &a = small_base().impl(), &b = opened->impl();
  EXPECT_EQ(opened->part_name(), "bracket");
  EXPECT_EQ(a.mesh_hash, mesh_hash(b.mesh));
  EXPECT_EQ(a.pixel_mm, b.pixel_mm);
  EXPECT_EQ(a.feature_tolerance_mm, b.feature_tolerance_mm);
  EXPECT_EQ(a.symmetry.kind, b.symmetry.kind);
  EXPECT_EQ(a.symmetry.centre_mm, b.symmetry.centre_mm);
  EXPECT_EQ(a.offsets, b.offsets);
  ASSERT_EQ(a.views.size(), b.views.size());
  for (std::size_t i = 0; i < a.views.size(); ++i) {
    EXPECT_EQ(a.views[i].R_supply_object.coeffs(), b.views[i].R_supply_object.coeffs());
    EXPECT_EQ(a.views[i].anchors_object_mm, b.views[i].anchors_object_mm);
    EXPECT_EQ(a.views[i].edges_mm, b.views[i].edges_mm);
    EXPECT_EQ(a.views[i].surface.size(), b.views[i].surface.size());
  }
  EXPECT_EQ(std::memcmp(a.votes.data(), b.votes.data(), a.votes.size() * sizeof(Vote)), 0);
  // What comes back is written as it was.
  const std::string path = testing::TempDir() + "again.kb";
  ASSERT_TRUE(opened->save(path));
  EXPECT_EQ(*read_file(path), file());
  EXPECT_EQ(knowledge_base_bytes(a), file().size());
}

TEST(KnowledgeBase, EveryTruncationIsNamed) {
  for (std::size_t n = 0; n < file().size(); n += n < 200 ? 1 : 16'411) {
    const auto opened = KnowledgeBase::parse(std::span(file()).first(n), "cut.kb");
    ASSERT_FALSE(opened) << n;
    EXPECT_EQ(opened.error().kind, n == 0 ? Kind::NotAKnowledgeBase : Kind::Truncated) << n;
    if (n >= 32) {
      EXPECT_EQ(opened.error().text, "knowledge base cut.kb: is truncated: " + std::to_string(n) + " of " +
                                         std::to_string(file().size()) + " bytes; copy or train it again");
    }
  }
}

TEST(KnowledgeBase, EveryFlippedByteIsSeen) {
  Bytes bytes = file();
  for (std::size_t i = 0; i < bytes.size(); i += i < 300 ? 1 : 12'007) {
    for (const auto mask : {std::byte{0x01}, std::byte{0xFF}}) {
      bytes[i] ^= mask;
      EXPECT_FALSE(KnowledgeBase::parse(bytes, "flipped.kb")) << i;
      bytes[i] ^= mask;
    }
  }
  bytes[bytes.size() / 2] ^= std::byte{4};
  EXPECT_EQ(KnowledgeBase::parse(bytes, "f.kb").error().kind, Kind::Checksum);
  EXPECT_EQ(KnowledgeBase::parse(bytes, "f.kb").error().text,
            "knowledge base f.kb: is damaged: its checksum is wrong; copy or train it again");
}

TEST(KnowledgeBase, OtherFilesAndVersionsAreNamed) {
  Bytes bytes = file();
  bytes[8] = std::byte{9};
  const auto newer = KnowledgeBase::parse(forged(bytes), "new.kb");
  EXPECT_EQ(newer.error().kind, Kind::Version);
  EXPECT_EQ(newer.error().text,
            "knowledge base new.kb: has version 9, this program reads version 1; train the part again");
  const std::string text = "solid part\n facet normal 0 0 1\n   outer loop\n";
  EXPECT_EQ(KnowledgeBase::parse(std::as_bytes(std::span(text)), "x.stl").error().kind, Kind::NotAKnowledgeBase);
  const auto absent = KnowledgeBase::open("/nowhere/x.kb");
  EXPECT_EQ(absent.error().kind, Kind::CannotOpen);
  EXPECT_EQ(absent.error().text,
            "knowledge base: cannot read /nowhere/x.kb: No such file or directory; check the path and its permissions");
}

TEST(KnowledgeBase, AForgedChecksumStillOpensNoFalseIndex) {
  // Each aligned word of the small lists and of the index set to a huge number, checksum made right: refused, or open
  // and then sound. Nothing is read past an end (the sanitizers watch).
  const Bytes& good = file();
  std::size_t opened = 0, tried = 0;
  for (std::size_t at = 32; at + 4 <= good.size(); at += at < 1200 ? 4 : 65'540) {
    Bytes bytes = good;
    std::memset(bytes.data() + at, 0xFF, 4);
    ++tried;
    const auto base = KnowledgeBase::parse(forged(bytes), "forged.kb");
    if (!base) continue;
    ++opened;
    for (const Vote& vote : base->impl().votes) ASSERT_LT(vote.rotation, base->impl().views.size());
    for (const auto& t : base->impl().mesh.triangles)
      for (const std::uint32_t v : t) ASSERT_LT(v, base->impl().mesh.vertices_mm.size());
    ASSERT_EQ(base->impl().offsets.back(), base->impl().votes.size());
  }
  EXPECT_LT(opened, tried / 2);
}
}  // namespace
}  // namespace binpick::vision
