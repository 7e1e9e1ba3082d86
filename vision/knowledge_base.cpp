#include "vision/knowledge_base.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <type_traits>

#include "vision/feature.hpp"
#include "vision/file.hpp"
#include "vision/knowledge_base_impl.hpp"

/// The file, all little-endian:
///   8 bytes "BINPICKB", u32 version, u32 zero, u64 length of the file, u64 checksum of all bytes but these eight,
///   then the fields of Impl in the order of write() below; a list is a u64 count and its items.
namespace binpick::vision {
namespace {
static_assert(std::endian::native == std::endian::little);
static_assert(sizeof(Vote) == 8 && std::is_trivially_copyable_v<Vote>);
static_assert(sizeof(Eigen::Vector3f) == 12 && sizeof(SurfaceSample) == 24);

using Impl = KnowledgeBase::Impl;
using Kind = KnowledgeBaseError::Kind;
constexpr std::array<char, 8> kMagic{'B', 'I', 'N', 'P', 'I', 'C', 'K', 'B'};
constexpr std::uint32_t kVersion = 1;
constexpr std::size_t kHeaderBytes = 32;

class Writer {
 public:
  template <class T>
  void item(const T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    raw(&value, sizeof value);
  }
  template <class T>
  void list(const std::vector<T>& items) {
    item(static_cast<std::uint64_t>(items.size()));
    raw(items.data(), items.size() * sizeof(T));
  }
  void raw(const void* from, std::size_t size) {
    if (size == 0) return;
    const std::size_t held = bytes.size();
    bytes.resize(held + size);
    std::memcpy(bytes.data() + held, from, size);
  }
  std::vector<std::byte> bytes;
};

/// Gives nothing, once it was asked for more than there is.
class Reader {
 public:
  explicit Reader(std::span<const std::byte> bytes) : bytes_{bytes} {}
  template <class T>
  T item() {
    T value{};
    raw(&value, sizeof value);
    return value;
  }
  template <class T>
  std::vector<T> list() {
    const auto count = item<std::uint64_t>();
    if (!good_ || count > (bytes_.size() - at_) / sizeof(T)) {
      good_ = false;
      return {};
    }
    std::vector<T> items(static_cast<std::size_t>(count));
    raw(items.data(), items.size() * sizeof(T));
    return items;
  }
  bool good() const { return good_; }
  void fail() { good_ = false; }
  bool at_end() const { return at_ == bytes_.size(); }

 private:
  void raw(void* to, std::size_t size) {
    if (!good_ || size > bytes_.size() - at_) {
      good_ = false;
      return;
    }
    if (size > 0) std::memcpy(to, bytes_.data() + at_, size);
    at_ += size;
  }
  std::span<const std::byte> bytes_;
  std::size_t at_ = 0;
  bool good_ = true;
};

void write(Writer& out, const Impl& part) {
  out.list(std::vector<char>(part.part_name.begin(), part.part_name.end()));
  out.item(static_cast<std::uint32_t>(part.scanner));
  out.item(part.feature_stride);
  out.item(part.feature_tolerance_mm);
  out.item(std::uint32_t{0});
  for (const double value : {part.pixel_mm, part.noise_mm, part.diameter_mm, part.dz_quantum_mm}) out.item(value);
  out.item(part.mesh_hash);
  out.list(part.mesh.vertices_mm);
  out.list(part.mesh.triangles);
  out.item(static_cast<std::uint64_t>(part.symmetry.kind));
  out.raw(part.symmetry.centre_mm.data(), 3 * sizeof(double));
  out.raw(part.symmetry.axis.data(), 3 * sizeof(double));
  out.list(part.symmetry.rotations);
  out.item(static_cast<std::uint64_t>(part.views.size()));
  for (const View& view : part.views) {
    out.raw(view.R_supply_object.coeffs().data(), 4 * sizeof(float));
    out.item(view.lowest_mm);
    out.item(view.area_mm2);
    out.list(view.anchors_object_mm);
    out.list(view.surface);
    out.list(view.edges_mm);
  }
  out.list(part.offsets);
  out.list(part.votes);
}

template <class Vector>
Vector vector_of(Reader& in) {
  Vector v;
  for (auto& x : v.reshaped()) x = in.item<typename Vector::Scalar>();
  return v;
}

void read(Reader& in, Impl& part) {
  const auto name = in.list<char>();
  part.part_name.assign(name.begin(), name.end());
  const auto scanner = in.item<std::uint32_t>();
  if (scanner > static_cast<std::uint32_t>(ScannerClass::Lms400)) in.fail();
  part.scanner = static_cast<ScannerClass>(scanner);
  part.feature_stride = in.item<int>();
  part.feature_tolerance_mm = in.item<float>();
  static_cast<void>(in.item<std::uint32_t>());
  for (double* value : {&part.pixel_mm, &part.noise_mm, &part.diameter_mm, &part.dz_quantum_mm})
    *value = in.item<double>();
  part.mesh_hash = in.item<std::uint64_t>();
  part.mesh.vertices_mm = in.list<Eigen::Vector3f>();
  part.mesh.triangles = in.list<std::array<std::uint32_t, 3>>();
  const auto kind = in.item<std::uint64_t>();
  if (kind > static_cast<std::uint64_t>(Symmetry::Kind::Sphere)) in.fail();
  part.symmetry.kind = static_cast<Symmetry::Kind>(kind);
  part.symmetry.centre_mm = vector_of<Eigen::Vector3d>(in);
  part.symmetry.axis = vector_of<Eigen::Vector3d>(in);
  part.symmetry.rotations = in.list<Eigen::Matrix3d>();
  const auto views = in.item<std::uint64_t>();
  if (views > 65'536) in.fail();
  for (std::uint64_t i = 0; i < views && in.good(); ++i) {
    View& view = part.views.emplace_back();
    view.R_supply_object.coeffs() = vector_of<Eigen::Vector4f>(in);
    view.lowest_mm = in.item<float>();
    view.area_mm2 = in.item<float>();
    view.anchors_object_mm = in.list<Eigen::Vector3f>();
    view.surface = in.list<SurfaceSample>();
    view.edges_mm = in.list<Eigen::Vector3f>();
  }
  part.offsets = in.list<std::uint32_t>();
  part.votes = in.list<Vote>();
}

bool all_finite(const std::vector<Eigen::Vector3f>& points) {
  return std::ranges::all_of(points, [](const Eigen::Vector3f& p) { return p.allFinite(); });
}

bool sound(const View& view) {
  return view.R_supply_object.coeffs().allFinite() && std::abs(view.R_supply_object.norm() - 1) < 1e-3F &&
         std::isfinite(view.lowest_mm) && std::isfinite(view.area_mm2) && !view.anchors_object_mm.empty() &&
         all_finite(view.anchors_object_mm) && all_finite(view.edges_mm) &&
         std::ranges::all_of(view.surface,
                             [](const SurfaceSample& s) { return s.p_mm.allFinite() && s.normal.allFinite(); });
}

/// Whether detection may trust every index and number: a checksum can be forged, or be that of another mistake.
bool sound(const Impl& part) {
  for (const double value : {part.pixel_mm, part.noise_mm, part.diameter_mm, part.dz_quantum_mm})
    if (!(value > 0) || !std::isfinite(value)) return false;
  if (part.feature_stride < 1 || part.feature_stride > 64 || !(part.feature_tolerance_mm > 0)) return false;
  if (part.mesh.triangles.empty() || !all_finite(part.mesh.vertices_mm)) return false;
  for (const auto& triangle : part.mesh.triangles)
    for (const std::uint32_t v : triangle)
      if (v >= part.mesh.vertices_mm.size()) return false;
  const Symmetry& symmetry = part.symmetry;
  if (!symmetry.centre_mm.allFinite() || !(std::abs(symmetry.axis.norm() - 1) < 1e-6) || symmetry.rotations.empty() ||
      !std::ranges::all_of(symmetry.rotations, [](const Eigen::Matrix3d& R) { return R.isUnitary(1e-6); }))
    return false;
  if (part.views.empty() || !std::ranges::all_of(part.views, [](const View& view) { return sound(view); }))
    return false;
  if (part.offsets.size() != kFeatureCount + 1 || part.offsets.front() != 0 ||
      part.offsets.back() != part.votes.size() || !std::ranges::is_sorted(part.offsets))
    return false;
  return std::ranges::all_of(part.votes, [&](const Vote& vote) { return vote.rotation < part.views.size(); });
}

std::vector<std::byte> encoded(const Impl& part) {
  Writer out;
  out.raw(kMagic.data(), kMagic.size());
  out.item(kVersion);
  out.item(std::uint32_t{0});
  out.item(std::uint64_t{0});
  out.item(std::uint64_t{0});
  write(out, part);
  const std::uint64_t length = out.bytes.size();
  std::memcpy(out.bytes.data() + kKnowledgeBaseLengthAt, &length, 8);
  const std::uint64_t sum = knowledge_base_checksum(out.bytes);
  std::memcpy(out.bytes.data() + kKnowledgeBaseChecksumAt, &sum, 8);
  return std::move(out.bytes);
}
}  // namespace

/// FNV-1a over words of eight bytes: each step maps different states to different states, so that no single changed
/// word, hence no flipped byte, can go unseen.
std::uint64_t knowledge_base_checksum(std::span<const std::byte> file) {
  std::uint64_t hash = 0xCBF29CE484222325ULL;
  for (std::size_t at = 0; at < file.size(); at += 8) {
    std::uint64_t word = 0;
    if (at != kKnowledgeBaseChecksumAt)
      std::memcpy(&word, file.data() + at, std::min<std::size_t>(8, file.size() - at));
    hash = (hash ^ word) * 0x9E3779B97F4A7C15ULL;
    hash ^= hash >> 32;
  }
  return hash ^ file.size();
}

std::size_t knowledge_base_bytes(const Impl& part) {
  std::size_t views = 0;
  for (const View& view : part.views)
    views += 48 + 12 * (view.anchors_object_mm.size() + view.edges_mm.size()) + 24 * view.surface.size();
  return kHeaderBytes + 168 + part.part_name.size() + 12 * (part.mesh.vertices_mm.size() + part.mesh.triangles.size()) +
         72 * part.symmetry.rotations.size() + views + 4 * part.offsets.size() + 8 * part.votes.size();
}

Expected<KnowledgeBase, KnowledgeBaseError> KnowledgeBase::parse(std::span<const std::byte> bytes,
                                                                 const std::string& name) {
  const auto failed = [&](Kind kind, const std::string& why) {
    return unexpected(KnowledgeBaseError{kind, "knowledge base " + name + ": " + why});
  };
  const std::size_t compared = std::min(bytes.size(), kMagic.size());
  if (bytes.empty() || std::memcmp(bytes.data(), kMagic.data(), compared) != 0)
    return failed(Kind::NotAKnowledgeBase, "is not a knowledge base; make one with binpick train");
  if (bytes.size() < kHeaderBytes)
    return failed(Kind::Truncated, "is truncated: " + std::to_string(bytes.size()) + " bytes, its header alone has " +
                                       std::to_string(kHeaderBytes) + "; copy or train it again");
  Reader header(bytes.subspan(kMagic.size()));
  const auto version = header.item<std::uint32_t>();
  static_cast<void>(header.item<std::uint32_t>());
  const auto length = header.item<std::uint64_t>(), sum = header.item<std::uint64_t>();
  if (version != kVersion)
    return failed(Kind::Version, "has version " + std::to_string(version) + ", this program reads version " +
                                     std::to_string(kVersion) + "; train the part again");
  if (bytes.size() < length)
    return failed(Kind::Truncated, "is truncated: " + std::to_string(bytes.size()) + " of " + std::to_string(length) +
                                       " bytes; copy or train it again");
  if (bytes.size() > length || knowledge_base_checksum(bytes) != sum)
    return failed(Kind::Checksum, "is damaged: its checksum is wrong; copy or train it again");
  Reader in(bytes.subspan(kHeaderBytes));
  auto part = std::make_shared<Impl>();
  read(in, *part);
  if (!in.good() || !in.at_end() || !sound(*part))
    return failed(Kind::Checksum, "is damaged: its content contradicts itself; train the part again");
  return KnowledgeBase(std::move(part));
}

Expected<KnowledgeBase, KnowledgeBaseError> KnowledgeBase::open(const std::string& path) {
  const auto bytes = read_file(path);
  if (!bytes) return unexpected(KnowledgeBaseError{Kind::CannotOpen, "knowledge base: " + bytes.error()});
  return parse(*bytes, path);
}

Expected<void, KnowledgeBaseError> KnowledgeBase::save(const std::string& path) const {
  if (const auto written = write_file(path, encoded(*impl_)); !written)
    return unexpected(KnowledgeBaseError{Kind::CannotOpen, "knowledge base: " + written.error()});
  return {};
}

KnowledgeBase::KnowledgeBase(std::shared_ptr<const Impl> impl) : impl_{std::move(impl)} {}
const std::string& KnowledgeBase::part_name() const { return impl_->part_name; }
const Mesh& KnowledgeBase::mesh() const { return impl_->mesh; }
const Symmetry& KnowledgeBase::symmetry() const { return impl_->symmetry; }
ScannerClass KnowledgeBase::scanner() const { return impl_->scanner; }
double KnowledgeBase::pixel_mm() const { return impl_->pixel_mm; }
double KnowledgeBase::noise_mm() const { return impl_->noise_mm; }
double KnowledgeBase::diameter_mm() const { return impl_->diameter_mm; }
}  // namespace binpick::vision
