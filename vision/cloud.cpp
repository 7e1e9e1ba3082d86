#include "vision/cloud.hpp"

#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string_view>

#include "vision/file.hpp"

namespace binpick::vision {
namespace {
using Points = std::vector<Eigen::Vector3f>;

enum class Type { I8, U8, I16, U16, I32, U32, F32, F64 };
constexpr std::array<std::size_t, 8> kBytes{1, 1, 2, 2, 4, 4, 4, 8};

std::optional<Type> type_of(std::string_view word) {
  constexpr std::array<std::pair<std::string_view, Type>, 16> kNames{{{"char", Type::I8},
                                                                      {"int8", Type::I8},
                                                                      {"uchar", Type::U8},
                                                                      {"uint8", Type::U8},
                                                                      {"short", Type::I16},
                                                                      {"int16", Type::I16},
                                                                      {"ushort", Type::U16},
                                                                      {"uint16", Type::U16},
                                                                      {"int", Type::I32},
                                                                      {"int32", Type::I32},
                                                                      {"uint", Type::U32},
                                                                      {"uint32", Type::U32},
                                                                      {"float", Type::F32},
                                                                      {"float32", Type::F32},
                                                                      {"double", Type::F64},
                                                                      {"float64", Type::F64}}};
  for (const auto& [name, type] : kNames)
    if (name == word) return type;
  return std::nullopt;
}

struct Property {
  std::string name;
  Type type = Type::F32;
  std::optional<Type> count_type;  ///< Set for a list.
};
struct Element {
  std::string name;
  std::uint64_t count = 0;
  std::vector<Property> properties;
};
struct Header {
  bool ascii = false;
  std::vector<Element> elements;
  std::size_t body = 0;  ///< Offset of the first byte after end_header's line.
};

/// Walks over a file's text: lines of the header, then words (ASCII) or raw values (binary). Never past its end.
class Reader {
 public:
  Reader(std::span<const std::byte> bytes, std::size_t at)
      : text_(reinterpret_cast<const char*>(bytes.data()), bytes.size()), at_(at) {}

  std::optional<std::string_view> line() {
    const std::size_t end = text_.find('\n', at_);
    if (end == std::string_view::npos) return std::nullopt;
    std::string_view line = text_.substr(at_, end - at_);
    at_ = end + 1;
    if (line.ends_with('\r')) line.remove_suffix(1);
    return line;
  }
  std::optional<double> word() {
    while (at_ < text_.size() && is_space(text_[at_])) ++at_;
    std::size_t end = at_;
    while (end < text_.size() && !is_space(text_[end])) ++end;
    std::string_view word = text_.substr(at_, end - at_);
    if (word.starts_with('+')) word.remove_prefix(1);
    double value = 0;
    const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (word.empty() || stop != word.data() + word.size() || error == std::errc::invalid_argument) return std::nullopt;
    if (error == std::errc::result_out_of_range) value = std::numeric_limits<double>::infinity();
    at_ = end;
    return value;
  }
  std::optional<double> raw(Type type) {
    const std::size_t size = kBytes[static_cast<std::size_t>(type)];
    if (text_.size() - at_ < size) return std::nullopt;
    const char* from = text_.data() + at_;
    at_ += size;
    switch (type) {
      case Type::I8:
        return value_of<std::int8_t>(from);
      case Type::U8:
        return value_of<std::uint8_t>(from);
      case Type::I16:
        return value_of<std::int16_t>(from);
      case Type::U16:
        return value_of<std::uint16_t>(from);
      case Type::I32:
        return value_of<std::int32_t>(from);
      case Type::U32:
        return value_of<std::uint32_t>(from);
      case Type::F32:
        return static_cast<double>(value_of<float>(from));
      case Type::F64:
        return value_of<double>(from);
    }
    return std::nullopt;
  }
  std::size_t at() const { return at_; }
  std::size_t left() const { return text_.size() - at_; }

 private:
  static bool is_space(char c) { return c == ' ' || c == '\n' || c == '\r' || c == '\t'; }
  template <class T>
  static T value_of(const char* from) {
    static_assert(std::endian::native == std::endian::little);
    T value;
    std::memcpy(&value, from, sizeof value);
    return value;
  }
  std::string_view text_;
  std::size_t at_;
};

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  while (true) {
    const std::size_t begin = line.find_first_not_of(" \t");
    if (begin == std::string_view::npos) return words;
    line.remove_prefix(begin);
    const std::size_t end = std::min(line.find_first_of(" \t"), line.size());
    words.push_back(line.substr(0, end));
    line.remove_prefix(end);
  }
}

Expected<Header, std::string> parse_header(Reader& reader) {
  Header header;
  bool format_known = false;
  const auto first = reader.line();
  if (!first || *first != "ply") return unexpected(std::string("is not a PLY file; save the cloud as PLY"));
  for (int line_number = 2;; ++line_number) {
    const auto bad = [&](const std::string& why) {
      return unexpected("line " + std::to_string(line_number) + ": " + why);
    };
    const auto line = reader.line();
    if (!line) return unexpected(std::string("is truncated inside its header; copy or save it again"));
    const auto words = words_of(*line);
    if (words.empty() || words[0] == "comment" || words[0] == "obj_info") continue;
    if (words[0] == "end_header") break;
    if (words[0] == "format" && words.size() >= 2) {
      if (words[1] != "ascii" && words[1] != "binary_little_endian")
        return bad("format " + std::string(words[1]) + " is not read; save it as ascii or binary_little_endian");
      header.ascii = words[1] == "ascii";
      format_known = true;
    } else if (words[0] == "element" && words.size() == 3) {
      Element element{std::string(words[1]), 0, {}};
      const auto [stop, error] = std::from_chars(words[2].data(), words[2].data() + words[2].size(), element.count);
      if (error != std::errc() || stop != words[2].data() + words[2].size())
        return bad("the number of elements is no number; save the cloud again");
      header.elements.push_back(std::move(element));
    } else if (words[0] == "property" && !header.elements.empty() &&
               (words.size() == 3 || (words.size() == 5 && words[1] == "list"))) {
      Property property{std::string(words.back()), Type::F32, {}};
      const auto type = type_of(words[words.size() - 2]);
      const auto count_type = words.size() == 5 ? type_of(words[2]) : std::nullopt;
      if (!type || (words.size() == 5 && (!count_type || *count_type >= Type::F32)))
        return bad("unknown property type; use float or double for x, y and z");
      property.type = *type;
      property.count_type = count_type;
      header.elements.back().properties.push_back(std::move(property));
    } else {
      return bad("cannot be understood; save the cloud again as PLY");
    }
  }
  if (!format_known) return unexpected(std::string("names no format in its header; save the cloud again as PLY"));
  header.body = reader.at();
  return header;
}

/// One property's value; of a list the last one, 0 when it is empty.
std::optional<double> read_property(Reader& reader, const Property& property, bool ascii) {
  const auto scalar = [&](Type type) { return ascii ? reader.word() : reader.raw(type); };
  if (!property.count_type) return scalar(property.type);
  const auto count = scalar(*property.count_type);
  if (!count || !(*count >= 0) || *count > 4294967295.0) return std::nullopt;
  double last = 0;
  for (std::uint64_t i = 0; i < static_cast<std::uint64_t>(*count); ++i) {
    const auto value = scalar(property.type);
    if (!value) return std::nullopt;
    last = *value;
  }
  return last;
}

Expected<Points, std::string> read_points(Reader& reader, const Header& header) {
  for (const Element& element : header.elements) {
    // Elements without properties take no bytes: nothing to walk over.
    if (element.properties.empty()) continue;
    const bool vertices = element.name == "vertex";
    std::array<std::optional<std::size_t>, 3> xyz;
    if (vertices) {
      for (std::size_t i = 0; i < element.properties.size(); ++i) {
        const Property& property = element.properties[i];
        for (std::size_t axis = 0; axis < 3; ++axis)
          if (property.name == std::string(1, "xyz"[axis]) && !property.count_type && property.type >= Type::F32)
            xyz[axis] = i;
      }
      if (!xyz[0] || !xyz[1] || !xyz[2])
        return unexpected(std::string("has no vertex properties x, y, z of type float or double; save them"));
    }
    Points points;
    if (vertices) points.reserve(std::min<std::size_t>(element.count, reader.left() / 6 + 1));
    for (std::uint64_t row = 0; row < element.count; ++row) {
      Eigen::Vector3f point = Eigen::Vector3f::Zero();
      for (std::size_t i = 0; i < element.properties.size(); ++i) {
        const auto value = read_property(reader, element.properties[i], header.ascii);
        if (!value)
          return unexpected("is truncated or damaged: " + element.name + " " + std::to_string(row) + " of " +
                            std::to_string(element.count) + " cannot be read at byte " + std::to_string(reader.at()) +
                            "; copy or save it again");
        for (int axis = 0; axis < 3; ++axis)
          if (xyz[static_cast<std::size_t>(axis)] == i) point[axis] = static_cast<float>(*value);
      }
      if (vertices && point.allFinite()) points.push_back(point);
    }
    if (vertices) {
      if (element.count == 0) return unexpected(std::string("holds no point; scan again"));
      if (points.empty())
        return unexpected("holds " + std::to_string(element.count) + " points, none of them finite; scan again");
      return points;
    }
  }
  return unexpected(std::string("has no element vertex with properties; save the cloud as PLY with x, y, z"));
}
}  // namespace

Expected<Points, CloudError> parse_cloud(std::span<const std::byte> bytes, const std::string& name) {
  const auto failed = [&](const std::string& why) { return unexpected(CloudError{"cloud " + name + ": " + why}); };
  if (bytes.empty()) return failed("the file is empty; scan or save it again");
  Reader reader(bytes, 0);
  const auto header = parse_header(reader);
  if (!header) return failed(header.error());
  auto points = read_points(reader, *header);
  if (!points) return failed(points.error());
  return std::move(*points);
}

Expected<Points, CloudError> load_cloud(const std::string& path) {
  const auto bytes = read_file(path);
  if (!bytes) return unexpected(CloudError{"cloud: " + bytes.error()});
  return parse_cloud(*bytes, path);
}

Expected<void, CloudError> save_cloud(const std::string& path, const Points& points_mm) {
  const std::string header =
      "ply\nformat binary_little_endian 1.0\ncomment millimetres, supply frame\nelement vertex " +
      std::to_string(points_mm.size()) + "\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
  std::vector<std::byte> bytes(header.size() + 12 * points_mm.size());
  std::memcpy(bytes.data(), header.data(), header.size());
  std::byte* out = bytes.data() + header.size();
  for (const Eigen::Vector3f& point : points_mm) {
    std::memcpy(out, point.data(), 12);
    out += 12;
  }
  if (const auto written = write_file(path, bytes); !written)
    return unexpected(CloudError{"cloud: " + written.error()});
  return {};
}
}  // namespace binpick::vision
