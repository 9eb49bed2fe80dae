#include "calipso_render/unseen_shade.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace calipso::render {
namespace {

constexpr int kSide = 512;      // cells of the picture's longer side
constexpr int kFewest = 200;    // places that are known
constexpr int kMostGap = 5;     // cells between places that are beside each other
constexpr float kLeast = 0.1f;  // weight of a cell that is known

struct Place {
  Eigen::Vector2f at;  // m, across the sun
  float sun;
};

// Adds a place to the four cells around it.
void splat(const Eigen::Vector2f& cell, float sun, cv::Mat& sums, cv::Mat& weights) {
  const int i = static_cast<int>(std::floor(cell.x())), j = static_cast<int>(std::floor(cell.y()));
  const float x = cell.x() - i, y = cell.y() - j;
  for (int k = 0; k < 4; ++k) {
    const int column = i + k % 2, row = j + k / 2;
    if (column < 0 || row < 0 || column >= sums.cols || row >= sums.rows) continue;
    const float weight = (k % 2 == 0 ? 1.0f - x : x) * (k / 2 == 0 ? 1.0f - y : y);
    sums.at<float>(row, column) += weight * sun, weights.at<float>(row, column) += weight;
  }
}

// Cells between those that are known take the mean of those around, others the nearest.
cv::Mat filled(const cv::Mat& sums, const cv::Mat& weights) {
  cv::Mat around, weights_around, sun, known;
  cv::blur(sums, around, {kMostGap, kMostGap}),
      cv::blur(weights, weights_around, {kMostGap, kMostGap});
  sun = around / cv::max(weights_around, 1e-6f);
  cv::Mat own = sums / cv::max(weights, 1e-6f);
  own.copyTo(sun, weights > kLeast);
  known = weights_around > kLeast / (kMostGap * kMostGap);
  cv::Mat distance, nearest;
  cv::distanceTransform(~known, distance, nearest, cv::DIST_L2, 5, cv::DIST_LABEL_PIXEL);
  std::vector<float> of_label(1, 1.0f);
  for (int v = 0; v < sun.rows; ++v) {
    for (int u = 0; u < sun.cols; ++u) {
      if (known.at<std::uint8_t>(v, u) == 0) continue;
      const std::size_t label = nearest.at<int>(v, u);
      if (label >= of_label.size()) of_label.resize(label + 1, 1.0f);
      of_label[label] = sun.at<float>(v, u);
    }
  }
  for (int v = 0; v < sun.rows; ++v) {
    for (int u = 0; u < sun.cols; ++u) {
      if (known.at<std::uint8_t>(v, u) == 0) sun.at<float>(v, u) = of_label[nearest.at<int>(v, u)];
    }
  }
  return sun;
}

}  // namespace

UnseenShade::UnseenShade(const cv::Mat& hidden, const cv::Mat& known,
                         const std::function<std::optional<Receiver>(int u, int v)>& receiver,
                         const Eigen::Vector3f& to_sun) {
  across_.row(0) = to_sun.unitOrthogonal(), across_.row(1) = to_sun.cross(to_sun.unitOrthogonal());
  std::vector<Place> places;
  Eigen::AlignedBox2f box;
  for (int v = 0; v < hidden.rows; ++v) {
    for (int u = 0; u < hidden.cols; ++u) {
      if (known.at<std::uint8_t>(v, u) == 0) continue;
      const auto r = receiver(u, v);
      if (!r || !(r->normal.dot(to_sun) > 0.0f)) continue;
      places.push_back({across_ * r->position, 1.0f - hidden.at<std::uint8_t>(v, u) / 255.0f});
      box.extend(places.back().at);
    }
  }
  if (places.size() < kFewest || !(box.sizes().maxCoeff() > 0.0f)) return;
  cells_per_metre_ = kSide / box.sizes().maxCoeff();
  first_ = cells_per_metre_ * box.min() - Eigen::Vector2f::Ones();
  const cv::Size size(static_cast<int>(cells_per_metre_ * box.sizes().x()) + 4,
                      static_cast<int>(cells_per_metre_ * box.sizes().y()) + 4);
  cv::Mat sums = cv::Mat::zeros(size, CV_32F), weights = sums.clone();
  for (const Place& p : places) splat(cells_per_metre_ * p.at - first_, p.sun, sums, weights);
  sun_ = filled(sums, weights);
}

float UnseenShade::visibility(const Eigen::Vector3f& p, const Eigen::Vector3f&) const {
  if (sun_.empty()) return 1.0f;
  const Eigen::Vector2f cell = cellOf(p);
  const float x = std::clamp(cell.x(), 0.0f, sun_.cols - 1.001f),
              y = std::clamp(cell.y(), 0.0f, sun_.rows - 1.001f);
  const int i = static_cast<int>(x), j = static_cast<int>(y);
  const float* above = sun_.ptr<float>(j) + i;
  const float* below = sun_.ptr<float>(j + 1) + i;
  const float fx = x - i, fy = y - j;
  const float a = above[0] + fx * (above[1] - above[0]), b = below[0] + fx * (below[1] - below[0]);
  return a + fy * (b - a);
}

std::optional<float> UnseenShade::uniform(const Eigen::Vector3f&, const Eigen::Vector3f&,
                                          float) const {
  return empty() ? std::optional<float>(1.0f) : std::nullopt;
}

}  // namespace calipso::render
