#include "config/document.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

// The library's assertions are reachable from input ("[0, }"), where a debug build would abort and clang's release
// build may do anything. Here they behave the same in every build: see library_assertion.
namespace binpick::config {
namespace {
struct LibraryAssertion {};
void library_assertion(const char* condition) {
  // A value that begins with its own end is told as a syntax error a few lines further on.
  if (std::strstr(condition, "is_value_terminator") == nullptr) throw LibraryAssertion{};
}
}  // namespace
}  // namespace binpick::config
#undef NDEBUG
#define TOML_ASSERT(condition) \
  (static_cast<bool>(condition) ? void(0) : ::binpick::config::library_assertion(#condition))
#define TOML_HEADER_ONLY 1
#define TOML_EXCEPTIONS 0
#define TOML_ENABLE_FORMATTERS 0
#include <toml++/toml.h>

namespace binpick::config {
namespace {
/// Syntax errors skipped over before the rest of the file is left alone.
constexpr int kRecoveriesMax = 20;
/// Names in one dotted key. The library's tables are nested structures that are torn down recursively.
constexpr int kKeyNamesMax = 16;
/// How the library's messages begin.
constexpr std::string_view kParsing = "Error while parsing ";

std::vector<std::string> split_lines(std::string_view text) {
  std::vector<std::string> lines;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    std::string_view line = text.substr(0, end);
    if (line.ends_with('\r')) line.remove_suffix(1);
    lines.emplace_back(line);
    text = end == std::string_view::npos ? std::string_view{} : text.substr(end + 1);
  }
  return lines;
}

/// Where a piece of source stands; what spans lines is shown up to the end of its first one.
Place place_of(const toml::source_region& region, const std::vector<std::string>& lines) {
  Place place;
  place.line = static_cast<int>(region.begin.line);
  place.column = static_cast<int>(region.begin.column);
  if (region.end.line == region.begin.line) {
    place.length = static_cast<int>(region.end.column) - place.column;
  } else if (place.line > 0 && static_cast<std::size_t>(place.line) <= lines.size()) {
    place.length = static_cast<int>(characters(lines[static_cast<std::size_t>(place.line) - 1])) - place.column + 1;
  }
  place.length = std::max(1, place.length);
  return place;
}

Value convert(const toml::node& node, const std::vector<std::string>& lines) {
  Value value;
  value.place = place_of(node.source(), lines);
  if (const auto* table = node.as_table()) {
    value.kind = Value::Kind::Table;
    for (const auto& [key, child] : *table)
      value.members.push_back({std::string{key.str()}, place_of(key.source(), lines), convert(child, lines)});
  } else if (const auto* array = node.as_array()) {
    value.kind = Value::Kind::List;
    for (const auto& child : *array) value.items.push_back(convert(child, lines));
  } else if (const auto* text = node.as_string()) {
    value.kind = Value::Kind::Text;
    value.text = text->get();
  } else if (const auto* integer = node.as_integer()) {
    value.kind = Value::Kind::Integer;
    value.integer = integer->get();
    value.number = static_cast<double>(integer->get());
  } else if (const auto* number = node.as_floating_point()) {
    value.kind = Value::Kind::Number;
    value.number = number->get();
  } else if (const auto* flag = node.as_boolean()) {
    value.kind = Value::Kind::Flag;
    value.flag = flag->get();
  } else {
    value.kind = Value::Kind::Date;
  }
  return value;
}

/// The library says what it saw; this adds what to do.
std::string remedy(const std::string& what) {
  const auto says = [&](const char* words) { return what.find(words) != std::string::npos; };
  if (says("as table") && says("array")) return "write it in double brackets, [[…]], as the others are";
  if (says("table header") && says("cannot redefine")) return "put its keys under the first one";
  if (says("cannot redefine")) return "remove one of the two";
  if (says("table header")) return "write [name] or [[name]] alone on its line";
  if (says("inline table")) return "keep { … } on one line and end it with }, with no comma before it";
  if (says("array")) return "separate values by commas and end the list with ]";
  if (says("expected value")) return "write a value after the =";
  if (says("end-of-file")) return "complete what begins on this line";
  if (says("saw ','")) return "write decimals with a point, 1.5, and lists in [ ]";
  if (says("control characters")) return "end the text with its quote, on the same line";
  if (says("escape")) return "write \\\\ for one backslash, or put the text in 'single quotes'";
  if (says("leading zero")) return "write the number without them";
  if (says("not representable")) return "write a smaller number";
  if (says("boolean")) return "write true or false";
  if (says("value type")) return "put a text in \"quotes\", write a number as 1.5, a flag as true or false";
  if (says("comment or whitespace")) return "give one value only; a comment begins with #";
  if (says("floating-point") || says("integer")) return "write a number as 1.5, and an address or a name in \"quotes\"";
  if (says("'='")) return "write name = value";
  return "write name = value, one on each line";
}

/// True when a mistake of this kind ends with its line: the next lines can be read without it.
bool ends_with_line(const std::string& what) {
  const auto says = [&](const char* words) { return what.find(words) != std::string::npos; };
  return !says("parsing array") && !says("inline table") && !says("table header") && !says("multi-line");
}

/// From a place to the end of the word or number there, for the tildes.
int token_length(const std::vector<std::string>& lines, const Place& place) {
  if (place.line < 1 || static_cast<std::size_t>(place.line) > lines.size()) return 1;
  const std::string& line = lines[static_cast<std::size_t>(place.line) - 1];
  std::size_t at = 0;
  for (int column = 1; column < place.column && at < line.size(); ++column)
    at += std::max<std::size_t>(1, utf8_bytes(line, at));
  const std::size_t end = std::min(line.find_first_of(" \t,=[]{}#\"'", at), line.size());
  return std::max(1, static_cast<int>(characters(std::string_view{line}.substr(at, end - at))));
}

/// The name before the '=' of a line, without quotes.
std::string key_on(const std::string& line) {
  std::string name = line.substr(0, line.find_first_of("=:"));
  std::erase_if(name, [](char c) { return c == ' ' || c == '\t' || c == '"' || c == '\''; });
  return name;
}

/// Place of the first dotted key with too many names; texts and comments are skipped as TOML reads them.
std::optional<Place> overlong_key(const std::vector<std::string>& lines) {
  std::string_view inside;  // the quotes that end the text we are in
  for (std::size_t n = 0; n < lines.size(); ++n) {
    const std::string_view line = lines[n];
    int dots = 0;
    for (std::size_t i = 0; i < line.size(); ++i) {
      if (!inside.empty()) {
        if (line[i] == '\\' && inside[0] == '"') {
          ++i;
        } else if (line.substr(i).starts_with(inside)) {
          i += inside.size() - 1;
          inside = {};
        }
        continue;
      }
      const std::string_view rest = line.substr(i);
      if (rest.starts_with("\"\"\"") || rest.starts_with("'''")) {
        inside = rest[0] == '"' ? "\"\"\"" : "'''";
        i += 2;
      } else if (rest[0] == '"' || rest[0] == '\'') {
        inside = rest[0] == '"' ? "\"" : "'";
      } else if (rest[0] == '#') {
        break;
      } else if (rest[0] == '.') {
        if (++dots >= kKeyNamesMax)
          return Place{static_cast<int>(n) + 1, static_cast<int>(characters(line.substr(0, i))) + 1, 1};
      } else if (std::string_view{",=[]{}"}.find(rest[0]) != std::string_view::npos) {
        dots = 0;
      }
    }
    if (inside.size() == 1) inside = {};  // a one-line text ends with its line; the parser will say so
  }
  return std::nullopt;
}

/// The place of the first byte that is not UTF-8, with that byte.
std::optional<std::pair<Place, unsigned char>> not_utf8(const std::vector<std::string>& lines) {
  for (std::size_t n = 0; n < lines.size(); ++n) {
    const std::string& line = lines[n];
    for (std::size_t at = 0; at < line.size();) {
      const std::size_t n_bytes = utf8_bytes(line, at);
      if (n_bytes == 0)
        return std::pair{Place{static_cast<int>(n) + 1, static_cast<int>(characters(line.substr(0, at))) + 1, 1},
                         static_cast<unsigned char>(line[at])};
      at += n_bytes;
    }
  }
  return std::nullopt;
}

/// Parses the lines, skipping those with a slip: fills root, usable and damaged_keys.
void parse_lines(Document& document, Findings& findings) {
  std::vector<std::string> kept = document.lines;
  for (int recoveries = 0;; ++recoveries) {
    std::string joined;
    for (const auto& line : kept) joined.append(line).append("\n");
    const toml::parse_result result = toml::parse(std::string_view{joined}, std::string_view{document.file});
    if (result) {
      document.root = convert(result.table(), document.lines);
      return;
    }
    std::string what{result.error().description()};
    Place place = place_of(result.error().source(), document.lines);
    const std::size_t at =
        std::min(static_cast<std::size_t>(std::max(place.line, 1)), std::max<std::size_t>(kept.size(), 1)) - 1;
    place.line = static_cast<int>(at) + 1;
    place.length = token_length(kept, place);
    const bool skips = recoveries < kRecoveriesMax && at < kept.size() && !kept[at].empty() && ends_with_line(what);
    const std::string cure = remedy(what);
    if (what.starts_with(kParsing)) what.erase(0, kParsing.size());
    if (what == "value: could not determine value type") what = "this is no TOML value";
    findings.add(place, printable(what) + "; " + cure);
    if (!skips) {
      document.usable = false;
      return;
    }
    document.damaged_keys.insert(key_on(kept[at]));
    kept[at].clear();
  }
}

}  // namespace

Document refused(const std::string& file, std::string message) {
  Document document;
  document.file = file;
  document.usable = false;
  Findings findings{file, {}};
  findings.add({}, std::move(message));
  document.findings = findings.take();
  return document;
}

const Member* Value::find(std::string_view key) const {
  const auto it = std::find_if(members.begin(), members.end(), [&](const Member& m) { return m.key == key; });
  return it == members.end() ? nullptr : &*it;
}

Document parse(const std::string& file, std::string_view text) {
  if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF"))
    return refused(file, "is UTF-16 text; save it as UTF-8");
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  if (text.size() > kFileBytesMax)
    return refused(file, "has more than " + std::to_string(kFileBytesMax / 1024) + " KiB; is it the right file?");
  Document document;
  document.file = file;
  document.text = text;
  document.lines = split_lines(text);
  Findings findings{file, document.lines};
  const auto give_up = [&](const Place& place, std::string message) {
    findings.add(place, std::move(message));
    document.findings = findings.take();
    document.usable = false;
    return std::move(document);
  };
  if (const auto bad = not_utf8(document.lines)) {
    char hex[8];
    std::snprintf(hex, sizeof hex, "0x%02X", bad->second);
    return give_up(bad->first, std::string{"byte "} + hex + " is not UTF-8; save the file as UTF-8");
  }
  if (const auto place = overlong_key(document.lines))
    return give_up(*place, "key of more than " + std::to_string(kKeyNamesMax) + " names; keys here have at most three");

  try {
    parse_lines(document, findings);
  } catch (const LibraryAssertion&) {
    return give_up({1, 1, 1}, "the text cannot be understood as TOML; start again from the example file");
  }
  document.findings = findings.take();
  return document;
}

Document open(const std::string& path) {
  // O_NONBLOCK: a pipe without a writer must not hold us.
  const int fd = ::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0)
    return refused(path,
                   std::string{"cannot be opened: "} + std::strerror(errno) + "; check the path and who may read it");
  struct stat status {};
  std::string problem;
  std::string text;
  if (::fstat(fd, &status) != 0) {
    problem = std::string{"cannot be read: "} + std::strerror(errno) + "; check the disk";
  } else if (S_ISDIR(status.st_mode)) {
    problem = "is a directory; name the file in it";
  } else if (!S_ISREG(status.st_mode)) {
    problem = "is not a regular file; name a TOML file";
  } else if (static_cast<std::size_t>(status.st_size) > kFileBytesMax) {
    problem = "has " + std::to_string(status.st_size / 1024) + " KiB, more than " +
              std::to_string(kFileBytesMax / 1024) + " KiB; is it the right file?";
  } else {
    char buffer[16384];
    ssize_t n = 0;
    while (text.size() <= kFileBytesMax && ((n = ::read(fd, buffer, sizeof buffer)) > 0 || (n < 0 && errno == EINTR)))
      if (n > 0) text.append(buffer, static_cast<std::size_t>(n));
    if (n < 0) problem = std::string{"cannot be read: "} + std::strerror(errno) + "; check the disk";
  }
  ::close(fd);
  if (!problem.empty()) return refused(path, problem);
  return parse(path, text);
}
}  // namespace binpick::config
