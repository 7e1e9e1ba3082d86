#pragma once

#include <memory>

#include "vision/knowledge_base_impl.hpp"

/// The format of the file, all little-endian:
///   8 bytes "BINPICKB", u32 version, u32 zero, u64 length of the file, u64 checksum of the whole file but these eight
///   bytes, u64 end of the index, u64 checksum of the index but these two;
///   for each section its place (u64, a multiple of 64) and its number of items (u64);
///   the sections, items of fixed width. Those before Anchors are the index.
namespace binpick::vision {
enum class Section { Facts, Name, Vertices, Triangles, Symmetry, Views, Features, Anchors, Surface, Edges, Votes };
inline constexpr std::size_t kSections = 11;
inline constexpr std::size_t kSectionsAt = 48;
inline constexpr std::size_t kSectionAlignment = 64;
inline constexpr std::size_t kKnowledgeBaseHeaderBytes = kSectionsAt + 16 * kSections;
inline constexpr std::uint32_t kKnowledgeBaseVersion = 3;

std::uint64_t knowledge_base_checksum(std::span<const std::byte> file);
std::uint64_t knowledge_base_index_checksum(std::span<const std::byte> index);

/// Fills `part` from its `file`, whose header and checksum of the index are right. Whether every place and number of
/// the index can be trusted: a checksum can be forged, or be that of another mistake.
bool read_index(KnowledgeBase::Impl& part);
/// Whether the same holds for the lists behind the index.
bool sound_lists(const KnowledgeBase::Impl& part);
}  // namespace binpick::vision
