#pragma once

#include <algorithm>

/// A sequence as a table: rows with `from`, `on`, `to` and `effect`.
namespace binpick {
/// nullptr: the input means nothing in this state and changes nothing.
constexpr auto find_row(const auto& rows, auto from, auto on) -> decltype(&*rows.begin()) {
  const auto row = std::ranges::find_if(rows, [&](const auto& r) { return r.from == from && r.on == on; });
  return row == rows.end() ? nullptr : &*row;
}

/// Counted and not by comparing pointers: g++ 12 does not take those for constant under its undefined-behaviour
/// sanitizer (GCC bug 71962).
constexpr bool rows_are_unique(const auto& rows) {
  return std::ranges::all_of(rows, [&](const auto& row) {
    return std::ranges::count_if(rows, [&](const auto& r) { return r.from == row.from && r.on == row.on; }) == 1;
  });
}
}  // namespace binpick
