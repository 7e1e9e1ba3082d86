#include "bench/production/figures.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <functional>
#include <map>

#include "plc/alarms.hpp"

namespace binpick::bench {
namespace {
const std::string kNotLocated = "alarm " + std::to_string(static_cast<int>(plc::Alarm::SupplyNotFound));

[[gnu::format(printf, 1, 2)]] std::string text(const char* format, ...) {
  std::array<char, 240> line{};
  std::va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(line.data(), line.size(), format, arguments);
  va_end(arguments);
  return line.data();
}

double below(const std::vector<double>& values, double limit) {
  if (values.empty()) return 0;
  return 100.0 * static_cast<double>(std::ranges::count_if(values, [&](double v) { return v < limit; })) /
         static_cast<double>(values.size());
}
}  // namespace

Spread spread(std::vector<double> values) {
  if (values.empty()) return {};
  std::ranges::sort(values);
  const auto at = [&](double share) {
    return values[static_cast<std::size_t>(std::lround(share * static_cast<double>(values.size() - 1)))];
  };
  return {at(0.5), at(0.95)};
}

ProductionFigures figures_of(const std::string& name, const std::vector<PartRun>& runs, const RobotModel& robot) {
  ProductionFigures f;
  f.name = name;
  std::vector<double> cycles, without, mm, deg, place_mm, place_deg;
  for (const PartRun& run : runs) {
    std::map<std::uint64_t, int> takeable;
    for (const BinRecord& bin : run.bins) {
      ++f.bins;
      f.objects += bin.objects;
      f.left += bin.left;
      f.takeable += bin.takeable;
      f.cpu_s += bin.cpu_s;
      takeable[bin.bin] = bin.takeable;
    }
    for (const RequestRecord& r : run.requests) {
      ++f.requests;
      f.scans += r.scanned;
      if (r.scanned) {
        f.detection_ms.push_back(r.detection_ms);
        f.hypotheses.push_back(static_cast<double>(r.hypotheses));
        if (r.first_ms > 0) {
          f.first_ms.push_back(r.first_ms);
          f.first_hypotheses.push_back(static_cast<double>(r.first_hypotheses));
        }
      }
      if (r.place_mm > 0) {
        place_mm.push_back(r.place_mm);
        place_deg.push_back(r.place_deg);
      }
      f.not_located += r.answer == kNotLocated;
      f.available += r.answer == "pick" || (r.answer == "empty" && r.left_before == 0);
      f.truly_unreachable += r.answer == "not_reachable" && takeable[r.bin] == 0;
      if (r.answer != "pick") continue;
      ++f.picks;
      f.taken += r.grip == "taken";
      f.missed += r.grip == "missed";
      f.collisions += r.grip == "collision";
      f.wrong += r.wrong;
      f.retries += r.retry;
      mm.push_back(r.error_mm);
      deg.push_back(r.error_deg);
      if (r.fault) continue;  // its time is of the fault
      cycles.push_back(std::max(r.scan_s, robot.place_s) + r.robot_s);
      without.push_back(r.scan_s + r.robot_s + robot.place_s);
    }
  }
  f.cycle_s = spread(std::move(cycles));
  f.cycle_without_overlap_s = spread(std::move(without));
  f.error_mm = spread(std::move(mm));
  f.error_deg = spread(std::move(deg));
  f.place_mm = spread(std::move(place_mm));
  f.place_deg = spread(std::move(place_deg));
  return f;
}

std::vector<ProductionDemand> demands(const ProductionFigures& all) {
  return {{"right picks %", all.share(all.taken), 97, 99, true},
          {"wrong poses sent %", all.share(all.wrong), 1, 0.3, false},
          {"collisions %", all.share(all.collisions), 1, 0.3, false},
          {"left over %", all.left_percent(), 4, 2, false},
          {"availability %", all.availability_percent(), 99.5, 99.9, true},
          {"CPU seconds per pick", all.cpu_s_per_pick(), 2, 2, false}};
}

std::string to_table(const std::vector<ProductionFigures>& parts, const ProductionFigures& all) {
  std::vector<const ProductionFigures*> columns;
  for (const ProductionFigures& part : parts) columns.push_back(&part);
  columns.push_back(&all);
  std::string out = "| |";
  for (const auto* c : columns) out += " " + c->name + " |";
  out += "\n|---|";
  for (std::size_t i = 0; i < columns.size(); ++i) out += "---|";
  out += "\n";
  using F = const ProductionFigures&;
  const auto row = [&](const char* what, const std::function<std::string(F)>& cell) {
    out += std::string{"| "} + what + " |";
    for (const auto* c : columns) out += " " + cell(*c) + " |";
    out += "\n";
  };
  row("poses sent, requests", [](F f) { return text("%d, %d", f.picks, f.requests); });
  row("bins, objects", [](F f) { return text("%d, %d", f.bins, f.objects); });
  row("right picks %", [](F f) { return text("%.2f", f.share(f.taken)); });
  row("wrong poses sent %", [](F f) { return text("%.2f", f.share(f.wrong)); });
  row("collisions %", [](F f) { return text("%.2f", f.share(f.collisions)); });
  row("missed %", [](F f) { return text("%.2f", f.share(f.missed)); });
  row("left over %", [](F f) { return text("%.2f", f.left_percent()); });
  row("of them with a free grasp %",
      [](F f) { return text("%.2f", f.objects > 0 ? 100.0 * f.takeable / f.objects : 0.0); });
  row("availability %", [](F f) { return text("%.2f", f.availability_percent()); });
  row("with true \"not reachable\" %", [](F f) {
    return text("%.2f", f.requests > 0 ? 100.0 * (f.available + f.truly_unreachable) / f.requests : 0.0);
  });
  row("retries (a failed object, once more)", [](F f) { return text("%d", f.retries); });
  row("picks per scan", [](F f) { return text("%.2f", f.picks_per_scan()); });
  row("pose error mm p50 / p95", [](F f) { return text("%.2f / %.2f", f.error_mm.p50, f.error_mm.p95); });
  row("pose error deg p50 / p95", [](F f) { return text("%.2f / %.2f", f.error_deg.p50, f.error_deg.p95); });
  if (all.place_mm.p95 > 0) {
    row("supply located: error mm p50 / p95", [](F f) { return text("%.2f / %.2f", f.place_mm.p50, f.place_mm.p95); });
    row("supply located: error deg p50 / p95",
        [](F f) { return text("%.2f / %.2f", f.place_deg.p50, f.place_deg.p95); });
    row("scans in which it was not", [](F f) { return text("%d", f.not_located); });
  }
  row("cycle s p50 / p95, overlapped", [](F f) { return text("%.1f / %.1f", f.cycle_s.p50, f.cycle_s.p95); });
  row("cycle s p50 / p95, without overlap",
      [](F f) { return text("%.1f / %.1f", f.cycle_without_overlap_s.p50, f.cycle_without_overlap_s.p95); });
  row("detection ms p50 / p95",
      [](F f) { return text("%.0f / %.0f", spread(f.detection_ms).p50, spread(f.detection_ms).p95); });
  row("hypotheses tested p50 / p95",
      [](F f) { return text("%.0f / %.0f", spread(f.hypotheses).p50, spread(f.hypotheses).p95); });
  row("a valid object in < 150 ms % (published: over 40)", [](F f) { return text("%.1f", below(f.first_ms, 150)); });
  row("with < 200 hypotheses % (published: over 40)", [](F f) { return text("%.1f", below(f.first_hypotheses, 200)); });
  row("CPU s per pick", [](F f) { return text("%.2f", f.cpu_s_per_pick()); });
  out += "\n| | here | must | aim | |\n|---|---|---|---|---|\n";
  for (const ProductionDemand& d : demands(all))
    out += text("| %s | %.2f | %s %g | %g | %s |\n", d.what.c_str(), d.here, d.at_least ? ">=" : "<=", d.must, d.aim,
                d.meets_aim()    ? "aim reached"
                : d.meets_must() ? "must reached"
                                 : "MISSED");
  return out;
}
}  // namespace binpick::bench
