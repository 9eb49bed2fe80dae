#include "measures.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace calipso::render {
namespace {

cv::Mat disc(int radius) {
  return cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * radius + 1, 2 * radius + 1});
}

double gradientEnergy(const cv::Mat& picture, const cv::Mat& mask) {
  cv::Mat grey, along_u, along_v;
  cv::cvtColor(picture, grey, cv::COLOR_BGR2GRAY);
  const cv::Mat kernel = (cv::Mat_<float>(1, 3) << -0.5f, 0.0f, 0.5f);
  cv::filter2D(grey, along_u, CV_32F, kernel);
  cv::filter2D(grey, along_v, CV_32F, kernel.t());
  return cv::mean(along_u.mul(along_u) + along_v.mul(along_v), mask)[0];
}

}  // namespace

std::optional<double> psnr(const cv::Mat& a, const cv::Mat& b, const cv::Mat& mask) {
  if (cv::countNonZero(mask) == 0) return std::nullopt;
  cv::Mat difference;
  cv::absdiff(a, b, difference);
  difference.convertTo(difference, CV_32F);
  const cv::Scalar mean = cv::mean(difference.mul(difference), mask);
  const double error = (mean[0] + mean[1] + mean[2]) / 3.0;
  return error > 0.0 ? std::min(99.0, 10.0 * std::log10(255.0 * 255.0 / error)) : 99.0;
}

std::optional<double> gradientRatio(const cv::Mat& picture, const cv::Mat& truth,
                                    const cv::Mat& mask) {
  if (cv::countNonZero(mask) == 0) return std::nullopt;
  const double reference = gradientEnergy(truth, mask);
  if (reference <= 0.0) return std::nullopt;
  return gradientEnergy(picture, mask) / reference;
}

std::optional<double> change(const cv::Mat& a, const cv::Mat& b, const cv::Mat& mask) {
  if (cv::countNonZero(mask) == 0) return std::nullopt;
  cv::Mat difference;
  cv::absdiff(a, b, difference);
  const cv::Scalar mean = cv::mean(difference, mask);
  return (mean[0] + mean[1] + mean[2]) / 3.0;
}

std::optional<double> albedoError(const cv::Mat& albedo, const cv::Mat& truth,
                                  const cv::Mat& mask) {
  if (cv::countNonZero(mask) == 0) return std::nullopt;
  double error = 0.0, total = 0.0;
  for (int c = 0; c < 3; ++c) {
    double own = 0.0, reference = 0.0;
    for (int pass = 0; pass < 2; ++pass) {
      const double gain = pass == 0 || own == 0.0 ? 1.0 : reference / own;
      for (int v = 0; v < mask.rows; ++v) {
        for (int u = 0; u < mask.cols; ++u) {
          if (mask.at<std::uint8_t>(v, u) == 0) continue;
          const double a = albedo.at<cv::Vec3f>(v, u)[c], t = truth.at<cv::Vec3f>(v, u)[c];
          if (pass == 0)
            own += a, reference += t;
          else
            error += std::abs(gain * a - t), total += t;
        }
      }
    }
  }
  return total > 0.0 ? std::optional<double>(100.0 * error / total) : std::nullopt;
}

cv::Mat grow(const cv::Mat& mask, int radius) {
  cv::Mat out;
  cv::dilate(mask, out, disc(radius));
  return out;
}

cv::Mat shrink(const cv::Mat& mask, int radius) {
  cv::Mat out;
  cv::erode(mask, out, disc(radius));
  return out;
}

cv::Mat rim(const cv::Mat& mask, int radius) { return grow(mask, radius) & ~shrink(mask, radius); }

double elapsedMs(std::chrono::steady_clock::time_point since) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - since)
      .count();
}

void keepLowest(std::optional<double>& lowest, std::optional<double> value) {
  if (value && (!lowest || *value < *lowest)) lowest = value;
}

}  // namespace calipso::render
