#include "fill/colour_trend.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

namespace calipso::render {
namespace {

constexpr int kTerms = 6;
constexpr int kSamples = 4000;  // places that the trend is fitted to, about
constexpr int kFewest = 200;
constexpr int kRounds = 4;          // of weighing
constexpr double kOutlier = 2.0;    // times the mean deviation
constexpr double kRidge = 0.01;     // of what is known, against bending
constexpr double kExplains = 0.6;   // part of the variation that it has to explain
constexpr double kExtremes = 0.02;  // part of the places that may be darker or brighter

using Terms = Eigen::Matrix<double, kTerms, 1>;

struct Sample {
  Terms terms;
  cv::Vec3f colour;
};

Terms termsAt(int u, int v, const cv::Size& size) {
  const double x = 2.0 * u / size.width - 1.0, y = 2.0 * v / size.height - 1.0;
  return (Terms() << 1.0, x, y, x * x, x * y, y * y).finished();
}

std::vector<Sample> samplesOf(const cv::Mat& image, const cv::Mat& known) {
  std::vector<Sample> samples;
  const int step = std::max(
      1, static_cast<int>(std::sqrt(static_cast<double>(cv::countNonZero(known)) / kSamples)));
  for (int v = step / 2; v < image.rows; v += step) {
    for (int u = step / 2; u < image.cols; u += step) {
      if (known.at<std::uint8_t>(v, u) != 0)
        samples.push_back({termsAt(u, v, image.size()), image.at<cv::Vec3f>(v, u)});
    }
  }
  return samples;
}

Terms fitted(const std::vector<Sample>& samples, int channel) {
  Terms x = Terms::Zero();
  double deviation = 1e9;
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix<double, kTerms, kTerms> A = Eigen::Matrix<double, kTerms, kTerms>::Zero();
    Terms b = Terms::Zero();
    for (const Sample& s : samples) {
      const double off = std::abs(s.colour[channel] - x.dot(s.terms)),
                   weight = std::min(1.0, kOutlier * deviation / std::max(off, 1e-6));
      A += weight * s.terms * s.terms.transpose(), b += weight * s.colour[channel] * s.terms;
    }
    for (int k = 3; k < kTerms; ++k) A(k, k) += kRidge * A(0, 0);
    x = A.ldlt().solve(b);
    double sum = 0.0;
    for (const Sample& s : samples) sum += std::abs(s.colour[channel] - x.dot(s.terms));
    deviation = std::max(0.1, sum / static_cast<double>(samples.size()));
  }
  return x;
}

// Part of the variation that the trend explains.
double explained(const std::vector<Sample>& samples, const Terms (&x)[3]) {
  cv::Vec3d sum;
  for (const Sample& s : samples) sum += cv::Vec3d(s.colour);
  const cv::Vec3d mean = sum * (1.0 / static_cast<double>(samples.size()));
  double all = 0.0, left = 0.0;
  for (const Sample& s : samples) {
    for (int c = 0; c < 3; ++c) {
      all += std::pow(s.colour[c] - mean[c], 2);
      left += std::pow(s.colour[c] - x[c].dot(s.terms), 2);
    }
  }
  return all > 0.0 ? 1.0 - left / all : 0.0;
}

}  // namespace

cv::Mat colourTrend(const cv::Mat& image, const cv::Mat& known) {
  cv::Mat trend = cv::Mat::zeros(image.size(), CV_32FC3);
  const std::vector<Sample> samples = samplesOf(image, known);
  if (samples.size() < kFewest) return trend;
  Terms x[3];
#pragma omp parallel for schedule(static, 1)
  for (int c = 0; c < 3; ++c) x[c] = fitted(samples, c);
  if (!(explained(samples, x) >= kExplains)) return trend;
  cv::Vec3d low, middle, high;
  for (int c = 0; c < 3; ++c) {
    std::vector<double> values;  // of the trend where it is known
    for (const Sample& s : samples) values.push_back(x[c].dot(s.terms));
    std::sort(values.begin(), values.end());
    const std::size_t few =
        static_cast<std::size_t>(kExtremes * static_cast<double>(values.size()));
    low[c] = values[few], middle[c] = values[values.size() / 2],
    high[c] = values[values.size() - 1 - few];
  }
#pragma omp parallel for schedule(static)
  for (int v = 0; v < trend.rows; ++v) {
    for (int u = 0; u < trend.cols; ++u) {
      const Terms terms = termsAt(u, v, image.size());
      for (int c = 0; c < 3; ++c)
        trend.at<cv::Vec3f>(v, u)[c] =
            static_cast<float>(std::clamp(x[c].dot(terms), low[c], high[c]) - middle[c]);
    }
  }
  return trend;
}

}  // namespace calipso::render
