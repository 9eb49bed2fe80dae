#include "calipso_flow/dense_flow.hpp"

#include <algorithm>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>

namespace calipso::flow {
namespace {

constexpr int kSurrounding = 32;  // px around a region that the search may use
constexpr int kLeastSide = 32;    // px; the method's coarsest level needs this much

cv::Mat toGray(const cv::Mat& picture) {
  if (picture.type() == CV_8UC1) return picture;
  if (picture.type() != CV_8UC3) {
    throw std::invalid_argument("dense flow: pixel type " + cv::typeToString(picture.type()) +
                                " is not supported; give 8-bit grey or BGR");
  }
  cv::Mat gray;
  cv::cvtColor(picture, gray, cv::COLOR_BGR2GRAY);
  return gray;
}

cv::Rect enlarged(const cv::Rect& region, const cv::Size& picture) {
  const int margin_x = std::max(kSurrounding, (kLeastSide - region.width + 1) / 2);
  const int margin_y = std::max(kSurrounding, (kLeastSide - region.height + 1) / 2);
  const cv::Rect wide(region.x - margin_x, region.y - margin_y, region.width + 2 * margin_x,
                      region.height + 2 * margin_y);
  return wide & cv::Rect({0, 0}, picture);
}

int disPreset(DenseFlow::Preset preset) {
  switch (preset) {
    case DenseFlow::Preset::kUltrafast:
      return cv::DISOpticalFlow::PRESET_ULTRAFAST;
    case DenseFlow::Preset::kFast:
      return cv::DISOpticalFlow::PRESET_FAST;
    case DenseFlow::Preset::kMedium:
      return cv::DISOpticalFlow::PRESET_MEDIUM;
  }
  throw std::invalid_argument("dense flow: unknown preset");
}

}  // namespace

DenseFlow::DenseFlow(Preset preset) : dis_(cv::DISOpticalFlow::create(disPreset(preset))) {}

cv::Mat DenseFlow::compute(const cv::Mat& from, const cv::Mat& to, const cv::Rect& region) {
  if (from.empty() || from.size() != to.size()) {
    throw std::invalid_argument("dense flow: the pictures are " + std::to_string(from.cols) + "x" +
                                std::to_string(from.rows) + " and " + std::to_string(to.cols) +
                                "x" + std::to_string(to.rows) + "; give two of equal size");
  }
  const cv::Rect whole({0, 0}, from.size());
  const cv::Rect wanted = region.area() > 0 ? region & whole : whole;
  const float unknown = std::numeric_limits<float>::quiet_NaN();
  cv::Mat result(from.size(), CV_32FC2, cv::Scalar(unknown, unknown));
  if (wanted.area() == 0) return result;
  const cv::Rect part = enlarged(wanted, from.size());
  cv::Mat flow;
  dis_->calc(toGray(from)(part).clone(), toGray(to)(part).clone(), flow);
  flow(wanted - part.tl()).copyTo(result(wanted));
  return result;
}

}  // namespace calipso::flow
