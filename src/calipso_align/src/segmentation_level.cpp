#include "calipso_align/segmentation_level.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_align/label_cut.hpp"

namespace calipso::align {
namespace {

constexpr size_t kMaxSamples = 12000;
constexpr double kSurroundings = 0.1;  // of the picture's width: what counts as near an object

cv::Mat grown(const cv::Mat& mask, int px) {
  const cv::Mat square =
      cv::getStructuringElement(cv::MORPH_RECT, cv::Size(2 * px + 1, 2 * px + 1));
  cv::Mat result;
  cv::dilate(mask, result, square);
  return result;
}

cv::Mat allowedRegion(const SegmentationTarget& target, const cv::Size& size) {
  cv::Mat allowed(size, CV_8U, cv::Scalar(target.rect.empty() ? 255 : 0));
  if (!target.rect.empty()) allowed(target.rect & cv::Rect(cv::Point(), size)).setTo(255);
  if (!target.lasso.empty()) {
    cv::Mat inside = cv::Mat::zeros(size, CV_8U);
    cv::fillPoly(inside, std::vector<std::vector<cv::Point>>{target.lasso}, 255);
    allowed &= inside;
  }
  return allowed;
}

cv::Mat resized(const cv::Mat& mask, const cv::Size& size) {
  cv::Mat result;
  cv::resize(mask, result, size, 0, 0, cv::INTER_NEAREST);
  return result;
}

}  // namespace

SegmentationLevel makeLevel(const cv::Mat& image, const std::vector<SegmentationTarget>& targets,
                            double scale) {
  SegmentationLevel level;
  const cv::Size size(static_cast<int>(std::lround(image.cols * scale)),
                      static_cast<int>(std::lround(image.rows * scale)));
  if (size == image.size())
    level.image = image;
  else
    cv::resize(image, level.image, size, 0, 0, cv::INTER_AREA);
  level.region = cv::Mat::zeros(size, CV_8U);
  for (const SegmentationTarget& target : targets) {
    level.allowed.push_back(resized(allowedRegion(target, image.size()), size));
    level.region |= level.allowed.back();
  }
  level.contrast_scale = contrastScale(level.image, level.region);
  level.labels = cv::Mat::zeros(size, CV_8U);
  return level;
}

void setSeeds(const std::vector<SegmentationTarget>& targets, const cv::Mat& strokes,
              SegmentationLevel& level) {
  level.seeds = cv::Mat::zeros(level.image.size(), CV_8U);
  if (strokes.empty()) return;
  const cv::Mat marks = resized(strokes, level.image.size());
  level.seeds.setTo(1, marks == kBackgroundStroke);
  level.labels.setTo(0, marks == kBackgroundStroke);
  for (size_t k = 0; k < targets.size(); ++k) {
    const cv::Mat own = marks == targets[k].label;
    level.seeds.setTo(static_cast<double>(k + 2), own);
    level.labels.setTo(static_cast<double>(k + 1), own);
  }
}

void evaluateCosts(const std::vector<ColourModel>& models, float outlier_cost,
                   SegmentationLevel& level) {
  level.costs.resize(models.size());
  for (size_t k = 0; k < models.size(); ++k) {
    cv::Mat& cost = level.costs[k];
    cost = cv::Mat(level.image.size(), CV_32F, cv::Scalar(kForbidden));
    const cv::Mat& allowed = k == 0 ? level.region : level.allowed[k - 1];
#pragma omp parallel for schedule(static)
    for (int y = 0; y < cost.rows; ++y)
      for (int x = 0; x < cost.cols; ++x)
        if (allowed.at<uchar>(y, x))
          cost.at<float>(y, x) =
              std::min(outlier_cost, models[k].cost(cv::Vec3f(level.image.at<cv::Vec3b>(y, x))));
  }
}

cv::Mat freePixels(const SegmentationLevel& level) { return level.region & (level.seeds == 0); }

cv::Mat uncertainPixels(const SegmentationLevel& level, int band_px) {
  cv::Mat low, high;
  const cv::Mat square = cv::getStructuringElement(cv::MORPH_RECT, cv::Size(3, 3));
  cv::erode(level.labels, low, square);
  cv::dilate(level.labels, high, square);
  cv::Mat doubtful = cv::Mat::zeros(level.labels.size(), CV_8U);
  for (int y = 0; y < doubtful.rows; ++y)
    for (int x = 0; x < doubtful.cols; ++x) {
      if (!level.region.at<uchar>(y, x)) continue;
      const float own = level.costs[level.labels.at<uchar>(y, x)].at<float>(y, x);
      for (const cv::Mat& cost : level.costs)
        if (cost.at<float>(y, x) < own) doubtful.at<uchar>(y, x) = 255;
    }
  return (grown(low != high, band_px) | grown(doubtful, band_px)) & freePixels(level);
}

std::vector<cv::Vec3f> sampleColours(const cv::Mat& image, const cv::Mat& mask) {
  std::vector<cv::Vec3f> all;
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x)
      if (mask.at<uchar>(y, x)) all.push_back(image.at<cv::Vec3b>(y, x));
  if (all.size() <= kMaxSamples) return all;
  std::vector<cv::Vec3f> few;
  for (size_t i = 0; i < kMaxSamples; ++i) few.push_back(all[i * all.size() / kMaxSamples]);
  return few;
}

cv::Mat surroundings(const SegmentationLevel& level) {
  return grown(level.region, std::max(3, static_cast<int>(kSurroundings * level.image.cols)));
}

}  // namespace calipso::align
