#include "vision/ply.hpp"

#include <algorithm>
#include <charconv>
#include <optional>
#include <string_view>

#include "vision/text_reader.hpp"

namespace binpick::vision {
namespace {
enum class Type { I8, U8, I16, U16, I32, U32, F32, F64 };

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
};

template <class T>
std::optional<double> raw_as(TextReader& reader) {
  const auto value = reader.raw<T>();
  return value ? std::optional(static_cast<double>(*value)) : std::nullopt;
}

std::optional<double> read_value(TextReader& reader, Type type, bool ascii) {
  if (ascii) return number_of(reader.word());
  switch (type) {
    case Type::I8:
      return raw_as<std::int8_t>(reader);
    case Type::U8:
      return raw_as<std::uint8_t>(reader);
    case Type::I16:
      return raw_as<std::int16_t>(reader);
    case Type::U16:
      return raw_as<std::uint16_t>(reader);
    case Type::I32:
      return raw_as<std::int32_t>(reader);
    case Type::U32:
      return raw_as<std::uint32_t>(reader);
    case Type::F32:
      return raw_as<float>(reader);
    case Type::F64:
      return raw_as<double>(reader);
  }
  return std::nullopt;
}

Expected<Header, std::string> parse_header(TextReader& reader) {
  Header header;
  bool format_known = false;
  const auto first = reader.line();
  if (!first || *first != "ply") return unexpected(std::string("is not a PLY file; save it as PLY"));
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
        return bad("the number of elements is no number; save it again");
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
      return bad("cannot be understood; save it again as PLY");
    }
  }
  if (!format_known) return unexpected(std::string("names no format in its header; save it again as PLY"));
  return header;
}

/// One property's values: one, or a list's. False at the end of the file or at a word that is no number.
bool read_property(TextReader& reader, const Property& property, bool ascii, std::vector<double>& values) {
  values.clear();
  std::uint64_t count = 1;
  if (property.count_type) {
    const auto said = read_value(reader, *property.count_type, ascii);
    if (!said || !(*said >= 0) || *said > 4294967295.0) return false;
    count = static_cast<std::uint64_t>(*said);
  }
  for (std::uint64_t i = 0; i < count; ++i) {
    const auto value = read_value(reader, property.type, ascii);
    if (!value) return false;
    values.push_back(*value);
  }
  return true;
}

bool is_coordinate(const Property& property, std::size_t axis) {
  return !property.count_type && property.type >= Type::F32 && property.name == std::string(1, "xyz"[axis]);
}
bool is_corners(const Property& property) {
  return property.count_type && (property.name == "vertex_indices" || property.name == "vertex_index");
}

Expected<Ply, std::string> read_elements(TextReader& reader, const Header& header, bool with_faces) {
  Ply ply;
  bool have_vertices = false, have_faces = !with_faces;
  std::vector<double> values;
  for (const Element& element : header.elements) {
    // Elements without properties take no bytes: nothing to walk over.
    if (element.properties.empty()) continue;
    const bool vertices = element.name == "vertex", faces = element.name == "face";
    std::array<std::size_t, 3> xyz{element.properties.size(), element.properties.size(), element.properties.size()};
    for (std::size_t i = 0; i < element.properties.size(); ++i)
      for (std::size_t axis = 0; axis < 3; ++axis)
        if (vertices && is_coordinate(element.properties[i], axis)) xyz[axis] = i;
    if (vertices && *std::max_element(xyz.begin(), xyz.end()) == element.properties.size())
      return unexpected(std::string("has no vertex properties x, y, z of type float or double; save them"));
    if (vertices) ply.vertices.reserve(std::min<std::size_t>(element.count, reader.left() / 6 + 1));
    for (std::uint64_t row = 0; row < element.count; ++row) {
      Eigen::Vector3f point = Eigen::Vector3f::Zero();
      for (std::size_t i = 0; i < element.properties.size(); ++i) {
        if (!read_property(reader, element.properties[i], header.ascii, values))
          return unexpected("is truncated or damaged: " + element.name + " " + std::to_string(row) + " of " +
                            std::to_string(element.count) + " cannot be read at byte " + std::to_string(reader.at()) +
                            "; copy or save it again");
        for (int axis = 0; axis < 3; ++axis)
          if (vertices && xyz[static_cast<std::size_t>(axis)] == i) point[axis] = static_cast<float>(values[0]);
        if (!faces || !with_faces || !is_corners(element.properties[i])) continue;
        const auto most = static_cast<double>(ply.vertices.size());
        if (!have_vertices ||
            std::any_of(values.begin(), values.end(), [&](double v) { return !(v >= 0 && v < most); }))
          return unexpected("is damaged: face " + std::to_string(row) +
                            " names a vertex that is not there; export it again");
        for (std::size_t k = 2; k < values.size(); ++k)
          ply.triangles.push_back({static_cast<std::uint32_t>(values[0]), static_cast<std::uint32_t>(values[k - 1]),
                                   static_cast<std::uint32_t>(values[k])});
      }
      if (vertices) ply.vertices.push_back(point);
    }
    have_vertices = have_vertices || vertices;
    have_faces = have_faces || faces;
    if (have_vertices && have_faces) return ply;
  }
  if (!have_vertices)
    return unexpected(std::string("has no element vertex with properties; save it as PLY with x, y, z"));
  return ply;
}
}  // namespace

Expected<Ply, std::string> parse_ply(std::span<const std::byte> bytes, bool with_faces) {
  TextReader reader(bytes);
  const auto header = parse_header(reader);
  if (!header) return unexpected(header.error());
  return read_elements(reader, *header, with_faces);
}
}  // namespace binpick::vision
