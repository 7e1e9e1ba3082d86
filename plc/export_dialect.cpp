#include "plc/export_dialect.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <utility>

#include "base/check.hpp"
#include "plc/counterpart.hpp"
#include "plc/registers.hpp"
#include "plc/result_codes.hpp"

namespace binpick::plc {
namespace {
std::string number(std::uint64_t value) { return std::to_string(value); }
std::string number(PlcStep step) { return number(static_cast<std::uint64_t>(step)); }

unsigned bit_of(std::string_view reg, std::string_view name) {
  const auto find = [&](const auto& table) -> unsigned {
    for (const Bit& bit : table)
      if (bit.name == name) return bit.bit;
    BINPICK_CHECK(false);
  };
  return reg == "control" ? find(kControlBits) : find(kStatusBits);
}

/// The common text in the make's own: variables, bits, literals and the lines that begin with an exclamation mark.
class Speaker {
 public:
  Speaker(Dialect dialect, const ExportOptions& options) : s7_{dialect == Dialect::S7}, options_{options} {}

  std::string speak(std::string_view text) const {
    std::string out;
    for (std::size_t at = 0; at < text.size();) {
      const std::size_t end = std::min(text.find('\n', at), text.size());
      out += line(text.substr(at, end - at)) + "\n";
      at = end + 1;
    }
    return out;
  }

 private:
  std::string line(std::string_view text) const {
    const std::size_t begin = text.find_first_not_of(' ');
    if (begin == std::string_view::npos) return "";
    const std::string indent(begin, ' ');
    if (text[begin] == '!') return directive(text.substr(begin + 1), indent);
    const std::size_t comment = text.find("//");
    return words(text.substr(0, comment)) +
           (comment == std::string_view::npos ? "" : std::string(text.substr(comment)));
  }

  std::string directive(std::string_view text, const std::string& indent) const {
    const auto word = [&text] {
      const std::size_t end = std::min(text.find(' '), text.size());
      const std::string out{text.substr(0, end)};
      text.remove_prefix(std::min(end + 1, text.size()));
      return out;
    };
    const std::string what = word();
    if (what == "timer") {
      const std::string name = word();
      const std::string ms = number(static_cast<std::uint64_t>(preset(word()).count()));
      const std::string when = words(text);
      if (s7_) return indent + "#" + name + "(IN := " + when + ", PT := T#" + ms + "ms);";
      return indent + name + ".PRE := " + ms + ";\n" + indent + name + ".TimerEnable := " + when + ";\n" + indent +
             "TONR(" + name + ");";
    }
    if (what == "copy") {
      const std::string to = word(), from = word();
      return indent + (s7_ ? "#" + to + " := #" + from + ";" : "COP(" + from + ", " + to + ", 1);");
    }
    BINPICK_CHECK(what == "next");
    // Logix has no unsigned words: its numbers end at 32767, and one above that of another program reads negative.
    const std::string last = s7_ ? "#sequence >= 65535" : "(sequence < 0) OR (sequence >= 32767)";
    const std::string name = s7_ ? "#sequence" : "sequence";
    return indent + "IF " + last + " THEN\n" + indent + "   " + name + " := 1;\n" + indent + "ELSE\n" + indent + "   " +
           name + " := " + name + " + 1;\n" + indent + "END_IF;";
  }

  std::chrono::milliseconds preset(std::string_view name) const {
    if (name == "cell") return options_.cell_timeout;
    if (name == "answer") return options_.answer_timeout;
    if (name == "settle") return std::chrono::milliseconds(1000);
    BINPICK_CHECK(name == "level");
    return std::chrono::milliseconds(5000);
  }

  std::string words(std::string_view text) const {
    std::string out, path;
    const auto take = [&text](std::size_t n) {
      const std::string taken{text.substr(0, n)};
      text.remove_prefix(std::min(n, text.size()));
      return taken;
    };
    const auto name_length = [](std::string_view s) {
      std::size_t n = 0;
      while (n < s.size() && (std::isalnum(static_cast<unsigned char>(s[n])) != 0 || s[n] == '_')) ++n;
      return n;
    };
    while (!text.empty()) {
      const char c = text.front();
      if (c == '@') {
        take(1);
        if (s7_) out += '#';
      } else if (c == '$') {
        take(1);
        out += constant(take(name_length(text)));
      } else if (c == '{') {
        const std::string name = take(text.find('}') + 1);
        out += step_number(std::string_view{name}.substr(1, name.size() - 2));
      } else if (c == '[') {
        const std::string name = take(text.find(']') + 1);
        const unsigned bit = bit_of(path, std::string_view{name}.substr(1, name.size() - 2));
        out += (s7_ ? ".%X" : ".") + number(bit);
      } else if (const std::size_t n = name_length(text); n > 0) {
        path = take(n);
        if (!s7_ && (path == "TRUE" || path == "FALSE"))
          out += path == "TRUE" ? "1" : "0";
        else if (!s7_ && path == "Q" && out.ends_with('.'))
          out += "DN";
        else
          out += path;
      } else {
        out += take(1);
      }
    }
    return out;
  }

  static std::string constant(std::string_view name) {
    if (name == "version") return number(kMapVersion);
    if (name == "length") return number(kMapLength);
    if (name == "u32") return number(kTestU32);
    if (name == "f32") return std::to_string(static_cast<long>(kTestF32)) + ".0";
    BINPICK_CHECK(name == "found");
    return number(static_cast<std::uint64_t>(ResultCode::PickFound));
  }
  static std::string step_number(std::string_view name) {
    for (const PlcStepText& s : kPlcSteps)
      if (s.name == name) return number(s.step);
    BINPICK_CHECK(false);
  }

  bool s7_;
  const ExportOptions& options_;
};
static_assert(kTestF32 == 123456.0F, "the test value is written as a whole number with .0");
}  // namespace

std::string spoken(Dialect dialect, const ExportOptions& options, std::string_view text) {
  return Speaker{dialect, options}.speak(text);
}

std::string ascii(std::string_view text) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 6> kSpelt{
      {{"…", "..."}, {"→", "->"}, {"·", "*"}, {"×", "x"}, {"–", "-"}, {"°", " deg"}}};
  std::string out;
  while (!text.empty()) {
    const auto spelt = std::ranges::find_if(kSpelt, [&](const auto& pair) { return text.starts_with(pair.first); });
    out += spelt == kSpelt.end() ? text.substr(0, 1) : spelt->second;
    text.remove_prefix(spelt == kSpelt.end() ? 1 : spelt->first.size());
  }
  return out;
}

std::string crlf(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '\n') out += '\r';
    out += c;
  }
  return out;
}
}  // namespace binpick::plc
