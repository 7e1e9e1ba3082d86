#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/log.hpp"
#include "daemon/cycle/record_codec.hpp"
#include "daemon/cycle/replay.hpp"
#include "plc/result_codes.hpp"
#include "vision/draw.hpp"
#include "vision/kernels.hpp"

/// A bin being emptied, as one picture: the first, the last and evenly chosen ones between of the cycles that looked,
/// drawn from their records.
namespace binpick::bench {
namespace {
namespace fs = std::filesystem;
using daemon::Record;

constexpr int kTile_px = 320, kGap_px = 14, kCaption_px = 42, kHeader_px = 44, kLegend_px = 62;
constexpr int kFiner = 2;  // tiles are drawn so much larger first
constexpr int kStep = 16;  // of colours: what nobody sees costs no bytes
const cv::Scalar kPaper{250, 250, 250}, kInk{45, 40, 40}, kFaint{125, 120, 120};
const cv::Scalar kChosen{255, 200, 0}, kGripper{240, 110, 255}, kFound{40, 255, 0}, kDeep{70, 38, 28},
    kHigh{215, 226, 232};  // as in draw.cpp

/// A cycle that made a scan of its own.
struct Look {
  std::string file;
  std::size_t picks_before = 0;  ///< Answered, of the cycles before it.
};

struct Bin {
  std::vector<Look> looks;
  std::size_t picks = 0;
};

Record read(const std::string& file) {
  auto record = daemon::read_record(file);
  if (!record) throw std::runtime_error(record.error().text);
  return std::move(*record);
}

Bin bin_of(const std::string& folder) {
  std::vector<std::string> files;
  for (const auto& entry : fs::directory_iterator{folder})
    if (entry.path().extension() == ".bpr") files.push_back(entry.path().string());
  std::ranges::sort(files);
  Bin bin;
  for (const std::string& file : files) {
    const Record record = read(file);
    if (record.scan && record.result && record.result->error.empty() && record.result->not_located.empty())
      bin.looks.push_back({file, bin.picks});
    bin.picks += record.answer && record.answer->code == plc::ResultCode::PickFound ? 1 : 0;
  }
  if (bin.looks.empty()) throw std::runtime_error(folder + ": has no record of a cycle with a scan");
  return bin;
}

/// The first, the last, and between them those that lie nearest to equal shares of the picks.
std::vector<Look> chosen(const Bin& bin, std::size_t count) {
  if (count >= bin.looks.size()) return bin.looks;
  std::vector<Look> looks{bin.looks.front()};
  std::size_t next = 1;
  for (std::size_t i = 1; i + 1 < count; ++i) {
    const double share = static_cast<double>(i * bin.picks) / static_cast<double>(count - 1);
    const auto off = [&](const Look& look) { return std::abs(static_cast<double>(look.picks_before) - share); };
    const std::size_t end = bin.looks.size() - (count - 1 - i);  // one has to be left for each that is to come
    const auto from = bin.looks.begin() + static_cast<std::ptrdiff_t>(next);
    const auto best = std::ranges::min_element(from, bin.looks.begin() + static_cast<std::ptrdiff_t>(end), {}, off);
    looks.push_back(*best);
    next = static_cast<std::size_t>(best - bin.looks.begin()) + 1;
  }
  looks.push_back(bin.looks.back());
  return looks;
}

void write(cv::Mat& sheet, const std::string& text, cv::Point at, double size = 0.45, const cv::Scalar& ink = kInk) {
  cv::putText(sheet, text, at, cv::FONT_HERSHEY_SIMPLEX, size, ink, 1, cv::LINE_AA);
}

struct Tile {
  cv::Mat picture;
  std::string title, outcome;
};

/// Of one bin: heights have the same colours in all of them.
class Drawing {
 public:
  explicit Drawing(std::string scratch_png) : scratch_png_{std::move(scratch_png)} {}

  Tile tile_of(const Look& look) {
    const Record record = read(look.file);
    if (const auto* loops = vision::kernels::find(record.result->loops)) vision::kernels::use(*loops);
    const auto replayed = daemon::replay(record, {});
    if (!replayed) throw std::runtime_error(look.file + " " + replayed.error());
    const daemon::DetectResult& seen = replayed->result;
    const auto& cell = *replayed->request.cell;
    const config::Part& part = cell.config.recipes[replayed->request.recipe].part;
    const vision::KnowledgeBase& base = cell.knowledge_bases[replayed->request.recipe];
    if (part_.empty()) {
      part_ = base.part_name();
      top_mm_ = base.diameter_mm() / 4;
      size_mm_ = cell.config.supplies[replayed->request.supply].size_mm;
      for (const auto& centre : seen.centres_mm) top_mm_ = std::max(top_mm_, centre.z() + seen.part_width_mm / 2);
    }
    const auto which = record.answer ? record.answer->reachable : std::nullopt;
    const vision::Reachable* taken =
        which && *which < seen.choice.reachable.size() ? &seen.choice.reachable[*which] : nullptr;
    const vision::DrawStyle style{
        .width_min_px = kTile_px * kFiner, .pen = kFiner, .words = false, .noise = false, .height_max_mm = top_mm_};
    const auto drawn = vision::draw_report(scratch_png_, replayed->request.image, base, seen.report, taken,
                                           part.gripper ? &*part.gripper : nullptr,
                                           taken ? &part.grasps[taken->grasp] : nullptr, style);
    if (!drawn) throw std::runtime_error(drawn.error());
    const cv::Mat large = cv::imread(scratch_png_);
    Tile tile;
    cv::resize(large, tile.picture, {kTile_px, kTile_px * large.rows / large.cols}, 0, 0, cv::INTER_AREA);
    tile.title = "cycle " + std::to_string(record.origin.cycle_id) + ", after " + std::to_string(look.picks_before) +
                 (look.picks_before == 1 ? " pick" : " picks");
    const auto code = record.answer ? record.answer->code : plc::ResultCode::None;
    tile.outcome = std::to_string(seen.report.detections.size()) + " found, " +
                   std::to_string(seen.choice.reachable.size()) + " reachable: " + std::string{plc::to_string(code)};
    return tile;
  }

  const std::string& part() const { return part_; }
  const Eigen::Vector3d& size_mm() const { return size_mm_; }
  double top_mm() const { return top_mm_; }

 private:
  std::string scratch_png_, part_;
  Eigen::Vector3d size_mm_ = Eigen::Vector3d::Zero();
  double top_mm_ = 0;
};

/// What the lines in the pictures are, in one row.
void draw_legend(cv::Mat& sheet, int y, double top_mm) {
  int x = kGap_px;
  const auto named = [&](int sample_px, const std::string& text) {
    write(sheet, text, {x + sample_px + 8, y + 5}, 0.42);
    int below = 0;
    x += sample_px + 8 + cv::getTextSize(text, cv::FONT_HERSHEY_SIMPLEX, 0.42, 1, &below).width + 24;
  };
  const auto ground = [&](int width) { cv::rectangle(sheet, {x, y - 11, width, 22}, kDeep, cv::FILLED); };
  ground(40);
  cv::line(sheet, {x + 6, y}, {x + 34, y}, kFound, 2, cv::LINE_AA);
  named(40, "found");
  ground(40);
  cv::line(sheet, {x + 6, y}, {x + 34, y}, kChosen, 5, cv::LINE_AA);
  named(40, "picked next");
  ground(40);
  for (const int jaw : {8, 26}) cv::rectangle(sheet, {x + jaw, y - 6, 6, 12}, kGripper, cv::FILLED, cv::LINE_AA);
  cv::circle(sheet, {x + 20, y}, 4, kGripper, 1, cv::LINE_AA);
  named(40, "jaws at the grasp");
  ground(40);
  cv::circle(sheet, {x + 20, y}, 9, kGripper, 1, cv::LINE_AA);
  named(40, "gripper above them");
  for (int k = 0; k < 80; ++k)
    cv::line(sheet, {x + k, y - 10}, {x + k, y + 10}, kDeep + (kHigh - kDeep) * (k / 79.0), 1);
  named(80, "height 0 ... " + std::to_string(std::lround(top_mm)) + " mm");
}

cv::Mat sheet_of(const Bin& bin, const std::vector<Tile>& tiles, const Drawing& drawing, int columns) {
  const int rows = (static_cast<int>(tiles.size()) + columns - 1) / columns;
  const int height_px = tiles.front().picture.rows;
  const int step_x = kTile_px + kGap_px, step_y = height_px + kCaption_px + kGap_px;
  cv::Mat sheet(kHeader_px + rows * step_y + kLegend_px, kGap_px + columns * step_x, CV_8UC3, kPaper);
  const Eigen::Vector3d& size = drawing.size_mm();
  char header[200];
  std::snprintf(header, sizeof header, "%s: a bin of %.0f x %.0f x %.0f mm, %zu picks from %zu scans",
                drawing.part().c_str(), size.x(), size.y(), size.z(), bin.picks, bin.looks.size());
  write(sheet, header, {kGap_px, 29}, 0.62);
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const int column = static_cast<int>(i) % columns, row = static_cast<int>(i) / columns;
    const cv::Point corner{kGap_px + column * step_x, kHeader_px + row * step_y};
    tiles[i].picture.copyTo(sheet(cv::Rect{corner, tiles[i].picture.size()}));
    write(sheet, tiles[i].title, corner + cv::Point{0, height_px + 16});
    write(sheet, tiles[i].outcome, corner + cv::Point{0, height_px + 34}, 0.42, kFaint);
  }
  draw_legend(sheet, sheet.rows - kLegend_px / 2 - 2, drawing.top_mm());
  return sheet;
}

int main(int argc, char** argv) {
  CLI::App app{"series: one bin being emptied, as one picture (docs/production.md)"};
  std::string folder, out;
  std::size_t count = 12;
  int columns = 3;
  app.add_option("RECORDS", folder, "folder of one bin's records")->required();
  app.add_option("OUT.png", out, "the picture")->required();
  app.add_option("--count", count, "cycles shown")->check(CLI::Range(2, 100))->capture_default_str();
  app.add_option("--columns", columns)->check(CLI::Range(1, 10))->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  log::set_threshold(log::Level::Error);
  const Bin bin = bin_of(folder);
  Drawing drawing{out};
  std::vector<Tile> tiles;
  for (const Look& look : chosen(bin, count)) tiles.push_back(drawing.tile_of(look));
  cv::Mat sheet = sheet_of(bin, tiles, drawing, columns);
  sheet.forEach<cv::Vec3b>([](cv::Vec3b& p, const int*) {
    for (int k = 0; k < 3; ++k) p[k] = static_cast<uchar>(p[k] / kStep * kStep);
  });
  if (!cv::imwrite(out, sheet,
                   {cv::IMWRITE_PNG_COMPRESSION, 9, cv::IMWRITE_PNG_STRATEGY, cv::IMWRITE_PNG_STRATEGY_DEFAULT}))
    throw std::runtime_error(out + ": cannot be written");
  return 0;
}
}  // namespace
}  // namespace binpick::bench

int main(int argc, char** argv) {
  try {
    return binpick::bench::main(argc, argv);
  } catch (const std::exception& failure) {
    std::fprintf(stderr, "series: %s\n", failure.what());
    return 1;
  }
}
