#include "working_size.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace calipso::render {
namespace {

constexpr int kWorkingSide = 640;  // px of a picture's longer side, about

}  // namespace

int timesTooLarge(const cv::Size& size) {
  return std::max(1, (std::max(size.width, size.height) + kWorkingSide / 2 - 1) / kWorkingSide);
}

cv::Mat reducedMeans(const cv::Mat& picture, int times) {
  if (picture.empty() || times == 1) return picture;
  const cv::Size size = picture.size() / times;
  cv::Mat out;
  cv::resize(picture(cv::Rect({0, 0}, size * times)), out, size, 0.0, 0.0, cv::INTER_AREA);
  return out;
}

cv::Mat reducedValues(const cv::Mat& picture, int times) {
  if (picture.empty() || times == 1) return picture;
  // cv::INTER_NEAREST would take the squares' first corners.
  const int middle = (times - 1) / 2;
  cv::Mat out(picture.size() / times, picture.type());
  for (int v = 0; v < out.rows; ++v) {
    for (int u = 0; u < out.cols; ++u)
      std::copy_n(picture.ptr(v * times + middle, u * times + middle), picture.elemSize(),
                  out.ptr(v, u));
  }
  return out;
}

cv::Mat enlargedAgain(const cv::Mat& reduced, const cv::Size& whole, int times, int by) {
  cv::Mat out;
  cv::resize(reduced, out, reduced.size() * times, 0.0, 0.0, by);
  cv::copyMakeBorder(out, out, 0, whole.height - out.rows, 0, whole.width - out.cols,
                     cv::BORDER_REPLICATE);
  return out;
}

}  // namespace calipso::render
