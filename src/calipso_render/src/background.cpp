#include "calipso_render/background.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "calipso_render/inpaint.hpp"
#include "calipso_render/stage.hpp"
#include "masked_quantile.hpp"

namespace calipso::render {
namespace {

constexpr float kNearMedian = 6.0f;    // code values; farther ones do not enter the mean
constexpr float kLit = 0.75f;          // quantile of brightness that stands for the unshaded value
constexpr std::size_t kFewestLit = 3;  // samples that a lit or shaded group must have
constexpr double kGroupGap = 4.0;      // gap between two groups, in spreads of either
// a shadow's largest ratio of shaded to lit in a channel over its smallest
constexpr float kShadowTint = 1.8f;
constexpr int kAgree = 7;  // px; a shadow that stays covers most of such a square or nothing of it
constexpr float kMovingSpread = 2.2f;  // times what still places have, and
constexpr float kLeastMoving = 2.0f;   // code values: from there on a place moves by itself
constexpr int kMovingGap = 12;         // px between moving places that move with them
constexpr int kFewestMoving = 50;  // one part in so many of the picture; fewer are passing things
constexpr int kRowsAround = 2;     // on either side of a row, for what moves in it,
constexpr float kResting = 0.15f;  // and the part of them up to which it rests
constexpr int kSteadyDifference = 14;  // code values; about five deviations of the difference

cv::Mat grown(const cv::Mat& mask, int radius) {
  cv::Mat out;
  const cv::Size side(2 * radius + 1, 2 * radius + 1);
  cv::dilate(mask, out, cv::getStructuringElement(cv::MORPH_ELLIPSE, side));
  return out;
}

int brightness(const cv::Vec3b& c) { return c[0] + 2 * c[1] + c[2]; }

using Samples = std::vector<cv::Vec3b>;

// Where values in order of brightness fall apart best: the least sum of squares within two groups
// (Otsu).
std::size_t bestSplit(const Samples& sorted) {
  double total = 0.0, below = 0.0, best = -1.0;
  for (const cv::Vec3b& c : sorted) total += brightness(c);
  std::size_t split = 0;
  for (std::size_t i = 1; i < sorted.size(); ++i) {
    below += brightness(sorted[i - 1]);
    const double gap = (total - below) / (sorted.size() - i) - below / i;
    const double between = gap * gap * i * (sorted.size() - i);
    if (between > best) best = between, split = i;
  }
  return split;
}

// Half the range that the middle half of a group covers, at least the camera's noise.
double groupSpread(const Samples& sorted, std::size_t from, std::size_t to) {
  const std::size_t quarter = (to - from) / 4;
  return std::max(0.5 * (brightness(sorted[to - 1 - quarter]) - brightness(sorted[from + quarter])),
                  1.0 * kNearMedian);
}

// A shadow darkens all channels, and to about the same part of their linear values.
bool darkenedAlike(const cv::Vec3b& shaded, const cv::Vec3b& lit) {
  float least = 1.0f, most = 0.0f;
  for (int c = 0; c < 3; ++c) {
    const float ratio = linearFromCode(shaded[c]) / std::max(linearFromCode(lit[c]), 1e-3f);
    least = std::min(least, ratio), most = std::max(most, ratio);
  }
  return most < 1.0f && most < kShadowTint * least;
}

// Brightness without shade. A shadow that stays can hold most of the samples; two clear groups
// that differ as shade does tell it, however few the bright ones are.
double litBrightness(double step, Samples values) {
  const auto darker = [](const cv::Vec3b& a, const cv::Vec3b& b) {
    return brightness(a) < brightness(b);
  };
  std::stable_sort(values.begin(), values.end(), darker);
  const std::size_t n = values.size(), split = bestSplit(values);
  const double usual = brightness(values[static_cast<std::size_t>(kLit * (n - 1))]);
  if (split < kFewestLit || n - split < kFewestLit) return usual;
  const cv::Vec3b &shaded = values[split / 2], &lit = values[(split + n) / 2];
  const double gap = brightness(lit) - brightness(shaded);
  const double spread = std::max(groupSpread(values, 0, split), groupSpread(values, split, n));
  const bool apart = gap > std::max(step * brightness(lit), kGroupGap * spread);
  return apart && darkenedAlike(shaded, lit) ? brightness(lit) : usual;
}

// Leaves out the darker group if the values fall into two, and tells whether they do.
bool dropShaded(double step, Samples& values) {
  const std::size_t before = values.size();
  const double lit = litBrightness(step, values);
  const double limit = lit - std::max(step * lit, 4.0 * kNearMedian);
  values.erase(std::remove_if(values.begin(), values.end(),
                              [&](const cv::Vec3b& c) { return brightness(c) < limit; }),
               values.end());
  return 2 * values.size() < before;
}

// Leaves out the darker of the two groups that the values fall into best.
void keepBrighter(Samples& values) {
  const auto darker = [](const cv::Vec3b& a, const cv::Vec3b& b) {
    return brightness(a) < brightness(b);
  };
  std::stable_sort(values.begin(), values.end(), darker);
  values.erase(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(bestSplit(values)));
}

// Median per channel, then the mean of what lies around it; `spread`: the largest channel's MAD.
cv::Vec3f robustMean(const std::vector<cv::Vec3b>& values, float& spread) {
  cv::Vec3f result;
  spread = 0.0f;
  std::vector<int> sorted(values.size()), deviation(values.size());
  const std::size_t middle = values.size() / 2;
  for (int c = 0; c < 3; ++c) {
    for (std::size_t i = 0; i < values.size(); ++i) sorted[i] = values[i][c];
    std::nth_element(sorted.begin(), sorted.begin() + middle, sorted.end());
    const int median = sorted[middle];
    float sum = 0.0f;
    int used = 0;
    for (std::size_t i = 0; i < values.size(); ++i) {
      deviation[i] = std::abs(values[i][c] - median);
      if (deviation[i] <= kNearMedian) sum += values[i][c], ++used;
    }
    std::nth_element(deviation.begin(), deviation.begin() + middle, deviation.end());
    spread = std::max(spread, static_cast<float>(deviation[middle]));
    result[c] = sum / used;
  }
  return result;
}

}  // namespace

Background seenBackground(const std::vector<ClipFrame>& frames, bool objects_move,
                          const BackgroundParams& params) {
  CV_Assert(!frames.empty());
  const cv::Size size = frames.front().bgr.size();
  std::vector<cv::Mat> covered;
  for (const ClipFrame& f : frames) covered.push_back(grown(f.labels != 0, params.mask_margin_px));
  Background b;
  b.plate = cv::Mat::zeros(size, CV_32FC3);
  b.count = cv::Mat::zeros(size, CV_8U);
  b.spread = cv::Mat::zeros(size, CV_32F);
  b.origin = cv::Mat(size, CV_16SC2, cv::Scalar(-1, -1));
  const auto samplesAt = [&](int u, int v) {
    Samples values;
    for (std::size_t i = 0; i < frames.size(); ++i) {
      if (covered[i].at<std::uint8_t>(v, u) == 0)
        values.push_back(frames[i].bgr.at<cv::Vec3b>(v, u));
    }
    return values;
  };
  cv::Mat long_shaded = cv::Mat::zeros(size, CV_8U), agreed;
#pragma omp parallel for schedule(static)
  for (int v = 0; v < size.height; ++v) {
    for (int u = 0; u < size.width; ++u) {
      Samples values = samplesAt(u, v);
      if (values.empty()) continue;
      b.count.at<std::uint8_t>(v, u) =
          static_cast<std::uint8_t>(std::min<std::size_t>(255, values.size()));
      if (objects_move && dropShaded(params.shadow_step, values))
        long_shaded.at<std::uint8_t>(v, u) = 255;
      b.plate.at<cv::Vec3f>(v, u) = robustMean(values, b.spread.at<float>(v, u));
    }
  }
  // Of a shadow that stays, single pixels can have too little contrast to tell.
  cv::medianBlur(long_shaded, agreed, kAgree);
  agreed &= long_shaded == 0;
  for (int v = 0; v < size.height; ++v) {
    for (int u = 0; u < size.width; ++u) {
      if (agreed.at<std::uint8_t>(v, u) == 0) continue;
      Samples values = samplesAt(u, v);
      if (values.size() < 2) continue;
      keepBrighter(values);
      b.plate.at<cv::Vec3f>(v, u) = robustMean(values, b.spread.at<float>(v, u));
    }
  }
  b.invented = b.count == 0;
  return b;
}

// Where the place moves by itself: it spreads over time, or the key frame shows something else than
// the median does. Empty if there is little of it: passing things.
cv::Mat movingPlaces(const ClipFrame& key, const Background& background) {
  const auto beyondNoise = [&](const cv::Mat& change) {
    cv::Mat smooth;
    cv::blur(change, smooth, {5, 5});
    return cv::Mat(
        smooth >
        std::max(kLeastMoving, kMovingSpread * quantileOf(smooth, background.count > 0, 0.25)));
  };
  const cv::Mat spreads = beyondNoise(background.spread);
  if (kFewestMoving * static_cast<std::size_t>(cv::countNonZero(spreads)) <= spreads.total())
    return cv::Mat::zeros(spreads.size(), CV_8U);
  cv::Mat now, difference(spreads.size(), CV_32F, cv::Scalar(0.0f));
  key.bgr.convertTo(now, CV_32F);
  for (int v = 0; v < now.rows; ++v) {
    for (int u = 0; u < now.cols; ++u) {
      if (background.count.at<std::uint8_t>(v, u) == 0 || key.labels.at<std::uint8_t>(v, u) != 0)
        continue;
      const cv::Vec3f d = now.at<cv::Vec3f>(v, u) - background.plate.at<cv::Vec3f>(v, u);
      difference.at<float>(v, u) = std::max({std::abs(d[0]), std::abs(d[1]), std::abs(d[2])});
    }
  }
  return spreads | beyondNoise(difference);
}

// With the gaps between: there the key frame, and no median, belongs to what is around.
cv::Mat closedGaps(const cv::Mat& moving) {
  const int gap = kMovingGap;
  cv::Mat closed;
  cv::copyMakeBorder(moving, closed, gap, gap, gap, gap, cv::BORDER_REPLICATE);
  cv::morphologyEx(closed, closed, cv::MORPH_CLOSE,
                   cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * gap + 1, 2 * gap + 1}));
  return closed(cv::Rect(gap, gap, moving.cols, moving.rows)).clone();
}

// Part of what is known in the rows around that moves; 0.5 where nothing is. Places are layered:
// where the rows around rest, what is hidden rests as well.
cv::Mat motionOfRows(const cv::Mat& moving, const cv::Mat& known) {
  cv::Mat motion(moving.rows, 1, CV_32F), weight(moving.rows, 1, CV_32F);
  for (int v = 0; v < moving.rows; ++v) {
    motion.at<float>(v) = static_cast<float>(cv::countNonZero(moving.row(v) & known.row(v)));
    weight.at<float>(v) = static_cast<float>(cv::countNonZero(known.row(v)));
  }
  const cv::Size around(1, 2 * kRowsAround + 1);
  cv::blur(motion, motion, around, {-1, -1}, cv::BORDER_REPLICATE);
  cv::blur(weight, weight, around, {-1, -1}, cv::BORDER_REPLICATE);
  return (motion + 0.5f) / (weight + 1.0f);
}

void inventBackground(const cv::Mat& shaded, const ClipFrame& key, const InpaintParams& place,
                      Background& background) {
  if (!shaded.empty()) background.invented |= shaded != 0;
  const cv::Mat moving = movingPlaces(key, background);
  const bool any_moving = cv::countNonZero(moving) > 0;
  cv::Mat look = background.plate.clone();
  if (any_moving) {
    cv::Mat now;
    key.bgr.convertTo(now, CV_32F);
    now.copyTo(look, closedGaps(moving) & (background.invented == 0) & (key.labels == 0));
  }
  InpaintParams guide = place;
  if (any_moving) guide.planes.clear();  // copies that go on moving are shifted by whole pixels
  const auto start = std::chrono::steady_clock::now();
  const InpaintResult filled = inpaint(look, background.invented, cv::Mat(), guide);
  background.filling_ms =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  filled.image.copyTo(background.plate, background.invented);
  background.origin = filled.origin;
  if (!any_moving) return;
  const cv::Mat rows = motionOfRows(moving, background.invented == 0);
  cv::Mat live_origin(moving.size(), CV_16SC2, cv::Scalar(-1, -1));
  for (int v = 0; v < moving.rows; ++v) {
    if (rows.at<float>(v) < kResting) continue;
    for (int u = 0; u < moving.cols; ++u) {
      const cv::Vec2s from = background.origin.at<cv::Vec2s>(v, u);
      if (from[0] >= 0 && moving.at<std::uint8_t>(from[1], from[0]) != 0)
        live_origin.at<cv::Vec2s>(v, u) = from;
    }
  }
  background.live = LiveFill(live_origin, background.invented);
}

cv::Mat groundNearness(const std::vector<SupportPlane>& planes, const Camera& camera,
                       const cv::Mat& scenery) {
  cv::Mat nearness = cv::Mat::zeros(camera.height, camera.width, CV_32F);
  const Eigen::Isometry3d from_world = camera.world_from_camera.inverse();
#pragma omp parallel for schedule(static)
  for (int v = 0; v < nearness.rows; ++v) {
    for (int u = 0; u < nearness.cols; ++u) {
      const auto receiver =
          receiverAt(planes, camera, static_cast<float>(u), static_cast<float>(v));
      if (!receiver) continue;
      float& near = nearness.at<float>(v, u);
      near = static_cast<float>(1.0 / (from_world * receiver->position.cast<double>()).z());
      const float seen = scenery.empty() ? 0.0f : scenery.at<float>(v, u);
      if (seen > 0.0f) near = std::min(near, seen);
    }
  }
  return cv::countNonZero(nearness) > 0 ? nearness : cv::Mat();
}

cv::Mat steadyKeyFrame(const std::vector<ClipFrame>& frames, cv::Mat& steadiness) {
  CV_Assert(!frames.empty());
  const ClipFrame& key = frames.front();
  cv::Mat steady(key.bgr.size(), CV_32FC3);
  steadiness = cv::Mat(key.bgr.size(), CV_8U);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < steady.rows; ++v) {
    for (int u = 0; u < steady.cols; ++u) {
      const cv::Vec3b k = key.bgr.at<cv::Vec3b>(v, u);
      cv::Vec3f sum;
      int same = 0;
      for (const ClipFrame& f : frames) {
        const cv::Vec3b x = f.bgr.at<cv::Vec3b>(v, u);
        const int difference =
            std::max({std::abs(x[0] - k[0]), std::abs(x[1] - k[1]), std::abs(x[2] - k[2])});
        if (difference > kSteadyDifference ||
            f.labels.at<std::uint8_t>(v, u) != key.labels.at<std::uint8_t>(v, u))
          continue;
        sum += cv::Vec3f(x[0], x[1], x[2]), ++same;
      }
      // Something that moves agrees with the key frame by chance only: then the key frame alone
      // counts.
      const bool still = 4 * same >= 3 * static_cast<int>(frames.size());
      steady.at<cv::Vec3f>(v, u) = still ? cv::Vec3f(sum / same) : cv::Vec3f(k[0], k[1], k[2]);
      steadiness.at<std::uint8_t>(v, u) =
          static_cast<std::uint8_t>(still ? std::min(same, 255) : 1);
    }
  }
  return steady;
}

}  // namespace calipso::render
