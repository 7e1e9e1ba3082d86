#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string_view>
#include <vector>

#include "tests/support/sphere_scans.hpp"

/// bench/calibration [--seeds N] [--scans N] [--each]: what `binpick calibrate` says of its own error, beside the error
/// that the emulator knows. One row for each scanner on each carrier: medians over the seeds.
namespace {
using namespace binpick;

double median(std::vector<double> values) {
  if (values.empty()) return NAN;
  std::ranges::sort(values);
  const std::size_t n = values.size();
  return (values[(n - 1) / 2] + values[n / 2]) / 2;
}

struct Row {
  const char* name;
  support::SphereScanner scanner;
  support::SphereCarrier carrier;
};
constexpr std::array kRows{
    Row{"lms400, pivot", support::SphereScanner::Lms400, support::SphereCarrier::Pivot},
    Row{"lms400, robot", support::SphereScanner::Lms400, support::SphereCarrier::Robot},
    Row{"lps36, pivot", support::SphereScanner::Lps36, support::SphereCarrier::Pivot},
    Row{"lps36, robot", support::SphereScanner::Lps36, support::SphereCarrier::Robot},
};

void measure(const Row& row, int seeds, int scans, bool each) {
  std::vector<double> before, truths, held, ratios, left_out;
  int covered = 0, refused = 0;
  for (int seed = 1; seed <= seeds; ++seed) {
    const auto emulated = support::scan_spheres(
        {.scanner = row.scanner, .carrier = row.carrier, .scans = scans, .seed = static_cast<std::uint64_t>(seed)});
    const auto answer = vision::calibration::calibrate(emulated.question);
    if (!answer) {
      std::fprintf(stderr, "%s, seed %d: %s\n", row.name, seed, answer.error().c_str());
      ++refused;
      continue;
    }
    const double truth = support::true_error_mm(emulated, *answer);
    auto unchanged = *answer;
    unchanged.mount = emulated.question.present.mount;
    before.push_back(support::true_error_mm(emulated, unchanged));
    truths.push_back(truth);
    held.push_back(answer->hold_out_mm);
    left_out.push_back(answer->left_out_mm);
    ratios.push_back(answer->hold_out_mm / truth);
    covered += truth <= answer->hold_out_95_mm ? 1 : 0;
    if (each)
      std::printf(
          "  seed %2d: true %.3f mm, hold-out %.3f ± %.3f mm, 95 %% below %.3f mm; left out %.3f ± %.3f mm, point "
          "sd %.2f mm, place sd %.3f mm\n",
          seed, truth, answer->hold_out_mm, answer->hold_out_se_mm, answer->hold_out_95_mm, answer->left_out_mm,
          answer->left_out_se_mm, answer->point_sd_mm, answer->place_sd_mm);
  }
  std::printf("%-14s  %8.1f  %8.3f  %8.3f  %+5.0f %%  %8.2f  %8.3f  %5d of %-3zu  %d\n", row.name, median(before),
              median(held), median(truths), 100 * (median(held) / median(truths) - 1), median(ratios), median(left_out),
              covered, truths.size(), refused);
  std::fflush(stdout);
}
}  // namespace

int main(int argc, char** argv) {
  int seeds = 20, scans = 12;
  bool each = false;
  std::string_view only;
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    if (word == "--each") {
      each = true;
    } else if (word == "--seeds" && i + 1 < argc) {
      seeds = static_cast<int>(std::strtol(argv[++i], nullptr, 10));
    } else if (word == "--scans" && i + 1 < argc) {
      scans = static_cast<int>(std::strtol(argv[++i], nullptr, 10));
    } else if (word == "--only" && i + 1 < argc) {
      only = argv[++i];
    } else {
      std::fprintf(stderr, "calibration [--seeds N] [--scans N] [--only TEXT] [--each]\n");
      return 2;
    }
  }
  std::printf("Medians of %d seeds, %d scans each, mm. Simulation.\n", seeds, scans);
  std::printf("%-14s  %8s  %8s  %8s  %7s  %8s  %8s  %-12s  %s\n", "scanner", "before", "hold-out", "true", "apart",
              "ratio", "left out", "95 % bound", "refused");
  for (const Row& row : kRows)
    if (std::string_view{row.name}.find(only) != std::string_view::npos) measure(row, seeds, scans, each);
  return 0;
}
