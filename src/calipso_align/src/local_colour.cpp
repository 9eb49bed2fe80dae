#include "calipso_align/local_colour.hpp"

#include <algorithm>
#include <utility>

namespace calipso::align {
namespace {

constexpr int kMinSamples = 30;   // fewer do not make a window's model
constexpr int kMaxSamples = 400;  // more do not make it better

}  // namespace

LocalColourModel::LocalColourModel(const cv::Mat& image, const cv::Mat& mask, int cell,
                                   int components, ColourModel everywhere)
    : cell_(cell),
      grid_(image.cols / cell + 2, image.rows / cell + 2),
      windows_(grid_.area()),
      everywhere_(std::move(everywhere)) {
#pragma omp parallel for schedule(static)
  for (int i = 0; i < grid_.area(); ++i)
    windows_[i] = fitWindow(image, mask, i % grid_.width, i / grid_.width, components);
}

// Window (column, row) is centred on the lattice point (column, row) * cell.
std::optional<ColourModel> LocalColourModel::fitWindow(const cv::Mat& image, const cv::Mat& mask,
                                                       int column, int row, int components) const {
  const cv::Rect window = cv::Rect((column - 1) * cell_, (row - 1) * cell_, 2 * cell_, 2 * cell_) &
                          cv::Rect(cv::Point(), image.size());
  if (window.empty()) return std::nullopt;
  const int count = cv::countNonZero(mask(window));
  if (count < kMinSamples) return std::nullopt;
  const int step = std::max(1, count / kMaxSamples);
  std::vector<cv::Vec3f> colours;
  int met = 0;
  for (int y = window.y; y < window.br().y; ++y)
    for (int x = window.x; x < window.br().x; ++x)
      if (mask.at<uchar>(y, x) && met++ % step == 0) colours.push_back(image.at<cv::Vec3b>(y, x));
  return ColourModel::fit(colours, components);
}

float LocalColourModel::cost(const cv::Vec3f& colour, int u, int v) const {
  const int column = u / cell_, row = v / cell_;
  const float a = static_cast<float>(u - column * cell_) / cell_;
  const float b = static_cast<float>(v - row * cell_) / cell_;
  float sum = 0.0f, weight = 0.0f;
  for (int j = 0; j < 2; ++j)
    for (int i = 0; i < 2; ++i) {
      const auto& window = windows_[(row + j) * grid_.width + column + i];
      const float w = (i ? a : 1.0f - a) * (j ? b : 1.0f - b);
      if (!window || w <= 0.0f) continue;
      sum += w * window->cost(colour);
      weight += w;
    }
  return weight > 0.0f ? sum / weight : everywhere_.cost(colour);
}

}  // namespace calipso::align
