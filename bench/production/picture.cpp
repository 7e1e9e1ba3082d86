#include "bench/production/picture.hpp"

#include <algorithm>
#include <cstdio>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

namespace binpick::bench {
namespace {
constexpr int kWidth = 900, kRow = 300, kLeft = 150, kRight = 30;
const cv::Scalar kInk{40, 40, 40}, kLight{215, 215, 215};
// Told apart also by those who do not see all colours (Okabe and Ito, 2008); blue, green, red.
const cv::Scalar kBlue{178, 114, 0}, kGreen{115, 158, 0}, kOrange{0, 94, 213}, kYellow{0, 159, 230};

void write(cv::Mat& image, const std::string& text, cv::Point at, double size = 0.45, const cv::Scalar& colour = kInk) {
  cv::putText(image, text, at, cv::FONT_HERSHEY_SIMPLEX, size, colour, 1, cv::LINE_AA);
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.4g", value);
  return text;
}

void histogram(cv::Mat image, const std::string& title, const std::vector<double>& values, double high, double mark,
               const std::string& label) {
  constexpr int kBins = 60, kTop = 40, kBottom = 40;
  std::vector<int> counts(kBins);
  for (const double v : values)
    ++counts[static_cast<std::size_t>(std::clamp(static_cast<int>(v / high * kBins), 0, kBins - 1))];
  const int most = std::max(1, *std::ranges::max_element(counts));
  const int width = image.cols - kLeft - kRight, height = image.rows - kTop - kBottom;
  write(image, title, {kLeft, 24}, 0.5);
  for (int k = 0; k <= 6; ++k) {
    const int x = kLeft + width * k / 6;
    cv::line(image, {x, kTop}, {x, kTop + height}, kLight);
    write(image, number(high * k / 6), {x - 10, kTop + height + 18}, 0.4);
  }
  write(image, std::to_string(most), {kLeft - 45, kTop + 10}, 0.4);
  for (int k = 0; k < kBins; ++k) {
    const int top = height * counts[static_cast<std::size_t>(k)] / most;
    cv::rectangle(image, cv::Point{kLeft + width * k / kBins + 1, kTop + height - top},
                  cv::Point{kLeft + width * (k + 1) / kBins - 1, kTop + height}, kBlue, cv::FILLED);
  }
  const int x = kLeft + static_cast<int>(width * mark / high);
  cv::line(image, {x, kTop}, {x, kTop + height}, kOrange, 2);
  write(image, label, {x + 8, kTop + 14}, 0.42, kOrange);
}

void outcomes(cv::Mat image, const std::vector<const ProductionFigures*>& rows) {
  const int width = image.cols - kLeft - kRight;
  write(image, "What became of the poses sent", {kLeft, 24}, 0.5);
  int y = 44;
  for (const ProductionFigures* f : rows) {
    write(image, f->name, {10, y + 16});
    int x = kLeft;
    const std::pair<int, cv::Scalar> parts[] = {{f->taken, kGreen}, {f->missed, kYellow}, {f->collisions, kOrange}};
    for (const auto& [count, colour] : parts) {
      const int w = f->picks > 0 ? width * count / f->picks : 0;
      cv::rectangle(image, cv::Rect{x, y, w, 22}, colour, cv::FILLED);
      x += w;
    }
    write(image, number(f->share(f->taken)) + " % of " + std::to_string(f->picks), {kLeft + 8, y + 16}, 0.45,
          {255, 255, 255});
    y += 34;
  }
  int x = kLeft;
  for (const auto& [name, colour] :
       {std::pair{"taken", kGreen}, std::pair{"missed", kYellow}, std::pair{"collision", kOrange}}) {
    cv::rectangle(image, cv::Rect{x, y + 8, 14, 14}, colour, cv::FILLED);
    write(image, name, {x + 20, y + 20});
    x += 130;
  }
}
}  // namespace

void draw_production(const std::string& path, const std::vector<ProductionFigures>& parts,
                     const ProductionFigures& all) {
  cv::Mat image(3 * kRow, kWidth, CV_8UC3, cv::Scalar{255, 255, 255});
  std::vector<const ProductionFigures*> rows;
  for (const ProductionFigures& part : parts) rows.push_back(&part);
  rows.push_back(&all);
  outcomes(image.rowRange(0, kRow), rows);
  histogram(image.rowRange(kRow, 2 * kRow),
            "Scans by hypotheses rendered up to the first valid pose (the last bar: and more)", all.first_hypotheses,
            600, 200, "200: over 40 % published");
  histogram(image.rowRange(2 * kRow, 3 * kRow), "Scans by ms to the first valid pose (the last bar: and more)",
            all.first_ms, 600, 150, "150 ms: over 40 % published");
  if (!cv::imwrite(path, image)) throw std::runtime_error(path + ": cannot be written");
  std::printf("\n%s\n", path.c_str());
}
}  // namespace binpick::bench
