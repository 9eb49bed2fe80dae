#include "calipso_bag/shot_changes.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace calipso::bag {
namespace {

constexpr double kNoise = 2.0;      // grey levels; less contrast than this shows nothing
constexpr double kUnlike = 0.5;     // 1 - correlation of frames that are hardly of one place
constexpr double kSalience = 4.0;   // times the changes around it
const cv::Size kThumbnail(32, 18);  // coarse enough for what moves to matter little

cv::Mat thumbnailOf(const cv::Mat& frame) {
  cv::Mat small, grey;
  cv::resize(frame, small, kThumbnail, 0, 0, cv::INTER_AREA);
  if (small.channels() == 1) {
    grey = small;
  } else {
    cv::cvtColor(small, grey, small.channels() == 4 ? cv::COLOR_BGRA2GRAY : cv::COLOR_BGR2GRAY);
  }
  grey.convertTo(grey, CV_32F);
  return grey - cv::mean(grey)[0];
}

double dissimilarity(const cv::Mat& a, const cv::Mat& b) {
  const double floor = kNoise * kNoise * static_cast<double>(a.total());
  return 1.0 - a.dot(b) / std::sqrt((a.dot(a) + floor) * (b.dot(b) + floor));
}

}  // namespace

void ShotChanges::add(const cv::Mat& frame) {
  const cv::Mat thumbnail = thumbnailOf(frame);
  if (!previous_.empty()) dissimilarity_.push_back(dissimilarity(previous_, thumbnail));
  previous_ = thumbnail;
}

std::vector<int> ShotChanges::found() const {
  std::vector<int> changes;
  for (std::size_t k = 0; k < dissimilarity_.size(); ++k) {
    const double before = k > 0 ? dissimilarity_[k - 1] : 0.0;
    const double after = k + 1 < dissimilarity_.size() ? dissimilarity_[k + 1] : 0.0;
    if (dissimilarity_[k] > std::max(kUnlike, kSalience * std::max(before, after)))
      changes.push_back(static_cast<int>(k) + 1);
  }
  return changes;
}

}  // namespace calipso::bag
