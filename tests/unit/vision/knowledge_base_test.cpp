#include "vision/knowledge_base.hpp"

#include <algorithm>
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

/// Length and checksums made right again: what remains is what the content itself says.
Bytes forged(Bytes bytes) {
  seal_knowledge_base(bytes);
  return bytes;
}

std::uint64_t index_end() {
  std::uint64_t end = 0;
  std::memcpy(&end, file().data() + kKnowledgeBaseIndexEndAt, 8);
  return end;
}

/// Opened and verified.
Expected<void, KnowledgeBaseError> whole(const Bytes& bytes) {
  const auto opened = KnowledgeBase::parse(bytes, "f.kb");
  if (!opened) return unexpected(opened.error());
  return opened->verify();
}

/// Reads each list from end to end: the sanitizers watch where.
float sum_of(const KnowledgeBase& base) {
  float sum = 0;
  for (const View& view : base.impl().views) {
    for (const auto& p : view.anchors_object_mm) sum += p.sum();
    for (const auto& s : view.surface) sum += s.p_mm.sum() + s.normal.sum();
    for (const auto& p : view.edges_mm) sum += p.sum();
  }
  for (std::size_t f = 0; f < kFeatureCount; ++f)
    for (std::uint32_t k = base.impl().offsets[f]; k < base.impl().offsets[f + 1]; ++k)
      sum += static_cast<float>(base.impl().votes[k].dz);
  for (const auto& t : base.mesh().triangles)
    for (const std::uint32_t v : t) sum += base.mesh().vertices_mm[v].x();
  return sum;
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
  EXPECT_TRUE(std::ranges::equal(a.offsets, b.offsets));
  ASSERT_EQ(a.views.size(), b.views.size());
  for (std::size_t i = 0; i < a.views.size(); ++i) {
    EXPECT_EQ(a.views[i].R_supply_object.coeffs(), b.views[i].R_supply_object.coeffs());
    EXPECT_TRUE(std::ranges::equal(a.views[i].anchors_object_mm, b.views[i].anchors_object_mm));
    EXPECT_TRUE(std::ranges::equal(a.views[i].edges_mm, b.views[i].edges_mm));
    EXPECT_EQ(a.views[i].surface.size(), b.views[i].surface.size());
    float weight = 0;
    for (const Vote& vote : b.votes) weight += vote.rotation == i ? static_cast<float>(vote.weight) : 0;
    EXPECT_EQ(b.views[i].vote_weight, weight);
  }
  EXPECT_EQ(sum_of(small_base()), sum_of(*opened));
  EXPECT_TRUE(opened->verify());
  EXPECT_EQ(std::memcmp(a.votes.data(), b.votes.data(), a.votes.size() * sizeof(Vote)), 0);
  // What comes back is written as it was.
  const std::string path = testing::TempDir() + "again.kb";
  ASSERT_TRUE(opened->save(path));
  EXPECT_EQ(*read_file(path), file());
}

TEST(KnowledgeBase, IsUsedWhereItsFileIsMapped) {
  const std::string path = testing::TempDir() + "mapped.kb";
  ASSERT_TRUE(small_base().save(path));
  const auto mapped = KnowledgeBase::open(path);
  ASSERT_TRUE(mapped) << mapped.error().text;
  const auto& part = mapped->impl();
  const auto* first = part.file.bytes.data();
  const auto* last = first + part.file.bytes.size();
  const auto inside = [&](const auto& list) {
    const auto bytes = std::as_bytes(list);
    return bytes.data() >= first && bytes.data() + bytes.size() <= last;
  };
  EXPECT_TRUE(inside(part.votes) && inside(part.views.back().surface));
  // A newly trained file takes the old one's name; who has the old one open keeps it.
  PartOptions options;
  options.rotations = 10;
  ASSERT_TRUE(train(shapes::l_shape(), options, {}, nullptr, 1)->save(path));
  EXPECT_TRUE(mapped->verify());
  EXPECT_EQ(sum_of(*mapped), sum_of(small_base()));
}

TEST(KnowledgeBase, EveryTruncationIsNamed) {
  for (std::size_t n = 0; n < file().size(); n += n < 200 ? 1 : 16'411) {
    const auto opened = KnowledgeBase::parse(std::span(file()).first(n), "cut.kb");
    ASSERT_FALSE(opened) << n;
    EXPECT_EQ(opened.error().kind, n == 0 ? Kind::NotAKnowledgeBase : Kind::Truncated) << n;
    if (n >= 224) {
      EXPECT_EQ(opened.error().text, "knowledge base cut.kb: is truncated: " + std::to_string(n) + " of " +
                                         std::to_string(file().size()) + " bytes; copy or train it again");
    }
  }
}

TEST(KnowledgeBase, EveryFlippedByteIsSeenThoseOfTheIndexAtOpening) {
  Bytes bytes = file();
  for (std::size_t i = 0; i < bytes.size(); i += i < 900 ? 1 : 12'007) {
    for (const auto mask : {std::byte{0x01}, std::byte{0xFF}}) {
      bytes[i] ^= mask;
      const bool of_whole_sum = i >= kKnowledgeBaseChecksumAt && i < kKnowledgeBaseChecksumAt + 8;
      if (const auto opened = KnowledgeBase::parse(bytes, "flipped.kb")) {
        EXPECT_TRUE(i >= index_end() || of_whole_sum) << i;
        EXPECT_FALSE(opened->verify()) << i;
      }
      bytes[i] ^= mask;
    }
  }
  bytes[bytes.size() - 1] ^= std::byte{4};
  const auto opened = KnowledgeBase::parse(bytes, "f.kb");
  ASSERT_TRUE(opened);
  EXPECT_EQ(opened->verify().error().kind, Kind::Checksum);
  EXPECT_EQ(opened->verify().error().text,
            "knowledge base f.kb: is damaged: its checksum is wrong; copy or train it again");
  bytes[index_end() - 1] ^= std::byte{4};
  EXPECT_EQ(KnowledgeBase::parse(bytes, "f.kb").error().kind, Kind::Checksum);
}

TEST(KnowledgeBase, OtherFilesAndVersionsAreNamed) {
  Bytes bytes = file();
  bytes[8] = std::byte{9};
  const auto newer = KnowledgeBase::parse(forged(bytes), "new.kb");
  EXPECT_EQ(newer.error().kind, Kind::Version);
  EXPECT_EQ(newer.error().text,
            "knowledge base new.kb: has version 9, this program reads version 3; train the part again");
  const std::string text = "solid part\n facet normal 0 0 1\n   outer loop\n";
  EXPECT_EQ(KnowledgeBase::parse(std::as_bytes(std::span(text)), "x.stl").error().kind, Kind::NotAKnowledgeBase);
  const auto absent = KnowledgeBase::open("/nowhere/x.kb");
  EXPECT_EQ(absent.error().kind, Kind::CannotOpen);
  EXPECT_EQ(absent.error().text,
            "knowledge base: cannot read /nowhere/x.kb: No such file or directory; check the path and its permissions");
}

TEST(KnowledgeBase, ForgedChecksumsStillOpenNoFalsePlace) {
  // Each aligned word of the header, of the small lists and here and there of the long ones set to a huge number,
  // checksums made right: refused, or readable from end to end.
  const Bytes& good = file();
  std::size_t opened = 0, tried = 0;
  for (std::size_t at = 32; at + 4 <= good.size(); at += at < 5000 ? 4 : 65'540) {
    Bytes bytes = good;
    std::memset(bytes.data() + at, 0xFF, 4);
    ++tried;
    const auto base = KnowledgeBase::parse(forged(bytes), "forged.kb");
    if (!base) continue;
    ++opened;
    static_cast<void>(sum_of(*base));
    if (!base->verify()) continue;
    for (const Vote& vote : base->impl().votes) ASSERT_LT(vote.rotation, base->impl().views.size());
  }
  EXPECT_LT(opened, tried / 2);
  // A vote for a view that is not there opens, as votes are not looked at, and is found by verify().
  Bytes bytes = good;
  std::memset(bytes.data() + bytes.size() - 4, 0xFF, 2);
  EXPECT_TRUE(KnowledgeBase::parse(forged(bytes), "forged.kb"));
  EXPECT_EQ(whole(forged(bytes)).error().text,
            "knowledge base f.kb: is damaged: its content contradicts itself; train the part again");
}
}  // namespace
}  // namespace binpick::vision
