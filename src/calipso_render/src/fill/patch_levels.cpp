#include "fill/patch_levels.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "fill/patch_sources.hpp"

namespace calipso::render {
namespace {

constexpr float kLively = 6.0f;       // weight of the mean gradient against colour
constexpr int kLivelySide = 9;        // px of the square in which gradients are averaged
constexpr float kUnknown = 1e-3f;     // weight of unknown pixels in coarser levels
constexpr float kMostlyKnown = 0.5f;  // part of a coarser level's pixel from which it is no hole

// Mean gradient around every pixel, of what is known.
cv::Mat liveliness(const cv::Mat& image, const cv::Mat& known) {
  cv::Mat grey, strength = cv::Mat::zeros(image.size(), CV_32F),
                weight = cv::Mat::zeros(image.size(), CV_32F);
  cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < image.rows - 1; ++v) {
    for (int u = 0; u + 1 < image.cols; ++u) {
      const bool whole = known.at<std::uint8_t>(v, u) != 0 &&
                         known.at<std::uint8_t>(v + 1, u) != 0 &&
                         known.at<std::uint8_t>(v, u + 1) != 0;
      if (!whole) continue;
      const float g = grey.at<float>(v, u);
      strength.at<float>(v, u) =
          std::abs(grey.at<float>(v, u + 1) - g) + std::abs(grey.at<float>(v + 1, u) - g);
      weight.at<float>(v, u) = 1.0f;
    }
  }
  cv::blur(strength, strength, {kLivelySide, kLivelySide});
  cv::blur(weight, weight, {kLivelySide, kLivelySide});
  return strength / cv::max(weight, 1e-3);
}

// Half the size: the mean of what is known. A pixel is source if all of its four were, hole if less
// than half of it is known: what shows through narrow gaps, and lines drawn through the hole, are
// to be met at every level.
FillLevel halved(const FillLevel& fine) {
  const cv::Size size((fine.hole.cols + 1) / 2, (fine.hole.rows + 1) / 2);
  FillLevel half{cv::Mat::zeros(size, CV_32FC4),
                 cv::Mat::zeros(size, CV_32F),
                 {},
                 cv::Mat(size, CV_8U, cv::Scalar(255)),
                 {},
                 {},
                 {}};
  cv::Mat weight = cv::Mat::zeros(size, CV_32F), count = weight.clone();
#pragma omp parallel for schedule(static)
  for (int row = 0; row < size.height; ++row) {
    for (int v = 2 * row; v < std::min(2 * row + 2, fine.hole.rows); ++v) {
      for (int u = 0; u < fine.hole.cols; ++u) {
        const float known = fine.known.at<float>(v, u), w = std::max(known, kUnknown);
        half.source.at<std::uint8_t>(row, u / 2) &= fine.source.at<std::uint8_t>(v, u);
        half.image.at<cv::Vec4f>(row, u / 2) += w * fine.image.at<cv::Vec4f>(v, u);
        half.known.at<float>(row, u / 2) += known;
        weight.at<float>(row, u / 2) += w, count.at<float>(row, u / 2) += 1.0f;
      }
    }
    for (int u = 0; u < size.width; ++u)
      half.image.at<cv::Vec4f>(row, u) /= weight.at<float>(row, u);
  }
  half.known /= count;
  half.hole = half.known < kMostlyKnown;
  if (!fine.nearness.empty())
    cv::resize(fine.nearness, half.nearness, size, 0, 0, cv::INTER_NEAREST);
  if (!fine.surface.empty()) cv::resize(fine.surface, half.surface, size, 0, 0, cv::INTER_NEAREST);
  if (!fine.sky.empty()) cv::resize(fine.sky, half.sky, size, 0, 0, cv::INTER_NEAREST);
  return half;
}

}  // namespace

std::vector<FillLevel> fillLevels(const cv::Mat& image, const cv::Mat& hole, const cv::Mat& source,
                                  const InpaintParams& params) {
  std::vector<FillLevel> levels(1);
  cv::merge(std::vector<cv::Mat>{image, kLively * liveliness(image, hole == 0)}, levels[0].image);
  cv::Mat(hole == 0).convertTo(levels[0].known, CV_32F, 1.0 / 255.0);
  levels[0].hole = hole, levels[0].source = source, levels[0].nearness = params.nearness,
  levels[0].surface = params.surface, levels[0].sky = params.sky;
  while (std::min(levels.back().hole.cols, levels.back().hole.rows) / 2 >= params.coarsest_side)
    levels.push_back(halved(levels.back()));
  return levels;
}

int coarsestUseful(const std::vector<FillLevel>& levels, bool with_sources) {
  int k = static_cast<int>(levels.size()) - 1;
  const auto is_useful = [&] {
    return cv::countNonZero(levels[k].hole) > 0 &&
           !(with_sources && PatchSources(levels[k].source, cv::Mat()).empty());
  };
  while (k > 0 && !is_useful()) --k;
  return k;
}

float nearnessPerRow(const cv::Mat& nearness) {
  std::vector<float> steps;
  for (int v = 0; v + 1 < nearness.rows; ++v) {
    for (int u = 0; u < nearness.cols; u += 8) {
      const float here = nearness.at<float>(v, u), below = nearness.at<float>(v + 1, u);
      if (here > 0.0f && below > 0.0f) steps.push_back(std::abs(below - here));
    }
  }
  if (steps.empty()) return 0.0f;
  std::nth_element(steps.begin(), steps.begin() + steps.size() / 2, steps.end());
  return steps[steps.size() / 2];
}

}  // namespace calipso::render
