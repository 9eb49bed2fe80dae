#include "fill/levelled.hpp"

#include <opencv2/imgproc.hpp>
#include <vector>

namespace calipso::render {

cv::Mat levelled(const cv::Mat& image, const cv::Mat& known, double deviation) {
  const auto perChannel = [&](const cv::Mat& x) {
    cv::Mat merged;
    cv::merge(std::vector<cv::Mat>(image.channels(), x), merged);
    return merged;
  };
  cv::Mat weight, sum, weights;
  cv::Mat(known != 0).convertTo(weight, CV_32F, 1.0 / 255.0);
  cv::GaussianBlur(weight, weights, {0, 0}, deviation);
  weight = perChannel(weight);
  cv::GaussianBlur(image.mul(weight), sum, {0, 0}, deviation);
  return (image - sum / perChannel(cv::max(weights, 1e-3))).mul(weight);
}

}  // namespace calipso::render
