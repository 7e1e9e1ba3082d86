#include "vision/calibration/pose_list.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>

#include "base/rotation.hpp"
#include "vision/text_reader.hpp"

namespace binpick::vision::calibration {
namespace {
constexpr std::size_t kRowsMax = 1000;
constexpr double kFar_mm = 1e5;

std::vector<std::string_view> cells_of(std::string_view line) {
  std::vector<std::string_view> cells;
  while (true) {
    const std::size_t end = std::min(line.find_first_of(",;"), line.size());
    std::string_view cell = line.substr(0, end);
    while (!cell.empty() && is_space(cell.front())) cell.remove_prefix(1);
    while (!cell.empty() && is_space(cell.back())) cell.remove_suffix(1);
    cells.push_back(cell);
    if (end == line.size()) return cells;
    line.remove_prefix(end + 1);
  }
}

using Names = std::array<std::string_view, 3>;
struct Convention {
  Names names;
  Eigen::Matrix3d (*rotation)(const Eigen::Vector3d&);
};
constexpr Names kPlace{"x_mm", "y_mm", "z_mm"};
const std::array kConventions{Convention{{"rx_rad", "ry_rad", "rz_rad"}, from_rotation_vector},
                              Convention{{"w_deg", "p_deg", "r_deg"}, from_wpr_deg},
                              Convention{{"o_deg", "a_deg", "t_deg"}, from_oat_deg}};

struct Columns {
  std::size_t count = 0, scan = 0;
  std::array<std::size_t, 3> place{}, turn{};
  const Convention* convention = nullptr;  ///< Null: places only.
};

/// What is wrong with the first line, or nothing.
std::optional<std::string> read_names(const std::vector<std::string_view>& names, Columns& columns) {
  columns.count = names.size();
  const auto at = [&](std::string_view name) {
    return static_cast<std::size_t>(std::ranges::find(names, name) - names.begin());
  };
  const auto three = [&](const Names& wanted, std::array<std::size_t, 3>& out) {
    for (std::size_t i = 0; i < 3; ++i) out[i] = at(wanted[i]);
    return std::ranges::all_of(out, [&](std::size_t column) { return column < names.size(); });
  };
  columns.scan = at("scan");
  if (columns.scan == names.size()) return "no column \"scan\"";
  if (!three(kPlace, columns.place)) return "no columns \"x_mm, y_mm, z_mm\"";
  for (const Convention& convention : kConventions)
    if (columns.convention == nullptr && three(convention.names, columns.turn)) columns.convention = &convention;
  const std::size_t known = columns.convention == nullptr ? 4 : 7;
  if (names.size() != known)
    return "the columns are not scan, x_mm, y_mm, z_mm and one of rx_rad, ry_rad, rz_rad; w_deg, p_deg, r_deg; o_deg, "
           "a_deg, t_deg";
  return std::nullopt;
}

std::optional<Eigen::Vector3d> three_numbers(const std::vector<std::string_view>& cells,
                                             const std::array<std::size_t, 3>& columns) {
  Eigen::Vector3d out;
  for (int i = 0; i < 3; ++i) {
    const auto number = number_of(cells[columns[static_cast<std::size_t>(i)]]);
    if (!number || !std::isfinite(*number) || std::abs(*number) > kFar_mm) return std::nullopt;
    out[i] = *number;
  }
  return out;
}
}  // namespace

Expected<PoseList, std::string> parse_pose_list(std::string_view text, const std::string& path) {
  TextReader reader{std::as_bytes(std::span{text})};
  PoseList list;
  std::optional<Columns> columns;
  std::set<std::string_view> seen;
  for (int number = 1;; ++number) {
    const auto line = reader.line(true);
    if (!line) break;
    const auto wrong = [&](const std::string& what) {
      return unexpected(path + ":" + std::to_string(number) + ": " + what);
    };
    const std::vector<std::string_view> cells = cells_of(*line);
    if (cells.front().starts_with('#') || std::ranges::all_of(cells, &std::string_view::empty)) continue;
    if (!columns) {
      columns.emplace();
      if (const auto trouble = read_names(cells, *columns)) return wrong(*trouble + "; name them in the first line");
      list.places_only = columns->convention == nullptr;
      continue;
    }
    if (cells.size() != columns->count)
      return wrong(std::to_string(cells.size()) + " columns, the first line names " + std::to_string(columns->count) +
                   "; a decimal comma would be one column too many");
    PoseList::Row row{std::string{cells[columns->scan]}};
    if (row.scan.empty()) return wrong("no file in the column \"scan\"; name the scan that was taken at this pose");
    if (!seen.insert(cells[columns->scan]).second)
      return wrong("\"" + row.scan + "\" stands twice; each scan has one pose");
    const auto place = three_numbers(cells, columns->place);
    if (!place) return wrong("x_mm, y_mm, z_mm are not three numbers of millimetres");
    row.T_base_holder.translation() = *place;
    if (columns->convention != nullptr) {
      const auto turn = three_numbers(cells, columns->turn);
      if (!turn) return wrong("the turn is not three numbers");
      row.T_base_holder.linear() = columns->convention->rotation(*turn);
    }
    if (list.rows.size() == kRowsMax) return wrong("more than " + std::to_string(kRowsMax) + " poses; twelve are good");
    list.rows.push_back(std::move(row));
  }
  if (list.rows.empty()) return unexpected(path + ": no poses; the first line names the columns, each other is a scan");
  return list;
}
}  // namespace binpick::vision::calibration
