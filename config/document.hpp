#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "config/findings.hpp"

/// TOML text as a tree of values that know where they stand. The only door to the TOML library.
namespace binpick::config {
struct Member;

struct Value {
  enum class Kind { Flag, Integer, Number, Text, Date, List, Table };
  Kind kind = Kind::Table;
  Place place;  ///< The value itself; of a table its header.
  bool flag = false;
  std::int64_t integer = 0;
  double number = 0;  ///< Also set for an Integer.
  std::string text;
  std::vector<Value> items;     ///< Of a List.
  std::vector<Member> members;  ///< Of a Table, sorted by key.

  const Member* find(std::string_view key) const;
};

struct Member {
  std::string key;
  Place key_place;
  Value value;
};

struct Document {
  std::string file;                ///< As it is named in findings.
  std::string text;                ///< As it was given.
  std::vector<std::string> lines;  ///< Without line ends.
  Value root;
  std::vector<Diagnostic> findings;    ///< Of syntax, in order.
  bool usable = true;                  ///< False: the text could not be understood far enough to check its keys.
  std::set<std::string> damaged_keys;  ///< Keys on lines with a syntax error: they are not missing.
};

/// Larger files are refused: the largest cell file anyone writes by hand has a few hundred lines.
inline constexpr std::size_t kFileBytesMax = 1 << 18;

/// Parses text. A line with a syntax error is reported and skipped, so that one run shows (nearly) all mistakes. Takes
/// any bytes: a byte-order mark and CRLF are accepted, UTF-16 and Latin-1 are refused with a remedy.
Document parse(const std::string& file, std::string_view text);

/// A file that cannot be used, and why: one finding about it as a whole.
Document refused(const std::string& file, std::string message);

/// Reads and parses a file; one that cannot be read (missing, a directory, a device, too large) is a finding.
Document open(const std::string& path);
}  // namespace binpick::config
