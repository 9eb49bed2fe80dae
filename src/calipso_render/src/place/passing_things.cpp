#include "calipso_render/passing_things.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "place/key_cover.hpp"

namespace calipso::render {
namespace {

constexpr int kSquare = 4;            // px
constexpr float kLeastClear = 0.2f;   // of a mean's surroundings that must be seen
constexpr std::size_t kFewest = 5;    // frames that tell what is usual
constexpr float kLeast = 12.0f;       // code values by which what passes differs from it, and
constexpr float kDeviations = 10.0f;  // times the lower quartile of how a place itself does
constexpr float kUnknown = std::numeric_limits<float>::infinity();

cv::Size squaresOf(const cv::Size& picture) {
  return {std::max(1, picture.width / kSquare), std::max(1, picture.height / kSquare)};
}

// The mean colours around the squares, of what no mask covers.
struct Means {
  cv::Mat colours;  // CV_32FC3, code values
  cv::Mat clear;    // CV_32FC1: the part that they are of
};

Means meansOf(const cv::Mat& bgr, const cv::Mat& covered) {
  cv::Mat seen = bgr.clone(), clear = covered == 0;
  seen.setTo(0, covered);
  Means means;
  cv::resize(seen, means.colours, squaresOf(bgr.size()), 0, 0, cv::INTER_AREA);
  cv::resize(clear, means.clear, squaresOf(bgr.size()), 0, 0, cv::INTER_AREA);
  means.colours.convertTo(means.colours, CV_32F);
  means.clear.convertTo(means.clear, CV_32F, 1.0 / 255.0);
  cv::blur(means.colours, means.colours, {3, 3}), cv::blur(means.clear, means.clear, {3, 3});
  for (int v = 0; v < means.clear.rows; ++v) {
    for (int u = 0; u < means.clear.cols; ++u)
      means.colours.at<cv::Vec3f>(v, u) /= std::max(kLeastClear, means.clear.at<float>(v, u));
  }
  return means;
}

float difference(const cv::Vec3f& a, const cv::Vec3f& b) {
  return std::max({std::abs(a[0] - b[0]), std::abs(a[1] - b[1]), std::abs(a[2] - b[2])});
}

float nth(std::vector<float>& values, std::size_t n) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(n), values.end());
  return values[n];
}

cv::Vec3f medianOf(const std::vector<cv::Vec3f>& colours) {
  cv::Vec3f median;
  std::vector<float> values(colours.size());
  for (int c = 0; c < 3; ++c) {
    std::transform(colours.begin(), colours.end(), values.begin(),
                   [c](const cv::Vec3f& colour) { return colour[c]; });
    median[c] = nth(values, values.size() / 2);
  }
  return median;
}

}  // namespace

PassingThings::PassingThings(const std::vector<ClipFrame>& frames, int margin) : margin_(margin) {
  std::vector<Means> means(frames.size());
#pragma omp parallel for schedule(dynamic, 1)
  for (std::size_t i = 0; i < frames.size(); ++i)
    means[i] = meansOf(frames[i].bgr, grown(frames[i].labels != 0, margin));
  usual_ = cv::Mat::zeros(means.front().clear.size(), CV_32FC3);
  limit_ = cv::Mat(usual_.size(), CV_32F, cv::Scalar(kUnknown));
#pragma omp parallel for schedule(dynamic, 8)
  for (int v = 0; v < usual_.rows; ++v) {
    for (int u = 0; u < usual_.cols; ++u) {
      std::vector<cv::Vec3f> seen;
      for (const Means& m : means)
        if (m.clear.at<float>(v, u) >= kLeastClear) seen.push_back(m.colours.at<cv::Vec3f>(v, u));
      if (seen.size() < kFewest) continue;
      const cv::Vec3f usual = medianOf(seen);
      std::vector<float> off;
      for (const cv::Vec3f& mean : seen) off.push_back(difference(mean, usual));
      usual_.at<cv::Vec3f>(v, u) = usual;
      limit_.at<float>(v, u) = std::max(kLeast, kDeviations * nth(off, off.size() / 4));
    }
  }
}

cv::Mat PassingThings::addedTo(const cv::Mat& labels, const cv::Mat& bgr) const {
  if (usual_.empty()) return labels;
  const Means means = meansOf(bgr, grown(labels != 0, margin_));
  cv::Mat passing = cv::Mat::zeros(usual_.size(), CV_8U), added = labels.clone();
  for (int v = 0; v < passing.rows; ++v) {
    for (int u = 0; u < passing.cols; ++u)
      if (means.clear.at<float>(v, u) >= kLeastClear &&
          difference(means.colours.at<cv::Vec3f>(v, u), usual_.at<cv::Vec3f>(v, u)) >
              limit_.at<float>(v, u))
        passing.at<std::uint8_t>(v, u) = 255;
  }
  cv::resize(grown(passing, 1), passing, labels.size(), 0, 0, cv::INTER_NEAREST);
  added.setTo(255, passing & (labels == 0));
  return added;
}

}  // namespace calipso::render
