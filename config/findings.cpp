#include "config/findings.hpp"

#include <algorithm>
#include <cctype>
#include <numeric>

namespace binpick::config {
namespace {
/// Longest part of a line that is shown; a window around the caret is cut from a longer one.
constexpr std::size_t kShownMax = 120;

/// One string per character.
std::vector<std::string> split_characters(std::string_view text) {
  std::vector<std::string> out;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t n = utf8_bytes(text, at);
    const auto first = static_cast<unsigned char>(text[at]);
    if (n == 0 || (first < 0x20 && first != '\t') || first == 0x7F ||
        (n == 2 && first == 0xC2 && static_cast<unsigned char>(text[at + 1]) < 0xA0)) {
      out.emplace_back("?");
    } else if (first == '\t') {
      out.emplace_back(" ");
    } else {
      out.emplace_back(text.substr(at, n));
    }
    at += std::max<std::size_t>(n, 1);
  }
  return out;
}

std::size_t distance(std::string_view a, std::string_view b) {
  // Optimal string alignment: insert, remove, replace, swap neighbours; upper and lower case are the same letter.
  const auto same = [](char x, char y) {
    return std::tolower(static_cast<unsigned char>(x)) == std::tolower(static_cast<unsigned char>(y));
  };
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) d[i][0] = i;
  for (std::size_t j = 0; j <= b.size(); ++j) d[0][j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i)
    for (std::size_t j = 1; j <= b.size(); ++j) {
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (same(a[i - 1], b[j - 1]) ? 0 : 1)});
      if (i > 1 && j > 1 && same(a[i - 1], b[j - 2]) && same(a[i - 2], b[j - 1]))
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  return d[a.size()][b.size()];
}
}  // namespace

std::size_t utf8_bytes(std::string_view text, std::size_t at) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char lead = byte(at);
  if (lead < 0x80) return 1;
  const std::size_t n = lead >= 0xC2 && lead < 0xE0   ? 2
                        : lead >= 0xE0 && lead < 0xF0 ? 3
                        : lead >= 0xF0 && lead < 0xF5 ? 4
                                                      : 0;
  if (n == 0 || at + n > text.size()) return 0;
  for (std::size_t i = 1; i < n; ++i)
    if ((byte(at + i) & 0xC0) != 0x80) return 0;
  // Overlong forms, surrogates, beyond U+10FFFF.
  const unsigned char second = byte(at + 1);
  if ((lead == 0xE0 && second < 0xA0) || (lead == 0xED && second > 0x9F) || (lead == 0xF0 && second < 0x90) ||
      (lead == 0xF4 && second > 0x8F))
    return 0;
  return n;
}

std::size_t characters(std::string_view utf8) {
  std::size_t count = 0;
  for (std::size_t at = 0; at < utf8.size(); ++count) at += std::max<std::size_t>(utf8_bytes(utf8, at), 1);
  return count;
}

std::string printable(std::string_view text) {
  const auto shown = split_characters(text);
  return std::accumulate(shown.begin(), shown.end(), std::string{});
}

std::string nearest(std::string_view word, const std::vector<std::string>& candidates) {
  if (word.empty() || word.size() > 64) return {};
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(1, std::min<std::size_t>(4, word.size() / 3)) + 1;
  for (const auto& candidate : candidates) {
    std::size_t d = distance(word, candidate);
    // A unit left away or added ("tilt_max" for "tilt_max_deg") is a frequent slip, though many letters long.
    const std::string_view shorter = word.size() < candidate.size() ? word : std::string_view{candidate};
    const std::string_view longer = word.size() < candidate.size() ? std::string_view{candidate} : word;
    if (shorter.size() >= 4 && longer.starts_with(shorter) && longer[shorter.size()] == '_')
      d = std::min<std::size_t>(d, 1);
    if (d < best_distance) {
      best_distance = d;
      best = candidate;
    }
  }
  return best;
}

void Findings::add(const Place& place, std::string message) {
  if (findings_.size() >= kFindingsMax) {
    ++dropped_;
    return;
  }
  findings_.push_back(at(place, std::move(message)));
}

Diagnostic Findings::at(const Place& place, std::string message) const {
  Diagnostic d;
  d.file = file_;
  d.line = place.line;
  d.column = place.column;
  d.length = std::max(1, place.length);
  d.message = std::move(message);
  if (place.line > 0 && static_cast<std::size_t>(place.line) <= lines_.size())
    d.source = lines_[static_cast<std::size_t>(place.line) - 1];
  return d;
}

std::vector<Diagnostic> Findings::take() {
  std::stable_sort(findings_.begin(), findings_.end(), [](const Diagnostic& a, const Diagnostic& b) {
    return a.line != b.line ? a.line < b.line : a.column < b.column;
  });
  if (dropped_ > 0) {
    Diagnostic d;
    d.file = file_;
    d.message = std::to_string(dropped_) + " more findings are not shown; correct these first";
    findings_.push_back(std::move(d));
    dropped_ = 0;
  }
  return std::exchange(findings_, {});
}

std::string to_string(const Diagnostic& d) {
  if (d.line <= 0) return printable(d.file) + ": " + d.message;
  std::string text =
      printable(d.file) + ":" + std::to_string(d.line) + ":" + std::to_string(d.column) + ": " + d.message;
  const auto shown = split_characters(d.source);
  const std::size_t caret = static_cast<std::size_t>(std::max(1, d.column)) - 1;
  if (shown.empty() || caret > shown.size()) return text;
  const std::size_t first = caret > kShownMax - 20 ? caret - (kShownMax - 40) : 0;
  const std::size_t last = std::min(shown.size(), first + kShownMax);
  std::string line = first > 0 ? "…" : "";
  for (std::size_t i = first; i < last; ++i) line += shown[i];
  if (last < shown.size()) line += "…";
  const std::string number = std::to_string(d.line);
  text += "\n  " + number + " | " + line + "\n";
  text += std::string(2 + number.size(), ' ') + " | " + std::string(caret - first + (first > 0 ? 1 : 0), ' ') + "^";
  const std::size_t tildes = std::min(static_cast<std::size_t>(d.length) - 1, last > caret + 1 ? last - caret - 1 : 0);
  return text + std::string(tildes, '~');
}
}  // namespace binpick::config
