#include "calipso_align/layer_motion.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "calipso_scene/median.hpp"

namespace calipso::align {
namespace {

const cv::Size kWindow(21, 21);  // px; how far what is local is believed
constexpr size_t kMaxSamples = 1500;

struct Sample {
  Eigen::Vector3d x;  // u, v about the support's centre, 1
  Eigen::Vector2d motion;
};

using Affine = Eigen::Matrix<double, 2, 3>;

std::vector<Sample> samplesUnder(const cv::Mat& support, const cv::Mat& flow,
                                 const cv::Point2d& centre) {
  const int total = cv::countNonZero(support);
  const int step = std::max<int>(1, total / static_cast<int>(kMaxSamples));
  std::vector<Sample> samples;
  int met = 0;
  for (int y = 0; y < support.rows; ++y)
    for (int x = 0; x < support.cols; ++x) {
      if (!support.at<uchar>(y, x) || met++ % step != 0) continue;
      const cv::Vec2f m = flow.at<cv::Vec2f>(y, x);
      samples.push_back({{x - centre.x, y - centre.y, 1.0}, {m[0], m[1]}});
    }
  return samples;
}

// The translation that most samples are close to: where to start from.
Affine medianTranslation(const std::vector<Sample>& samples) {
  std::vector<double> u, v;
  for (const Sample& sample : samples) {
    u.push_back(sample.motion.x());
    v.push_back(sample.motion.y());
  }
  Affine map = Affine::Zero();
  map.col(2) << median(u), median(v);
  return map;
}

// Iteratively reweighted least squares with Cauchy weights, whose scale is the median residual.
Affine robustAffine(const std::vector<Sample>& samples) {
  constexpr int kRounds = 5;
  Affine map = medianTranslation(samples);
  std::vector<double> residuals(samples.size());
  for (int round = 0; round < kRounds; ++round) {
    for (size_t i = 0; i < samples.size(); ++i)
      residuals[i] = (samples[i].motion - map * samples[i].x).norm();
    const double scale = std::max(0.05, 1.5 * median(residuals));
    Eigen::Matrix3d A = 1e-6 * Eigen::Matrix3d::Identity();
    Eigen::Matrix<double, 3, 2> b = Eigen::Matrix<double, 3, 2>::Zero();
    for (size_t i = 0; i < samples.size(); ++i) {
      const double weight = 1.0 / (1.0 + residuals[i] * residuals[i] / (scale * scale));
      A += weight * samples[i].x * samples[i].x.transpose();
      b += weight * samples[i].x * samples[i].motion.transpose();
    }
    map = A.ldlt().solve(b).transpose();
  }
  return map;
}

}  // namespace

cv::Mat layerMotion(const cv::Mat& flow, const cv::Mat& support, const cv::Rect& roi) {
  cv::Mat motion = cv::Mat::zeros(roi.size(), CV_32FC2);
  const cv::Mat own = support(roi);
  const cv::Point2d centre(0.5 * roi.width, 0.5 * roi.height);
  const std::vector<Sample> samples = samplesUnder(own, flow(roi), centre);
  if (samples.empty()) return motion;
  const Affine map = robustAffine(samples);

  cv::Mat remainder = cv::Mat::zeros(roi.size(), CV_32FC2), weight;
  own.convertTo(weight, CV_32F, 1.0 / 255.0);
#pragma omp parallel for schedule(static)
  for (int y = 0; y < roi.height; ++y)
    for (int x = 0; x < roi.width; ++x) {
      const Eigen::Vector2d m = map * Eigen::Vector3d(x - centre.x, y - centre.y, 1.0);
      cv::Vec2f& target = motion.at<cv::Vec2f>(y, x);
      target = cv::Vec2f(static_cast<float>(m.x()), static_cast<float>(m.y()));
      if (own.at<uchar>(y, x))
        remainder.at<cv::Vec2f>(y, x) = flow.at<cv::Vec2f>(roi.y + y, roi.x + x) - target;
    }
  cv::blur(remainder, remainder, kWindow);
  cv::blur(weight, weight, kWindow);
  constexpr float kFaint = 0.02f;  // share of the window that must be support to be believed
#pragma omp parallel for schedule(static)
  for (int y = 0; y < roi.height; ++y)
    for (int x = 0; x < roi.width; ++x)
      motion.at<cv::Vec2f>(y, x) +=
          remainder.at<cv::Vec2f>(y, x) * (1.0f / (weight.at<float>(y, x) + kFaint));
  return motion;
}

cv::Mat movedBack(const cv::Mat& image, const cv::Mat& motion, const cv::Rect& roi) {
  cv::Mat map(roi.size(), CV_32FC2), result;
#pragma omp parallel for schedule(static)
  for (int y = 0; y < roi.height; ++y)
    for (int x = 0; x < roi.width; ++x)
      map.at<cv::Vec2f>(y, x) = motion.at<cv::Vec2f>(y, x) + cv::Vec2f(roi.x + x, roi.y + y);
  cv::remap(image, result, map, cv::noArray(), cv::INTER_LINEAR);
  return result;
}

}  // namespace calipso::align
