#include "vision/knowledge_base.hpp"

#include <algorithm>
#include <cstring>

#include "vision/knowledge_base_file.hpp"

namespace binpick::vision {
namespace {
using Kind = KnowledgeBaseError::Kind;

tl::unexpected<KnowledgeBaseError> failed(Kind kind, const std::string& name, const std::string& why) {
  return unexpected(KnowledgeBaseError{kind, "knowledge base " + name + ": " + why});
}

template <class T>
T item_at(std::span<const std::byte> file, std::size_t at) {
  T value{};
  std::memcpy(&value, file.data() + at, sizeof value);
  return value;
}

Expected<void, KnowledgeBaseError> verdict_on(const KnowledgeBase::Impl& part) {
  const std::span<const std::byte> bytes = part.file.bytes;
  if (knowledge_base_checksum(bytes) != item_at<std::uint64_t>(bytes, kKnowledgeBaseChecksumAt))
    return failed(Kind::Checksum, part.name, "is damaged: its checksum is wrong; copy or train it again");
  if (!sound_lists(part))
    return failed(Kind::Checksum, part.name, "is damaged: its content contradicts itself; train the part again");
  return {};
}
}  // namespace

Expected<KnowledgeBase, KnowledgeBaseError> open_knowledge_base(FileBytes file, const std::string& name) {
  const std::span<const std::byte> bytes = file.bytes;
  constexpr std::string_view kMagic = "BINPICKB";
  const std::size_t compared = std::min(bytes.size(), kMagic.size());
  if (bytes.empty() || std::memcmp(bytes.data(), kMagic.data(), compared) != 0)
    return failed(Kind::NotAKnowledgeBase, name, "is not a knowledge base; make one with binpick train");
  const auto truncated = [&](const std::string& how) {
    return failed(Kind::Truncated, name, "is truncated: " + how + "; copy or train it again");
  };
  constexpr std::size_t kVersionEnd = 12;
  const auto version = bytes.size() < kVersionEnd ? kKnowledgeBaseVersion : item_at<std::uint32_t>(bytes, 8);
  if (version != kKnowledgeBaseVersion)
    return failed(Kind::Version, name,
                  "has version " + std::to_string(version) + ", this program reads version " +
                      std::to_string(kKnowledgeBaseVersion) + "; train the part again");
  if (bytes.size() < kKnowledgeBaseHeaderBytes)
    return truncated(std::to_string(bytes.size()) + " bytes, its header alone has " +
                     std::to_string(kKnowledgeBaseHeaderBytes));
  const auto length = item_at<std::uint64_t>(bytes, kKnowledgeBaseLengthAt);
  if (bytes.size() < length)
    return truncated(std::to_string(bytes.size()) + " of " + std::to_string(length) + " bytes");
  const auto index_end = item_at<std::uint64_t>(bytes, kKnowledgeBaseIndexEndAt);
  if (bytes.size() > length || index_end < kKnowledgeBaseHeaderBytes || index_end > length ||
      knowledge_base_index_checksum(bytes.first(index_end)) !=
          item_at<std::uint64_t>(bytes, kKnowledgeBaseIndexChecksumAt))
    return failed(Kind::Checksum, name, "is damaged: its checksum is wrong; copy or train it again");
  auto part = std::make_shared<KnowledgeBase::Impl>();
  part->file = std::move(file);
  part->name = name;
  if (!read_index(*part))
    return failed(Kind::Checksum, name, "is damaged: its content contradicts itself; train the part again");
  return KnowledgeBase(std::move(part));
}

Expected<KnowledgeBase, KnowledgeBaseError> KnowledgeBase::open(const std::string& path) {
  auto file = map_file(path);
  if (!file) return unexpected(KnowledgeBaseError{Kind::CannotOpen, "knowledge base: " + file.error()});
  return open_knowledge_base(std::move(*file), path);
}

Expected<KnowledgeBase, KnowledgeBaseError> KnowledgeBase::parse(std::span<const std::byte> bytes,
                                                                 const std::string& name) {
  return open_knowledge_base(kept({bytes.begin(), bytes.end()}), name);
}

Expected<void, KnowledgeBaseError> KnowledgeBase::verify() const {
  std::call_once(impl_->verify_once, [&] { impl_->verdict = verdict_on(*impl_); });
  return impl_->verdict;
}

Expected<void, KnowledgeBaseError> KnowledgeBase::save(const std::string& path) const {
  if (const auto written = write_file(path, impl_->file.bytes); !written)
    return unexpected(KnowledgeBaseError{Kind::CannotOpen, "knowledge base: " + written.error()});
  return {};
}

KnowledgeBase::KnowledgeBase(std::shared_ptr<const Impl> impl) : impl_{std::move(impl)} {}
std::uint64_t KnowledgeBase::checksum() const {
  return item_at<std::uint64_t>(impl_->file.bytes, kKnowledgeBaseChecksumAt);
}
const std::string& KnowledgeBase::part_name() const { return impl_->part_name; }
const Mesh& KnowledgeBase::mesh() const { return impl_->mesh; }
const Symmetry& KnowledgeBase::symmetry() const { return impl_->symmetry; }
std::uint64_t KnowledgeBase::mesh_hash() const { return impl_->mesh_hash; }
ScannerClass KnowledgeBase::scanner() const { return impl_->scanner; }
double KnowledgeBase::pixel_mm() const { return impl_->pixel_mm; }
double KnowledgeBase::noise_mm() const { return impl_->noise_mm; }
double KnowledgeBase::diameter_mm() const { return impl_->diameter_mm; }
}  // namespace binpick::vision
