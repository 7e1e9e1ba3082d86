#include "vision/knowledge_base_file.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <numeric>
#include <optional>
#include <type_traits>

namespace binpick::vision {
namespace {
static_assert(std::endian::native == std::endian::little);
static_assert(sizeof(Vote) == 8 && std::is_trivially_copyable_v<Vote>);
static_assert(sizeof(Eigen::Vector3f) == 12 && sizeof(SurfaceSample) == 24);

constexpr std::array<char, 8> kMagic{'B', 'I', 'N', 'P', 'I', 'C', 'K', 'B'};
constexpr std::size_t kViewsMax = 65'536;

struct FactsRecord {
  std::uint32_t scanner, symmetry;
  std::int32_t feature_stride;
  float feature_tolerance_mm;
  std::array<double, 4> pixel_noise_diameter_quantum_mm;
  double rotation_gap_rad;
  std::array<double, 3> symmetry_centre_mm, symmetry_axis;
  std::uint64_t mesh_hash;
};
static_assert(sizeof(FactsRecord) == 112);

struct Run {
  std::uint32_t first, count;
};
struct ViewRecord {
  std::array<float, 4> rotation_xyzw;
  float lowest_mm, area_mm2, vote_weight;
  std::uint32_t zero;
  Run anchors, surface, edges;
};
static_assert(sizeof(ViewRecord) == 56);

/// A feature that has votes; they end before `end` and begin where those of the one before end.
struct FeatureRecord {
  std::uint32_t feature, end;
};

struct SectionRecord {
  std::uint64_t at, count;
};

/// FNV-1a over words of eight bytes: each step maps different states to different states, so that no single changed
/// word, hence no flipped byte, can go unseen. The words at `skipped` count as zero.
std::uint64_t checksum(std::span<const std::byte> bytes, std::initializer_list<std::size_t> skipped) {
  std::uint64_t hash = 0xCBF29CE484222325ULL;
  for (std::size_t at = 0; at < bytes.size(); at += 8) {
    std::uint64_t word = 0;
    if (at > kSectionsAt || std::ranges::find(skipped, at) == skipped.end())
      std::memcpy(&word, bytes.data() + at, std::min<std::size_t>(8, bytes.size() - at));
    hash = (hash ^ word) * 0x9E3779B97F4A7C15ULL;
    hash ^= hash >> 32;
  }
  return hash ^ bytes.size();
}

class Writer {
 public:
  Writer() : bytes_(kKnowledgeBaseHeaderBytes) {
    std::memcpy(bytes_.data(), kMagic.data(), kMagic.size());
    std::memcpy(bytes_.data() + kMagic.size(), &kKnowledgeBaseVersion, 4);
  }
  template <class T>
  void add(Section section, std::span<const T> items) {
    pad();
    const SectionRecord record{bytes_.size(), items.size()};
    std::memcpy(bytes_.data() + kSectionsAt + 16 * static_cast<std::size_t>(section), &record, sizeof record);
    bytes_.resize(bytes_.size() + items.size_bytes());
    if (!items.empty())
      std::memcpy(bytes_.data() + record.at, static_cast<const void*>(items.data()), items.size_bytes());
  }
  template <class T>
  void add(Section section, const std::vector<T>& items) {
    add(section, std::span<const T>(items));
  }
  void end_index() {
    pad();
    const std::uint64_t end = bytes_.size();
    std::memcpy(bytes_.data() + kKnowledgeBaseIndexEndAt, &end, 8);
  }
  std::vector<std::byte> sealed() {
    seal_knowledge_base(bytes_);
    return std::move(bytes_);
  }

 private:
  void pad() { bytes_.resize((bytes_.size() + kSectionAlignment - 1) / kSectionAlignment * kSectionAlignment); }
  std::vector<std::byte> bytes_;
};

/// The section where it lies; nothing when that is not within the part of the file where it belongs.
template <class T>
std::optional<std::span<const T>> section_of(std::span<const std::byte> file, Section section, std::size_t end) {
  SectionRecord record{};
  std::memcpy(&record, file.data() + kSectionsAt + 16 * static_cast<std::size_t>(section), sizeof record);
  if (record.at % kSectionAlignment != 0 || record.at < kKnowledgeBaseHeaderBytes || record.at > end ||
      record.count > (end - record.at) / sizeof(T))
    return std::nullopt;
  return std::span(reinterpret_cast<const T*>(file.data() + record.at), record.count);
}

template <class T>
std::optional<std::span<const T>> part_of(std::span<const T> all, Run run) {
  if (run.first > all.size() || run.count > all.size() - run.first) return std::nullopt;
  return all.subspan(run.first, run.count);
}

bool all_finite(std::span<const Eigen::Vector3f> points) {
  return std::ranges::all_of(points, [](const Eigen::Vector3f& p) { return p.allFinite(); });
}

bool sound(const PartFacts& part) {
  for (const double value : {part.pixel_mm, part.noise_mm, part.diameter_mm, part.dz_quantum_mm, part.rotation_gap_rad})
    if (!(value > 0) || !std::isfinite(value)) return false;
  if (part.feature_stride < 1 || part.feature_stride > 64 || !(part.feature_tolerance_mm > 0)) return false;
  if (part.mesh.triangles.empty() || !all_finite(part.mesh.vertices_mm)) return false;
  for (const auto& triangle : part.mesh.triangles)
    for (const std::uint32_t v : triangle)
      if (v >= part.mesh.vertices_mm.size()) return false;
  const Symmetry& symmetry = part.symmetry;
  return symmetry.centre_mm.allFinite() && std::abs(symmetry.axis.norm() - 1) < 1e-6 && !symmetry.rotations.empty() &&
         std::ranges::all_of(symmetry.rotations, [](const Eigen::Matrix3d& R) { return R.isUnitary(1e-6); });
}

bool sound(const View& view) {
  return view.R_supply_object.coeffs().allFinite() && std::abs(view.R_supply_object.norm() - 1) < 1e-3F &&
         std::isfinite(view.lowest_mm) && std::isfinite(view.area_mm2) && view.vote_weight >= 0 &&
         std::isfinite(view.vote_weight) && !view.anchors_object_mm.empty();
}

bool read_facts(std::span<const std::byte> file, std::size_t index_end, PartFacts& part) {
  const auto facts = section_of<FactsRecord>(file, Section::Facts, index_end);
  const auto name = section_of<char>(file, Section::Name, index_end);
  const auto vertices = section_of<Eigen::Vector3f>(file, Section::Vertices, index_end);
  const auto triangles = section_of<std::array<std::uint32_t, 3>>(file, Section::Triangles, index_end);
  const auto rotations = section_of<std::array<double, 9>>(file, Section::Symmetry, index_end);
  if (!facts || facts->size() != 1 || !name || !vertices || !triangles || !rotations) return false;
  const FactsRecord& record = facts->front();
  if (record.scanner > static_cast<std::uint32_t>(ScannerClass::Lms400) ||
      record.symmetry > static_cast<std::uint32_t>(Symmetry::Kind::Sphere))
    return false;
  part.part_name.assign(name->begin(), name->end());
  part.scanner = static_cast<ScannerClass>(record.scanner);
  part.feature_stride = record.feature_stride;
  part.feature_tolerance_mm = record.feature_tolerance_mm;
  const auto& mm = record.pixel_noise_diameter_quantum_mm;
  part.pixel_mm = mm[0];
  part.noise_mm = mm[1];
  part.diameter_mm = mm[2];
  part.dz_quantum_mm = mm[3];
  part.rotation_gap_rad = record.rotation_gap_rad;
  part.mesh_hash = record.mesh_hash;
  part.mesh.vertices_mm.assign(vertices->begin(), vertices->end());
  part.mesh.triangles.assign(triangles->begin(), triangles->end());
  part.symmetry.kind = static_cast<Symmetry::Kind>(record.symmetry);
  part.symmetry.centre_mm = Eigen::Vector3d(record.symmetry_centre_mm.data());
  part.symmetry.axis = Eigen::Vector3d(record.symmetry_axis.data());
  part.symmetry.rotations.clear();
  for (const auto& columns : *rotations) part.symmetry.rotations.emplace_back(columns.data());
  return sound(part);
}

/// Offsets of all features, those without a vote as well.
bool lay_out(std::span<const FeatureRecord> features, std::size_t votes, std::vector<std::uint32_t>& offsets) {
  offsets.resize(kFeatureCount + 1);
  std::uint32_t begin = 0;
  std::size_t next = 0;  // The feature whose begin is to be written.
  for (const FeatureRecord& record : features) {
    if (record.feature < next || record.feature >= kFeatureCount || record.end <= begin) return false;
    std::fill(offsets.begin() + static_cast<std::ptrdiff_t>(next), offsets.begin() + record.feature + 1, begin);
    next = record.feature + 1;
    begin = record.end;
  }
  std::fill(offsets.begin() + static_cast<std::ptrdiff_t>(next), offsets.end(), begin);
  return begin == votes;
}

std::vector<float> vote_weights(const TrainedPart& part) {
  std::vector<float> weights(part.views.size(), 0);
  for (const Vote& vote : part.votes) weights[vote.rotation] += static_cast<float>(vote.weight);
  return weights;
}
}  // namespace

std::uint64_t knowledge_base_checksum(std::span<const std::byte> file) {
  return checksum(file, {kKnowledgeBaseChecksumAt});
}

std::uint64_t knowledge_base_index_checksum(std::span<const std::byte> index) {
  return checksum(index, {kKnowledgeBaseChecksumAt, kKnowledgeBaseIndexChecksumAt});
}

void seal_knowledge_base(std::span<std::byte> file) {
  const std::uint64_t length = file.size();
  std::memcpy(file.data() + kKnowledgeBaseLengthAt, &length, 8);
  std::uint64_t index_end = 0;
  std::memcpy(&index_end, file.data() + kKnowledgeBaseIndexEndAt, 8);
  const std::uint64_t index_sum = knowledge_base_index_checksum(file.first(std::min(index_end, length)));
  std::memcpy(file.data() + kKnowledgeBaseIndexChecksumAt, &index_sum, 8);
  const std::uint64_t sum = knowledge_base_checksum(file);
  std::memcpy(file.data() + kKnowledgeBaseChecksumAt, &sum, 8);
}

std::vector<std::byte> encoded(const TrainedPart& part) {
  FactsRecord facts{};
  facts.scanner = static_cast<std::uint32_t>(part.scanner);
  facts.symmetry = static_cast<std::uint32_t>(part.symmetry.kind);
  facts.feature_stride = part.feature_stride;
  facts.feature_tolerance_mm = part.feature_tolerance_mm;
  facts.pixel_noise_diameter_quantum_mm = {part.pixel_mm, part.noise_mm, part.diameter_mm, part.dz_quantum_mm};
  Eigen::Vector3d::Map(facts.symmetry_centre_mm.data()) = part.symmetry.centre_mm;
  Eigen::Vector3d::Map(facts.symmetry_axis.data()) = part.symmetry.axis;
  facts.rotation_gap_rad = part.rotation_gap_rad;
  facts.mesh_hash = part.mesh_hash;

  const std::vector<float> weights = vote_weights(part);
  std::vector<ViewRecord> views;
  std::vector<Eigen::Vector3f> anchors, edges;
  std::vector<SurfaceSample> surface;
  const auto append = [](const auto& items, auto& all) {
    const Run run{static_cast<std::uint32_t>(all.size()), static_cast<std::uint32_t>(items.size())};
    all.insert(all.end(), items.begin(), items.end());
    return run;
  };
  for (const TrainedView& view : part.views) {
    ViewRecord record{};
    Eigen::Vector4f::Map(record.rotation_xyzw.data()) = view.R_supply_object.coeffs();
    record.lowest_mm = view.lowest_mm;
    record.area_mm2 = view.area_mm2;
    record.vote_weight = weights[views.size()];
    record.anchors = append(view.anchors_object_mm, anchors);
    record.surface = append(view.surface, surface);
    record.edges = append(view.edges_mm, edges);
    views.push_back(record);
  }

  std::vector<FeatureRecord> features;
  for (std::uint32_t f = 0; f < kFeatureCount; ++f)
    if (part.offsets[f + 1] > part.offsets[f]) features.push_back({f, part.offsets[f + 1]});

  Writer out;
  out.add(Section::Facts, std::span<const FactsRecord>(&facts, 1));
  out.add(Section::Name, std::span<const char>(part.part_name));
  out.add(Section::Vertices, part.mesh.vertices_mm);
  out.add(Section::Triangles, part.mesh.triangles);
  out.add(Section::Symmetry, part.symmetry.rotations);
  out.add(Section::Views, views);
  out.add(Section::Features, features);
  out.end_index();
  out.add(Section::Anchors, anchors);
  out.add(Section::Surface, surface);
  out.add(Section::Edges, edges);
  out.add(Section::Votes, part.votes);
  return out.sealed();
}

bool read_index(KnowledgeBase::Impl& part) {
  const std::span<const std::byte> file = part.file.bytes;
  std::uint64_t index_end = 0;
  std::memcpy(&index_end, file.data() + kKnowledgeBaseIndexEndAt, 8);
  if (index_end > file.size() || !read_facts(file, index_end, part)) return false;
  const auto views = section_of<ViewRecord>(file, Section::Views, index_end);
  const auto features = section_of<FeatureRecord>(file, Section::Features, index_end);
  const auto anchors = section_of<Eigen::Vector3f>(file, Section::Anchors, file.size());
  const auto surface = section_of<SurfaceSample>(file, Section::Surface, file.size());
  const auto edges = section_of<Eigen::Vector3f>(file, Section::Edges, file.size());
  const auto votes = section_of<Vote>(file, Section::Votes, file.size());
  if (!views || !features || !anchors || !surface || !edges || !votes) return false;
  if (views->empty() || views->size() > kViewsMax) return false;
  part.views.reserve(views->size());
  for (const ViewRecord& record : *views) {
    const auto own_anchors = part_of(*anchors, record.anchors), own_edges = part_of(*edges, record.edges);
    const auto own_surface = part_of(*surface, record.surface);
    if (!own_anchors || !own_surface || !own_edges) return false;
    View& view = part.views.emplace_back();
    view.R_supply_object.coeffs() = Eigen::Vector4f(record.rotation_xyzw.data());
    view.anchors_object_mm = *own_anchors;
    view.surface = *own_surface;
    view.edges_mm = *own_edges;
    view.lowest_mm = record.lowest_mm;
    view.area_mm2 = record.area_mm2;
    view.vote_weight = record.vote_weight;
    if (!sound(view)) return false;
  }
  part.votes = *votes;
  return lay_out(*features, part.votes.size(), part.offsets);
}

bool sound_lists(const KnowledgeBase::Impl& part) {
  return std::ranges::all_of(part.views,
                             [](const View& view) {
                               return all_finite(view.anchors_object_mm) && all_finite(view.edges_mm) &&
                                      std::ranges::all_of(view.surface, [](const SurfaceSample& s) {
                                        return s.p_mm.allFinite() && s.normal.allFinite();
                                      });
                             }) &&
         std::ranges::all_of(part.votes, [&](const Vote& vote) { return vote.rotation < part.views.size(); });
}
}  // namespace binpick::vision
