#include "calipso_align/segmentation_level.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_align/label_cut.hpp"
#include "calipso_align/mask_edge.hpp"
#include "calipso_align/planar_pieces.hpp"
#include "calipso_align/surface_islands.hpp"

namespace calipso::align {
namespace {

constexpr size_t kMaxSamples = 4000;

// What counts as near an object, px.
int nearReach(int picture_width) { return std::max(3, picture_width / 10); }

cv::Mat allowedRegion(const SegmentationTarget& target, const cv::Size& size) {
  cv::Mat allowed(size, CV_8U, cv::Scalar(target.rect.empty() ? 255 : 0));
  if (!target.rect.empty()) allowed(target.rect & cv::Rect(cv::Point(), size)).setTo(255);
  return allowed;
}

cv::Mat resized(const cv::Mat& mask, const cv::Size& size) {
  cv::Mat result;
  cv::resize(mask, result, size, 0, 0, cv::INTER_NEAREST);
  return result;
}

// Cost of a label's surface at a pixel: a fitted model's, which may lack details, or any of the
// label's.
float surfaceCost(const LabelModel& model, const SegmentationLevel& level, size_t k, int x, int y) {
  constexpr float kDetails = 0.2f;   // part of a label's pixels that its model does not know
  constexpr float kInFront = 20.0f;  // nats: more than any colour says
  const float any = model.surfaces->cost(level.relief, x, y);
  if (!model.expected || level.relief.state.at<uchar>(y, x) != Relief::kSurface) return any;
  const float expected = level.expected[k].at<float>(y, x);
  const float seen = level.relief.surface.at<cv::Vec3f>(y, x)[2];
  if (seen > model.expected->before) return any + kInFront;
  float on_model = 0.0f;
  if (expected > 0.0f) {
    const float r = (seen - expected) / model.expected->sigma;
    on_model = (1.0f - kDetails) * std::exp(any - model.expected->nearest_cost - 0.5f * r * r);
  }
  return any - std::log(on_model + kDetails);
}

// Where the surface ends at this pixel, its colour is a mixture with that of what lies behind or
// before.
bool isMixed(const SegmentationLevel& level, int x, int y) {
  const auto ends = [&](const cv::Point& p, const cv::Point& step) {
    const cv::Rect whole(cv::Point(), level.relief.state.size());
    if (!whole.contains(p) || !whole.contains(p + step)) return false;
    const float j = jump(level.relief, p, step);
    return level.jump_scale * j * j > 1.0f;
  };
  return ends({x, y}, {1, 0}) || ends({x - 1, y}, {1, 0}) || ends({x, y}, {0, 1}) ||
         ends({x, y - 1}, {0, 1});
}

// Strokes in a smaller picture, where a line of one pixel must not get lost: of the marks that fall
// into a pixel the first counts.
cv::Mat thinnedOut(const cv::Mat& strokes, const cv::Size& size) {
  if (strokes.size() == size) return strokes;
  cv::Mat marks = cv::Mat::zeros(size, CV_8U);
  for (int y = 0; y < strokes.rows; ++y)
    for (int x = 0; x < strokes.cols; ++x) {
      const uchar mark = strokes.at<uchar>(y, x);
      if (mark == 0) continue;
      uchar& cell = marks.at<uchar>(y * size.height / strokes.rows, x * size.width / strokes.cols);
      if (cell == 0) cell = mark;
    }
  return marks;
}

}  // namespace

cv::Rect viewOf(const std::vector<SegmentationTarget>& targets, const cv::Size& size) {
  const cv::Rect whole(cv::Point(), size);
  cv::Rect view;
  for (const SegmentationTarget& target : targets)
    view |= target.rect.empty() ? whole : target.rect & whole;
  const int margin = nearReach(size.width);
  return cv::Rect(view.x - margin, view.y - margin, view.width + 2 * margin,
                  view.height + 2 * margin) &
         whole;
}

SegmentationLevel makeLevel(const cv::Mat& image, const std::vector<SegmentationTarget>& targets,
                            const Relief& relief, const cv::Rect& view, double scale) {
  SegmentationLevel level;
  const cv::Size size(static_cast<int>(std::lround(view.width * scale)),
                      static_cast<int>(std::lround(view.height * scale)));
  level.near_px = std::max(3, static_cast<int>(scale * nearReach(image.cols)));
  if (size == view.size())
    level.image = image(view);
  else
    cv::resize(image(view), level.image, size, 0, 0,
               relief.registered ? cv::INTER_NEAREST : cv::INTER_AREA);
  level.region = cv::Mat::zeros(size, CV_8U);
  for (const SegmentationTarget& target : targets) {
    level.allowed.push_back(resized(allowedRegion(target, image.size())(view), size));
    level.region |= level.allowed.back();
  }
  level.contrast_scale = contrastScale(level.image, level.region);
  level.labels = cv::Mat::zeros(size, CV_8U);
  level.relief = resized(relief, view, size);
  const float mean = relief.empty() ? 0.0f : meanJump(level.relief, level.region);
  level.jump_scale = mean > 0.0f ? 0.5f / (mean * mean) : 0.0f;
  if (level.relief.registered) {
    level.mixed = cv::Mat::zeros(size, CV_8U);
    for (int y = 0; y < size.height; ++y)
      for (int x = 0; x < size.width; ++x)
        level.mixed.at<uchar>(y, x) = isMixed(level, x, y) ? 255 : 0;
  }
  return level;
}

void setSeeds(const std::vector<SegmentationTarget>& targets, const cv::Mat& strokes,
              SegmentationLevel& level) {
  constexpr double kFlat = 0.1;  // of the strokes
  level.seeds = cv::Mat::zeros(level.image.size(), CV_8U);
  level.stroked.release();
  level.floating.release();
  level.lies_flat.assign(targets.size() + 1, 0);
  if (strokes.empty()) return;
  const cv::Mat marks = thinnedOut(strokes, level.image.size());
  level.seeds.setTo(1, marks == kBackgroundStroke);
  level.labels.setTo(0, marks == kBackgroundStroke);
  for (size_t k = 0; k < targets.size(); ++k) {
    const cv::Mat own = (marks == targets[k].label) & level.allowed[k];
    level.seeds.setTo(static_cast<double>(k + 2), own);
    level.labels.setTo(static_cast<double>(k + 1), own);
  }
  for (size_t k = 0; k <= targets.size() && !level.relief.on_support.empty(); ++k) {
    const cv::Mat own = level.seeds == static_cast<int>(k + 1);
    level.lies_flat[k] =
        cv::countNonZero(own & level.relief.on_support) > kFlat * cv::countNonZero(own);
  }
  if (!level.relief.registered) return;
  level.stroked = strokesOfPieces(level.relief.pieces, level.seeds);
  // A wall goes on behind an object, also where that encloses a piece of it.
  const cv::Mat of_planes = strokesOfPieces(level.relief.planes, level.seeds);
  level.stroked.setTo(1, (level.stroked == 0) & (of_planes == 1));
  level.floating = seedsOfIslands(level.relief.islands, level.seeds, level.allowed);
  if (!level.relief.raised.empty()) {
    // A vessel's inside and outside are parted by a jump, but stand on the table as one.
    const cv::Mat carried = seedsOfIslands(level.relief.raised, level.seeds, level.allowed);
    carried.copyTo(level.floating, (level.floating == 0) & (carried != 0));
  }
  level.floating.copyTo(level.stroked, (level.stroked == 0) & (level.floating != 0));
}

void fitColours(const SegmentationLevel& level, const cv::Mat& mask, int components,
                LabelModel& model) {
  const auto fit = [&](const cv::Mat& part) -> std::optional<GaussianMixture> {
    const std::vector<cv::Vec3f> samples = sampleColours(level.image, part);
    if (samples.empty()) return std::nullopt;
    return GaussianMixture::fit(samples, components);
  };
  if (!level.relief.registered) {
    model.colours = fit(mask);
    return;
  }
  const cv::Mat open = level.relief.state == Relief::kNone;
  model.colours = fit(mask & ~open);
  model.open_colours = fit(mask & open);
}

void evaluateCosts(const std::vector<LabelModel>& models, float outlier_cost,
                   SegmentationLevel& level) {
  constexpr float kMixed = 0.25f;  // what a colour that is a mixture still counts
  // nats, of a pixel in a flat piece that has strokes of another label only
  constexpr float kDivided = 10.0f;
  level.costs.resize(models.size());
  for (size_t k = 0; k < models.size(); ++k) {
    cv::Mat& cost = level.costs[k];
    cost = cv::Mat(level.image.size(), CV_32F, cv::Scalar(kForbidden));
    const cv::Mat& allowed = k == 0 ? level.region : level.allowed[k - 1];
#pragma omp parallel for schedule(static)
    for (int y = 0; y < cost.rows; ++y)
      for (int x = 0; x < cost.cols; ++x)
        if (allowed.at<uchar>(y, x)) {
          const bool open =
              level.relief.registered && level.relief.state.at<uchar>(y, x) == Relief::kNone;
          const std::optional<GaussianMixture>& colours =
              open ? models[k].open_colours : models[k].colours;
          cost.at<float>(y, x) = outlier_cost;
          if (colours)
            cost.at<float>(y, x) =
                std::min(outlier_cost, colours->cost(cv::Vec3f(level.image.at<cv::Vec3b>(y, x))));
          if (!level.mixed.empty() && level.mixed.at<uchar>(y, x)) cost.at<float>(y, x) *= kMixed;
          const int stroke = level.stroked.empty() ? 0 : level.stroked.at<uchar>(y, x);
          if (stroke != 0 && stroke != static_cast<int>(k + 1)) cost.at<float>(y, x) += kDivided;
          if (models[k].surfaces) cost.at<float>(y, x) += surfaceCost(models[k], level, k, x, y);
        }
  }
}

cv::Mat believedPixels(const SegmentationLevel& level, size_t k) {
  const cv::Mat own = level.labels == static_cast<int>(k);
  if (level.floating.empty()) return own;
  return (own & (level.floating == 0)) | (level.floating == static_cast<int>(k + 1));
}

cv::Mat nearIslands(const SegmentationLevel& level, const cv::Mat& own, size_t k) {
  if (level.floating.empty()) return own;
  const cv::Mat island = own & (level.floating == static_cast<int>(k + 1));
  if (2 * cv::countNonZero(island) <= cv::countNonZero(own)) return own;
  cv::Mat inverse_depth;
  cv::extractChannel(level.relief.surface, inverse_depth, 2);
  double least = 0.0, most = 0.0;
  cv::minMaxLoc(inverse_depth, &least, &most, nullptr, nullptr, island);
  const double margin = 0.1 * (most - least);
  const cv::Mat near = (inverse_depth >= least - margin) & (inverse_depth <= most + margin);
  return own & (near | (level.relief.state != Relief::kSurface));
}

cv::Mat freePixels(const SegmentationLevel& level) { return level.region & (level.seeds == 0); }

cv::Mat contradictedPixels(const SegmentationLevel& level) {
  cv::Mat contradicted = cv::Mat::zeros(level.labels.size(), CV_8U);
  for (int y = 0; y < contradicted.rows; ++y)
    for (int x = 0; x < contradicted.cols; ++x) {
      if (!level.region.at<uchar>(y, x)) continue;
      const float own = level.costs[level.labels.at<uchar>(y, x)].at<float>(y, x);
      for (const cv::Mat& cost : level.costs)
        if (cost.at<float>(y, x) < own) contradicted.at<uchar>(y, x) = 255;
    }
  return contradicted;
}

cv::Mat uncertainPixels(const SegmentationLevel& level, int band_px) {
  cv::Mat low, high;
  const cv::Mat square = cv::getStructuringElement(cv::MORPH_RECT, cv::Size(3, 3));
  cv::erode(level.labels, low, square);
  cv::dilate(level.labels, high, square);
  return grown((low != high) | contradictedPixels(level), band_px) & freePixels(level);
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

cv::Mat surroundings(const SegmentationLevel& level) { return grown(level.region, level.near_px); }

}  // namespace calipso::align
