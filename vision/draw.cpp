#include "vision/draw.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "vision/rasteriser.hpp"
#include "vision/scene.hpp"
#include "vision/swept.hpp"

namespace binpick::vision {
namespace {
constexpr int kScaleMax = 16;
constexpr int kLegendPx = 96;
constexpr std::size_t kRejectedDrawn = 6;
const cv::Scalar kInk{235, 235, 235}, kRejectedInk{200, 170, 150}, kHalo{20, 20, 20}, kChosen{255, 200, 0},
    kGripper{240, 110, 255};

/// Where supply coordinates fall in the picture: x to the right, y up, as seen from above.
struct Canvas {
  cv::Mat picture;
  int scale = 1;
  int rows = 0;
  double pixel_mm = 1;
  Eigen::Vector2d origin_mm = Eigen::Vector2d::Zero();

  cv::Point2d at(double x_mm, double y_mm) const {
    return {((x_mm - origin_mm.x()) / pixel_mm + 0.5) * scale,
            (rows - 0.5 - (y_mm - origin_mm.y()) / pixel_mm) * scale};
  }
};

cv::Scalar colour_of(double score) {
  // Red over yellow to green.
  const double s = std::clamp(score, 0.0, 1.0);
  return {40, 255 * std::min(1.0, 2 * s), 255 * std::min(1.0, 2 - 2 * s)};
}

struct HeightRange {
  float low = 0, high = 1;
};

/// Of what lies in the supply: the border, where the walls stand, does not count, nor do the last few pixels at either
/// end. At least `span_min`, so that the noise of a bare floor stays a flat colour.
HeightRange height_range(const DepthImage& image, float span_min) {
  const Eigen::Index rows = image.z_mm.rows(), cols = image.z_mm.cols();
  const Eigen::Index row_margin = rows / 20, col_margin = cols / 20;
  std::vector<float> z;
  for (Eigen::Index r = row_margin; r < rows - row_margin; ++r)
    for (Eigen::Index c = col_margin; c < cols - col_margin; ++c)
      if (std::isfinite(image.z_mm(r, c))) z.push_back(image.z_mm(r, c));
  if (z.empty()) return {};
  std::sort(z.begin(), z.end());
  const HeightRange range{z[z.size() / 100], z[z.size() - 1 - z.size() / 200]};
  return {range.low, std::max(range.high, range.low + span_min)};
}

cv::Vec3b height_colour(float share) {
  // Dark blue (deep) to pale sand (high): leaves red, yellow and green to the outlines.
  const std::array<cv::Vec3f, 4> stops{{{70, 38, 28}, {130, 88, 62}, {165, 150, 128}, {215, 226, 232}}};
  const float x = std::clamp(share, 0.0F, 1.0F) * 3;
  const int i = std::min(2, static_cast<int>(x));
  const float f = x - static_cast<float>(i);
  const auto k = static_cast<std::size_t>(i);
  const cv::Vec3f c = stops[k] * (1 - f) + stops[k + 1] * f;
  return {cv::saturate_cast<uchar>(c[0]), cv::saturate_cast<uchar>(c[1]), cv::saturate_cast<uchar>(c[2])};
}

/// Each height the median of its neighbourhood; what was not measured stays so.
DepthImage without_noise(DepthImage image) {
  const auto rows = static_cast<int>(image.z_mm.rows()), cols = static_cast<int>(image.z_mm.cols());
  cv::Mat z(rows, cols, CV_32F), calm;
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < cols; ++c) z.at<float>(r, c) = std::isfinite(image.z_mm(r, c)) ? image.z_mm(r, c) : 0;
  cv::medianBlur(z, calm, 5);
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < cols; ++c)
      if (std::isfinite(image.z_mm(r, c))) image.z_mm(r, c) = calm.at<float>(r, c);
  return image;
}

/// Height as colour, light from the upper left; what was not measured is nearly black.
cv::Mat shaded(const DepthImage& image, const HeightRange& range, int scale) {
  const auto rows = static_cast<int>(image.z_mm.rows()), cols = static_cast<int>(image.z_mm.cols());
  cv::Mat picture(rows, cols, CV_8UC3);
  const auto pixel_mm = static_cast<float>(image.pixel_mm);
  for (int r = 0; r < rows; ++r)
    for (int c = 0; c < cols; ++c) {
      cv::Vec3b& out = picture.at<cv::Vec3b>(rows - 1 - r, c);
      const float z = image.z_mm(r, c);
      if (!std::isfinite(z)) {
        out = {24, 18, 18};
        continue;
      }
      const auto step = [&](int dr, int dc) {
        const int a = std::clamp(r + dr, 0, rows - 1), b = std::clamp(c + dc, 0, cols - 1);
        const float other = image.z_mm(a, b);
        return std::isfinite(other) ? std::clamp(other - z, -3 * pixel_mm, 3 * pixel_mm) : 0.0F;
      };
      const float slope_x = (step(0, 1) - step(0, -1)) / (2 * pixel_mm);
      const float slope_y = (step(1, 0) - step(-1, 0)) / (2 * pixel_mm);
      const float light =
          (0.45F * slope_x - 0.45F * slope_y + 0.77F) / std::sqrt(1 + slope_x * slope_x + slope_y * slope_y);
      const float shade = 0.45F + 0.75F * std::clamp(light, 0.0F, 1.0F);
      const cv::Vec3b colour = height_colour((z - range.low) / (range.high - range.low));
      for (int k = 0; k < 3; ++k) out[k] = cv::saturate_cast<uchar>(shade * static_cast<float>(colour[k]));
    }
  cv::Mat large;
  cv::resize(picture, large, {cols * scale, rows * scale}, 0, 0, cv::INTER_CUBIC);
  return large;
}

/// One closed line of a silhouette, in the picture's pixels.
struct Contour {
  std::vector<cv::Point> points;
  std::vector<char> hidden;  ///< Something measured lies above the part there.
};

/// Silhouette of the part at a pose, holes included.
std::vector<Contour> outline_of(const Canvas& canvas, const DepthImage& image, const Rasteriser& part, float jump_mm,
                                const Transform<frame::Supply, frame::Object>& T) {
  const double fine_mm = canvas.pixel_mm / canvas.scale;
  Template drawn;
  part.draw(T.iso.linear().cast<float>(), T.iso.translation().cast<float>(), fine_mm, canvas.origin_mm, drawn);
  if (drawn.rows == 0 || drawn.cols == 0) return {};
  cv::Mat mask = cv::Mat::zeros(drawn.rows + 2, drawn.cols + 2, CV_8U);
  for (int r = 0; r < drawn.rows; ++r)
    for (int c = 0; c < drawn.cols; ++c)
      if (drawn.triangle[drawn.at(r, c)] >= 0) mask.at<uchar>(r + 1, c + 1) = 255;
  std::vector<std::vector<cv::Point>> lines;
  cv::findContours(mask, lines, cv::RETR_CCOMP, cv::CHAIN_APPROX_NONE);
  std::vector<Contour> outline;
  for (const auto& line : lines) {
    if (line.size() < 12) continue;
    Contour contour;
    for (const cv::Point& p : line) {
      const double x_mm = canvas.origin_mm.x() + (p.x - 1 + drawn.col0) * fine_mm;
      const double y_mm = canvas.origin_mm.y() + (p.y - 1 + drawn.row0) * fine_mm;
      contour.points.emplace_back(canvas.at(x_mm, y_mm));
      const auto col = static_cast<Eigen::Index>(std::lround((x_mm - image.origin_mm.x()) / image.pixel_mm));
      const auto row = static_cast<Eigen::Index>(std::lround((y_mm - image.origin_mm.y()) / image.pixel_mm));
      const bool inside = row >= 0 && col >= 0 && row < image.z_mm.rows() && col < image.z_mm.cols();
      const int r = std::clamp(p.y - 1, 0, drawn.rows - 1), c = std::clamp(p.x - 1, 0, drawn.cols - 1);
      contour.hidden.push_back(inside && image.z_mm(row, col) - drawn.top_mm[drawn.at(r, c)] > jump_mm);
    }
    outline.push_back(std::move(contour));
  }
  return outline;
}

void draw_dashed(cv::Mat& picture, const Contour& contour, const cv::Scalar& colour, bool only_hidden) {
  constexpr std::size_t kDash = 9;
  for (std::size_t k = 0; k + 1 < contour.points.size(); ++k)
    if (k / kDash % 2 == 0 && (!only_hidden || contour.hidden[k]))
      cv::line(picture, contour.points[k], contour.points[k + 1], colour, 1, cv::LINE_AA);
}

/// Whole where the part is seen, fine dots where it is hidden.
void draw_outline(cv::Mat& picture, const std::vector<Contour>& outline, const cv::Scalar& colour, int width) {
  for (const auto& [pen, ink] : {std::pair{width + 2, kHalo}, {width, colour}})
    for (const Contour& contour : outline)
      for (std::size_t k = 0; k < contour.points.size(); ++k)
        if (!contour.hidden[k])
          cv::line(picture, contour.points[k], contour.points[(k + 1) % contour.points.size()], ink, pen, cv::LINE_AA);
  for (const Contour& contour : outline) draw_dashed(picture, contour, colour, true);
}

void write_text(cv::Mat& picture, const std::string& text, cv::Point at, double size, const cv::Scalar& colour,
                bool centred) {
  int below = 0;
  const cv::Size extent = cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, size, 1, &below);
  if (centred) at.x -= extent.width / 2;
  at.x = std::clamp(at.x, 3, std::max(3, picture.cols - extent.width - 3));
  at.y = std::clamp(at.y, extent.height + 3, std::max(extent.height + 3, picture.rows - 4));
  cv::putText(picture, text, at, cv::FONT_HERSHEY_SIMPLEX, size, kHalo, 4, cv::LINE_AA);
  cv::putText(picture, text, at, cv::FONT_HERSHEY_SIMPLEX, size, colour, 1, cv::LINE_AA);
}

template <class... Values>
std::string format(const char* pattern, Values... values) {
  std::array<char, 200> line{};
  std::snprintf(line.data(), line.size(), pattern, values...);
  return line.data();
}

cv::Mat legend(const Canvas& canvas, const KnowledgeBase& part, const DetectionReport& report, const HeightRange& range,
               bool chosen) {
  cv::Mat strip(kLegendPx, canvas.picture.cols, CV_8UC3, cv::Scalar{32, 26, 26});
  write_text(strip,
             format("%s: %zu detected, %zu rejected of %zu hypotheses at %zu maxima, %.0f ms", part.part_name().c_str(),
                    report.detections.size(), report.rejected.size(), report.hypotheses, report.maxima, report.time_ms),
             {16, 30}, 0.6, kInk, false);
  // A bar of 100 mm, or 10 on a small scene.
  const double fine_mm = canvas.pixel_mm / canvas.scale;
  const int bar_mm = 100 / fine_mm < 0.3 * strip.cols ? 100 : 10;
  const int bar_px = static_cast<int>(std::lround(bar_mm / fine_mm));
  cv::line(strip, {16, 64}, {16 + bar_px, 64}, kInk, 2);
  write_text(strip, format("%d mm", bar_mm), {16, 84}, 0.45, kInk, false);
  int x = 16 + std::max(bar_px, 60) + 30;
  for (int k = 0; k < 120; ++k) {
    const cv::Vec3b c = height_colour(static_cast<float>(k) / 119);
    cv::line(strip, {x + k, 54}, {x + k, 68}, cv::Scalar(c[0], c[1], c[2]), 1);
  }
  write_text(strip, format("height %.0f ... %.0f mm", range.low, range.high), {x, 84}, 0.45, kInk, false);
  x += 200;
  for (int k = 0; k < 120; ++k) cv::line(strip, {x + k, 54}, {x + k, 68}, colour_of(k / 119.0), 1);
  write_text(strip, "score 0 ... 1", {x, 84}, 0.45, kInk, false);
  x += 160;
  if (chosen) {
    cv::line(strip, {x, 61}, {x + 46, 61}, kChosen, 5);
    write_text(strip, "chosen", {x, 84}, 0.45, kInk, false);
    x += 90;
    cv::line(strip, {x, 61}, {x + 46, 61}, kGripper, 3);
    write_text(strip, "its grasp", {x, 84}, 0.45, kInk, false);
    x += 100;
  }
  for (int k = 0; k < 46; k += 10) cv::line(strip, {x + k, 61}, {x + k + 5, 61}, kRejectedInk, 1);
  write_text(strip, "rejected", {x, 84}, 0.45, kInk, false);
  return strip;
}

/// Jaws as they come in, filled, and the body above them as lines, from above.
void draw_gripper(Canvas& canvas, const Reachable& chosen, const Gripper& gripper, const Grasp& grasp, int pen) {
  const std::vector<Gripper::Solid> solids =
      solids_of(gripper, grasp.opening_mm.value_or(gripper.jaws ? gripper.jaws->opening_max_mm : 0));
  for (std::size_t i = 0; i < solids.size(); ++i) {
    const Swept body{solids[i], chosen.T_supply_grasp.iso, Eigen::Vector3d::Zero()};
    std::vector<cv::Point> corners, outline;
    for (std::size_t signs = 0; signs < std::size_t{1} << body.edges_mm().size(); ++signs) {
      Eigen::Vector3d corner = body.middle_mm();
      for (std::size_t k = 0; k < body.edges_mm().size(); ++k)
        corner += ((signs >> k & 1) != 0 ? 1.0 : -1.0) * body.edges_mm()[k];
      corners.emplace_back(canvas.at(corner.x(), corner.y()));
    }
    cv::convexHull(corners, outline);
    cv::polylines(canvas.picture, outline, true, kHalo, 3 * pen, cv::LINE_AA);
    cv::polylines(canvas.picture, outline, true, kGripper, pen, cv::LINE_AA);
    if (i >= gripper.body.size()) cv::fillConvexPoly(canvas.picture, outline, kGripper, cv::LINE_AA);
  }
}

void draw_grasp(Canvas& canvas, const Reachable& chosen, int pen) {
  const Eigen::Vector3d grasp = chosen.T_supply_grasp.iso.translation();
  const Eigen::Vector3d from = chosen.T_supply_approach.iso.translation();
  const cv::Point at = canvas.at(grasp.x(), grasp.y()), start = canvas.at(from.x(), from.y());
  cv::line(canvas.picture, start, at, kHalo, 5 * pen, cv::LINE_AA);
  cv::line(canvas.picture, start, at, kGripper, 3 * pen, cv::LINE_AA);
  cv::circle(canvas.picture, at, 7 * pen, kHalo, 4 * pen, cv::LINE_AA);
  cv::circle(canvas.picture, at, 7 * pen, kGripper, 2 * pen, cv::LINE_AA);
}
}  // namespace

Expected<void, std::string> draw_report(const std::string& png_path, const DepthImage& image, const KnowledgeBase& part,
                                        const DetectionReport& report, const Reachable* chosen, const Gripper* gripper,
                                        const Grasp* grasp, const DrawStyle& style) {
  if (image.z_mm.size() == 0) return unexpected(png_path + ": there is no depth image to draw; give one with pixels");
  const auto cols = static_cast<int>(image.z_mm.cols());
  Canvas canvas;
  canvas.scale = std::clamp((style.width_min_px + cols - 1) / cols, 1, kScaleMax);
  canvas.rows = static_cast<int>(image.z_mm.rows());
  canvas.pixel_mm = image.pixel_mm;
  canvas.origin_mm = image.origin_mm;
  const HeightRange range = style.height_max_mm ? HeightRange{0, static_cast<float>(*style.height_max_mm)}
                                                : height_range(image, static_cast<float>(part.diameter_mm()) / 4);
  canvas.picture = shaded(style.noise ? image : without_noise(image), range, canvas.scale);

  const Rasteriser rasteriser{part.mesh()};
  const float jump_mm = jump_of(part.noise_mm(), image.pixel_mm);
  const Eigen::Vector3d centroid = part.mesh().centroid_mm();
  const auto label_place = [&](const Transform<frame::Supply, frame::Object>& T) {
    const Eigen::Vector3d p = T * centroid;
    return cv::Point(canvas.at(p.x(), p.y()));
  };
  // What a detection explains better needs no picture: its outline would lie beside the better one's.
  std::vector<const Rejection*> shown;
  for (const Rejection& rejection : report.rejected)
    if (style.words && rejection.reason.find("better one") == std::string::npos) shown.push_back(&rejection);
  for (std::size_t k = 0; k < std::min(kRejectedDrawn, shown.size()); ++k) {
    const Rejection& rejection = *shown[k];
    for (const Contour& contour : outline_of(canvas, image, rasteriser, jump_mm, rejection.T_supply_object))
      draw_dashed(canvas.picture, contour, kRejectedInk, false);
    write_text(canvas.picture, rejection.reason, label_place(rejection.T_supply_object) + cv::Point(0, 18), 0.38,
               kRejectedInk, true);
  }
  // The best last, so that nothing covers it.
  for (std::size_t k = report.detections.size(); k-- > 0;) {
    const Detection& detection = report.detections[k];
    const bool is_chosen = chosen != nullptr && chosen->detection == k;
    const std::vector<Contour> outline = outline_of(canvas, image, rasteriser, jump_mm, detection.T_supply_object);
    if (is_chosen) draw_outline(canvas.picture, outline, kChosen, (style.words ? 9 : 4) * style.pen);
    if (!is_chosen || style.words)
      draw_outline(canvas.picture, outline, colour_of(detection.score), (is_chosen ? 4 : 2) * style.pen);
    if (style.words)
      write_text(canvas.picture, format("%zu: %.2f", k + 1, detection.score), label_place(detection.T_supply_object),
                 0.5, colour_of(detection.score), true);
  }
  if (chosen != nullptr && gripper != nullptr && grasp != nullptr)
    draw_gripper(canvas, *chosen, *gripper, *grasp, style.pen);
  if (chosen != nullptr) draw_grasp(canvas, *chosen, style.pen);

  cv::Mat whole = canvas.picture;
  if (style.words) cv::vconcat(canvas.picture, legend(canvas, part, report, range, chosen != nullptr), whole);
  try {
    if (!cv::imwrite(png_path, whole))
      return unexpected(png_path + ": cannot be written; check that the folder exists and has room");
  } catch (const cv::Exception&) {
    return unexpected(png_path + ": cannot be written as a picture; give a name that ends in .png");
  }
  return {};
}
}  // namespace binpick::vision
