#include "blind_sheet.hpp"

#include <algorithm>
#include <fstream>
#include <opencv2/imgproc.hpp>

#include "picture_file.hpp"

namespace calipso::render {
namespace {

constexpr int kMargin = 24;  // px around the object
constexpr int kWidth = 480;  // px of a crop on the sheet
constexpr int kGap = 8;      // px between them

cv::Mat enlarged(const cv::Mat& picture, const cv::Rect& place) {
  cv::Mat crop;
  const double scale = static_cast<double>(kWidth) / place.width;
  cv::resize(picture(place), crop, {kWidth, std::max(1, static_cast<int>(scale * place.height))}, 0,
             0, cv::INTER_NEAREST);
  return crop;
}

}  // namespace

void BlindSheet::add(const cv::Mat& video, const cv::Mat& composed, const cv::Rect& place,
                     int frame) {
  if (place.empty()) return;
  const cv::Rect around =
      (place + cv::Size(2 * kMargin, 2 * kMargin) - cv::Point(kMargin, kMargin)) &
      cv::Rect({0, 0}, video.size());
  const bool video_left = random_() % 2 == 0;
  const cv::Mat left = enlarged(video_left ? video : composed, around),
                right = enlarged(video_left ? composed : video, around);
  cv::Mat pair;
  cv::hconcat(
      std::vector<cv::Mat>{left, cv::Mat(left.rows, kGap, CV_8UC3, cv::Scalar::all(255)), right},
      pair);
  cv::copyMakeBorder(pair, pair, 0, kGap, 0, 0, cv::BORDER_CONSTANT, cv::Scalar::all(255));
  pairs_.push_back(pair);
  key_.push_back("frame " + std::to_string(frame) + ": " + (video_left ? "left" : "right"));
}

void BlindSheet::write(const std::string& folder) const {
  if (pairs_.empty()) return;
  cv::Mat sheet;
  cv::vconcat(pairs_, sheet);
  writePicture(folder + "/" + name_ + "_blind.png", sheet);
  std::ofstream key(folder + "/" + name_ + "_blind_key.txt");
  for (const std::string& line : key_) key << line << "\n";
}

}  // namespace calipso::render
