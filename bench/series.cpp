#include <algorithm>
#include <charconv>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

/// A bin being emptied, as one picture: the first, the last and evenly chosen ones between of the pictures that a
/// daemon left (cell.picture_dir), in rows.
namespace {
constexpr int kTile_px = 420, kGap_px = 8, kColumns = 3, kCaption_px = 24;

std::vector<std::filesystem::path> pictures_in(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator{folder})
    if (entry.path().extension() == ".png") files.push_back(entry.path());
  // In the order of writing: cycle numbers begin anew with each daemon.
  std::ranges::sort(files, {}, [](const auto& file) { return std::filesystem::last_write_time(file); });
  return files;
}

cv::Mat sheet_of(const std::vector<std::filesystem::path>& files, std::size_t count) {
  count = std::min(count, files.size());
  const int rows = (static_cast<int>(count) + kColumns - 1) / kColumns;
  cv::Mat sheet;
  int height_px = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t which = count == 1 ? 0 : i * (files.size() - 1) / (count - 1);
    cv::Mat picture = cv::imread(files[which].string());
    if (picture.empty()) throw std::runtime_error(files[which].string() + ": cannot be read as a picture");
    if (sheet.empty()) {
      height_px = kTile_px * picture.rows / picture.cols;
      sheet.create(rows * (height_px + kCaption_px + kGap_px) - kGap_px, kColumns * (kTile_px + kGap_px) - kGap_px,
                   CV_8UC3);
      sheet.setTo(cv::Scalar::all(255));
    }
    cv::Mat small;
    cv::resize(picture, small, {kTile_px, height_px}, 0, 0, cv::INTER_AREA);
    const int column = static_cast<int>(i) % kColumns, row = static_cast<int>(i) / kColumns;
    const cv::Point corner{column * (kTile_px + kGap_px), row * (height_px + kCaption_px + kGap_px)};
    small.copyTo(sheet(cv::Rect{corner, small.size()}));
    cv::putText(sheet, "pick " + std::to_string(which + 1) + " of " + std::to_string(files.size()),
                corner + cv::Point{4, height_px + kCaption_px - 8}, cv::FONT_HERSHEY_SIMPLEX, 0.5, {40, 40, 40}, 1,
                cv::LINE_AA);
  }
  return sheet;
}
}  // namespace

int main(int argc, char** argv) try {
  if (argc != 4) {
    std::fprintf(stderr, "usage: series PICTURES-FOLDER COUNT OUT.png\n");
    return 2;
  }
  const auto files = pictures_in(argv[1]);
  const std::string_view wanted = argv[2];
  int count = 0;
  std::from_chars(wanted.data(), wanted.data() + wanted.size(), count);
  if (files.empty() || count < 1) {
    std::fprintf(stderr, "series: %s has no pictures, or \"%s\" is no number\n", argv[1], argv[2]);
    return 2;
  }
  if (!cv::imwrite(argv[3], sheet_of(files, static_cast<std::size_t>(count))))
    throw std::runtime_error(std::string{argv[3]} + ": cannot be written");
  return 0;
} catch (const std::exception& failure) {
  std::fprintf(stderr, "series: %s\n", failure.what());
  return 1;
}
