#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "config/config.hpp"

/// Findings in a file, and how they are told: place, sentence, remedy.
namespace binpick::config {
/// A stretch of one line. Lines and columns count from 1, columns in characters (not bytes); line 0: the file as a
/// whole.
struct Place {
  int line = 0;
  int column = 1;
  int length = 1;
};

/// Gathers the findings of one file. A file can hold thousands of mistakes (a wrong file given): what is beyond
/// kFindingsMax is counted, not kept.
class Findings {
 public:
  static constexpr std::size_t kFindingsMax = 100;

  Findings(std::string file, std::vector<std::string> lines) : file_{std::move(file)}, lines_{std::move(lines)} {}

  /// `message` says what is wrong; and, after a semicolon, what to do.
  void add(const Place& place, std::string message);
  /// The same, not kept.
  Diagnostic at(const Place& place, std::string message = {}) const;
  bool empty() const { return findings_.empty(); }
  /// In the order of the file.
  std::vector<Diagnostic> take();

 private:
  std::string file_;
  std::vector<std::string> lines_;
  std::vector<Diagnostic> findings_;
  std::size_t dropped_ = 0;
};

/// The candidate that `word` was probably meant to be, empty when none is near. Swapped neighbours count as one slip.
std::string nearest(std::string_view word, const std::vector<std::string>& candidates);
/// Bytes of the UTF-8 character that begins at `at`, 0 when none does.
std::size_t utf8_bytes(std::string_view text, std::size_t at);
/// Characters of UTF-8 text; a byte that belongs to none counts as one.
std::size_t characters(std::string_view utf8);
/// For showing on a terminal: control characters and bytes that are not UTF-8 become '?', a tab a blank.
std::string printable(std::string_view text);
}  // namespace binpick::config
