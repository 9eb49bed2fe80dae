#include "fill/levelled.hpp"

#include <opencv2/imgproc.hpp>
#include <vector>

namespace calipso::render {

cv::Mat levelled(const cv::Mat& image, const cv::Mat& known, double deviation) {
  cv::Mat weight, sum, weights;
  cv::Mat(known != 0).convertTo(weight, CV_32F, 1.0 / 255.0);
  cv::merge(std::vector<cv::Mat>(image.channels(), weight), weight);
  cv::GaussianBlur(image.mul(weight), sum, {0, 0}, deviation);
  cv::GaussianBlur(weight, weights, {0, 0}, deviation);
  return (image - sum / cv::max(weights, 1e-3)).mul(weight);
}

}  // namespace calipso::render
