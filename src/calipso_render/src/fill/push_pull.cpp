#include <opencv2/imgproc.hpp>

#include "calipso_render/inpaint.hpp"

namespace calipso::render {
namespace {

// image and weight of half the size: averages weighted by trust.
void pull(const cv::Mat& weighted, const cv::Mat& weight, cv::Mat& weighted_half,
          cv::Mat& weight_half) {
  const cv::Size half((weight.cols + 1) / 2, (weight.rows + 1) / 2);
  cv::pyrDown(weighted, weighted_half, half, cv::BORDER_REPLICATE);
  cv::pyrDown(weight, weight_half, half, cv::BORDER_REPLICATE);
}

cv::Mat normalised(const cv::Mat& weighted, const cv::Mat& weight) {
  cv::Mat out(weighted.size(), CV_32FC3);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < out.rows; ++v) {
    for (int u = 0; u < out.cols; ++u) {
      const float w = weight.at<float>(v, u);
      out.at<cv::Vec3f>(v, u) =
          w > 1e-6f ? cv::Vec3f(weighted.at<cv::Vec3f>(v, u) / w) : cv::Vec3f();
    }
  }
  return out;
}

cv::Mat multiplied(const cv::Mat& image, const cv::Mat& weight) {
  cv::Mat out(image.size(), CV_32FC3);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < out.rows; ++v) {
    for (int u = 0; u < out.cols; ++u)
      out.at<cv::Vec3f>(v, u) = weight.at<float>(v, u) * image.at<cv::Vec3f>(v, u);
  }
  return out;
}

}  // namespace

cv::Mat pushPull(const cv::Mat& image, const cv::Mat& weight) {
  CV_Assert(image.type() == CV_32FC3 && weight.type() == CV_32FC1 && image.size() == weight.size());
  if (image.cols <= 2 && image.rows <= 2) return image.clone();
  cv::Mat weighted_half, weight_half;
  pull(multiplied(image, weight), weight, weighted_half, weight_half);
  const cv::Mat half_image = normalised(weighted_half, weight_half);
  cv::Mat half_trust;  // a pixel with any support is trusted more than its weight says
  cv::min(weight_half * 4.0, 1.0, half_trust);
  const cv::Mat half = pushPull(half_image, half_trust);
  cv::Mat coarse;
  cv::pyrUp(half, coarse, {half.cols * 2, half.rows * 2});
  coarse = coarse(cv::Rect(0, 0, image.cols, image.rows));
  cv::Mat out(image.size(), CV_32FC3);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < out.rows; ++v) {
    for (int u = 0; u < out.cols; ++u) {
      const float w = std::min(1.0f, weight.at<float>(v, u));
      out.at<cv::Vec3f>(v, u) =
          image.at<cv::Vec3f>(v, u) * w + coarse.at<cv::Vec3f>(v, u) * (1.0f - w);
    }
  }
  return out;
}

}  // namespace calipso::render
