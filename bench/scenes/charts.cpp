#include "bench/scenes/charts.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <stdexcept>

namespace binpick::bench {
namespace {
using Eigen::Vector2d;

constexpr double kWidth = 640, kHeight = 420, kLeft = 64, kRight = 24, kTop = 40, kBottom = 52;
// Told apart also by those who do not see all colours (Okabe and Ito, 2008).
constexpr std::array kColours{"#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00"};

std::string number(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.6g", std::abs(value) < 1e-9 ? 0 : value);
  return text.data();
}
std::string pixel(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.1f", value);
  return text.data();
}

class Chart {
 public:
  Chart(const std::string& title, const Axis& x, const Axis& y) : x_{x}, y_{y} {
    svg_ = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"" + number(kWidth) + "\" height=\"" + number(kHeight) +
           "\" font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n";
    text(kWidth / 2, 22, title, "middle", 14);
    text(kWidth / 2, kHeight - 12, x.name, "middle");
    svg_ += "<text transform=\"translate(16 " + number((kTop + kHeight - kBottom) / 2) +
            ") rotate(-90)\" text-anchor=\"middle\">" + y.name + "</text>\n";
    for (int k = 0; k <= x.ticks; ++k) {
      const double at = x.low + (x.high - x.low) * k / x.ticks;
      line({at, y.low}, {at, y.high}, "#dddddd");
      text(place({at, y.low}).x(), kHeight - kBottom + 16, number(at), "middle");
    }
    for (int k = 0; k <= y.ticks; ++k) {
      const double at = y.low + (y.high - y.low) * k / y.ticks;
      line({x.low, at}, {x.high, at}, "#dddddd");
      text(kLeft - 6, place({x.low, at}).y() + 4, number(at), "end");
    }
  }

  Vector2d place(const Vector2d& p) const {
    const double u = std::clamp((p.x() - x_.low) / (x_.high - x_.low), 0.0, 1.0),
                 v = std::clamp((p.y() - y_.low) / (y_.high - y_.low), 0.0, 1.0);
    return {kLeft + u * (kWidth - kLeft - kRight), kHeight - kBottom - v * (kHeight - kTop - kBottom)};
  }
  void text(double x, double y, const std::string& what, const char* anchor, int size = 12) {
    svg_ += "<text x=\"" + pixel(x) + "\" y=\"" + pixel(y) + "\" text-anchor=\"" + anchor + "\" font-size=\"" +
            std::to_string(size) + "\">" + what + "</text>\n";
  }
  void line(const Vector2d& from, const Vector2d& to, const char* colour, bool dashed = false) {
    path({place(from), place(to)}, colour, 1, dashed);
  }
  void path(const std::vector<Vector2d>& pixels, const char* colour, double width, bool dashed) {
    svg_ += "<polyline fill=\"none\" stroke=\"" + std::string{colour} + "\" stroke-width=\"" + number(width) + "\"" +
            (dashed ? " stroke-dasharray=\"6 4\"" : "") + " points=\"";
    for (const Vector2d& p : pixels) svg_ += pixel(p.x()) + "," + pixel(p.y()) + " ";
    svg_ += "\"/>\n";
  }
  void dot(const Vector2d& p, const char* colour) {
    const Vector2d at = place(p);
    svg_ += "<circle cx=\"" + pixel(at.x()) + "\" cy=\"" + pixel(at.y()) + "\" r=\"3.5\" fill=\"" + colour + "\"/>\n";
  }
  void bar(double low, double high, double top) {
    const Vector2d a = place({low, 0}), b = place({high, top});
    svg_ += "<rect x=\"" + pixel(a.x() + 0.5) + "\" y=\"" + pixel(b.y()) + "\" width=\"" + pixel(b.x() - a.x() - 1) +
            "\" height=\"" + pixel(a.y() - b.y()) + "\" fill=\"" + kColours[0] + "\"/>\n";
  }
  std::string finished() const { return svg_ + "</svg>\n"; }

 private:
  Axis x_, y_;
  std::string svg_;
};
}  // namespace

std::string line_chart(const std::string& title, const Axis& x, const Axis& y, const std::vector<Series>& series,
                       double legend_at) {
  Chart chart{title, x, y};
  const double legend_x = kLeft + 10 + legend_at * (kWidth - kLeft - kRight);
  double legend = kHeight - kBottom - 8 - 16 * static_cast<double>(series.size() - 1);
  for (std::size_t k = 0; k < series.size(); ++k) {
    const char* colour = kColours[k % kColours.size()];
    std::vector<Vector2d> pixels;
    for (const Vector2d& p : series[k].points) {
      const Vector2d at = chart.place(p);
      if (series[k].steps && !pixels.empty()) pixels.push_back({pixels.back().x(), at.y()});
      pixels.push_back(at);
      if (series[k].dots) chart.dot(p, colour);
    }
    chart.path(pixels, colour, 2, series[k].dashed);
    if (!series[k].points.empty() && !series[k].dashed) chart.dot(series[k].points.back(), colour);
    chart.path({{legend_x, legend - 4}, {legend_x + 24, legend - 4}}, colour, 2, series[k].dashed);
    chart.text(legend_x + 30, legend, series[k].name, "start");
    legend += 16;
  }
  return chart.finished();
}

std::string histogram(const std::string& title, const Axis& x, int bins, const std::vector<double>& values, double mark,
                      const std::string& label) {
  std::vector<double> counts(static_cast<std::size_t>(bins));
  for (const double value : values) {
    const double at = std::floor((value - x.low) / (x.high - x.low) * bins);
    ++counts[static_cast<std::size_t>(std::clamp(at, 0.0, bins - 1.0))];
  }
  const double most = std::max(1.0, *std::ranges::max_element(counts));
  const double step = std::pow(10, std::floor(std::log10(most)));
  const Axis y{"scenes", 0, step * std::ceil(most / step), static_cast<int>(std::ceil(most / step))};
  Chart chart{title, x, y};
  const double width = (x.high - x.low) / bins;
  for (int k = 0; k < bins; ++k)
    chart.bar(x.low + k * width, x.low + (k + 1) * width, counts[static_cast<std::size_t>(k)]);
  chart.line({mark, 0}, {mark, y.high}, kColours[1], true);
  const Vector2d at = chart.place({mark, y.high});
  chart.text(at.x() + 6, at.y() + 14, label, "start");
  return chart.finished();
}

void write_text(const std::string& path, const std::string& text) {
  std::ofstream out{path};
  out << text;
  if (!out.flush()) throw std::runtime_error{path + ": cannot be written; check folder and free space"};
  std::printf("%s\n", path.c_str());
}
}  // namespace binpick::bench
