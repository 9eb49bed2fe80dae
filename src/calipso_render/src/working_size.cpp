#include "working_size.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace calipso::render {
namespace {

constexpr int kWorkingSide = 640;  // px of a picture's longer side, about

cv::Mat reduced(const cv::Mat& picture, int times, int by) {
  if (picture.empty() || times == 1) return picture;
  const cv::Size size = picture.size() / times;
  cv::Mat out;
  cv::resize(picture(cv::Rect({0, 0}, size * times)), out, size, 0.0, 0.0, by);
  return out;
}

}  // namespace

int timesTooLarge(const cv::Size& size) {
  return std::max(1, (std::max(size.width, size.height) + kWorkingSide / 2 - 1) / kWorkingSide);
}

cv::Mat reducedMeans(const cv::Mat& picture, int times) {
  return reduced(picture, times, cv::INTER_AREA);
}

cv::Mat reducedValues(const cv::Mat& picture, int times) {
  return reduced(picture, times, cv::INTER_NEAREST);
}

}  // namespace calipso::render
