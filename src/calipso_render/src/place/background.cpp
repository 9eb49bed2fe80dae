#include "calipso_render/background.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/inpaint.hpp"
#include "calipso_render/stage.hpp"
#include "place/key_cover.hpp"
#include "place/masked_quantile.hpp"
#include "place/place_samples.hpp"

namespace calipso::render {
namespace {

constexpr int kAgree = 7;  // px; a shadow that stays covers most of such a square or nothing of it
constexpr float kLeastResting = 5.0f;  // code values: of Background::resting_spread
constexpr float kMovingSpread = 2.2f;  // times what still places have, and
constexpr float kLeastMoving = 2.0f;   // code values: from there on a place moves by itself
// of its own gradients, what a place changes by if it moves by as large a part of a pixel: coded
// texture at rest changes, too, though by less
constexpr float kMovingPart = 0.25f;
constexpr int kMovingGap = 12;     // px between moving places that move with them
constexpr int kFewestMoving = 50;  // one part in so many of the picture; fewer are passing things
constexpr int kRowsAround = 2;     // on either side of a row, for what moves in it,
constexpr float kResting = 0.15f;  // and the part of it, or of a plane, up to which it rests
constexpr float kBlurred = 3.0f;   // code values of spread, from which a mean is blurred
constexpr float kAgreeing = 2.0f;  // spreads from it
constexpr int kSteadyDifference = 14;  // code values; about five deviations of the difference

}  // namespace

Background seenBackground(const std::vector<ClipFrame>& frames, bool objects_move,
                          const BackgroundParams& params) {
  CV_Assert(!frames.empty());
  const cv::Size size = frames.front().bgr.size();
  const PlaceSamples samples(frames, params.mask_margin_px);
  Background b;
  b.plate = cv::Mat::zeros(size, CV_32FC3);
  b.count = cv::Mat::zeros(size, CV_8U);
  b.spread = cv::Mat::zeros(size, CV_32F);
  b.origin = cv::Mat(size, CV_16SC2, cv::Scalar(-1, -1));
  cv::Mat long_shaded = cv::Mat::zeros(size, CV_8U), agreed;
#pragma omp parallel for schedule(static)
  for (int v = 0; v < size.height; ++v) {
    for (int u = 0; u < size.width; ++u) {
      Samples values = samples.at(u, v);
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
#pragma omp parallel for schedule(dynamic, 8)
  for (int v = 0; v < size.height; ++v) {
    for (int u = 0; u < size.width; ++u) {
      if (agreed.at<std::uint8_t>(v, u) == 0) continue;
      Samples values = samples.at(u, v);
      if (values.size() < 2) continue;
      keepBrighter(values);
      b.plate.at<cv::Vec3f>(v, u) = robustMean(values, b.spread.at<float>(v, u));
    }
  }
  b.invented = b.count == 0;
  b.resting_spread =
      std::max(kLeastResting, kMovingSpread * quantileOf(b.spread, b.invented == 0, 0.25));
  return b;
}

void sharpenSeen(const std::vector<ClipFrame>& frames, const BackgroundParams& params,
                 Background& background) {
  const PlaceSamples samples(frames, params.mask_margin_px);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < background.plate.rows; ++v) {
    for (int u = 0; u < background.plate.cols; ++u) {
      const float spread = background.spread.at<float>(v, u);
      if (spread < kBlurred) continue;
      cv::Vec3f& plate = background.plate.at<cv::Vec3f>(v, u);
      for (const cv::Vec3b& value : samples.at(u, v)) {
        const cv::Vec3f colour(value[0], value[1], value[2]);
        if (cv::norm(colour - plate, cv::NORM_INF) > kAgreeing * spread) continue;
        plate = colour;
        break;
      }
    }
  }
}

// By how much the place changes from a pixel to the next in the channel where it does most, code
// values, the mean around; what is not known does not count.
cv::Mat gradientsAround(const Background& background) {
  cv::Mat along_u, along_v, known, gradients(background.count.size(), CV_32F);
  cv::Sobel(background.plate, along_u, CV_32F, 1, 0, 3, 1.0 / 8.0);
  cv::Sobel(background.plate, along_v, CV_32F, 0, 1, 3, 1.0 / 8.0);
  cv::erode(background.count > 0, known, cv::Mat::ones(3, 3, CV_8U));
  for (int v = 0; v < gradients.rows; ++v) {
    for (int u = 0; u < gradients.cols; ++u) {
      float most = 0.0f;
      for (int c = 0; c < 3; ++c)
        most = std::max(most,
                        std::hypot(along_u.at<cv::Vec3f>(v, u)[c], along_v.at<cv::Vec3f>(v, u)[c]));
      gradients.at<float>(v, u) = known.at<std::uint8_t>(v, u) != 0 ? most : 0.0f;
    }
  }
  cv::blur(gradients, gradients, {5, 5});
  return gradients;
}

// Where the place moves by itself: it spreads over time, or the key frame shows something else than
// the median does. Empty if there is little of it: passing things.
cv::Mat movingPlaces(const ClipFrame& key, const Background& background) {
  const cv::Mat least = kMovingPart * gradientsAround(background);
  const auto beyondNoise = [&](const cv::Mat& change) {
    cv::Mat smooth;
    cv::blur(change, smooth, {5, 5});
    const float noise = kMovingSpread * quantileOf(smooth, background.count > 0, 0.25);
    return cv::Mat((smooth > std::max(kLeastMoving, noise)) & (smooth > least));
  };
  const auto leaveOutShaded = [&](cv::Mat& change) {
    if (!background.shaded_at_times.empty()) change.setTo(0, background.shaded_at_times);
  };
  cv::Mat spreads = beyondNoise(background.spread);
  leaveOutShaded(spreads);
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
  leaveOutShaded(difference);
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

// Along planes that move copies go on moving if they are shifted by whole pixels: nothing of such
// is sure.
InpaintParams alongRestingPlanes(const InpaintParams& place, const cv::Mat& moving,
                                 const cv::Mat& known) {
  InpaintParams guide = place;
  if (place.sure.empty()) return guide;
  guide.sure = place.sure.clone();
  for (std::size_t k = 0; k < place.planes.size(); ++k) {
    const cv::Mat here = place.surface == static_cast<double>(k + 1);
    if (cv::countNonZero(moving & here & known) > kResting * cv::countNonZero(here & known))
      guide.sure.setTo(0, here);
  }
  return guide;
}

void inventBackground(const cv::Mat& shaded, const ClipFrame& key, const InpaintParams& place,
                      const BackgroundParams& params, Background& background) {
  if (!shaded.empty()) background.invented |= shaded != 0;
  const cv::Mat moving = movingPlaces(key, background);
  const bool any_moving = cv::countNonZero(moving) > 0;
  cv::Mat look = background.plate.clone();
  if (any_moving) {
    cv::Mat now;
    key.bgr.convertTo(now, CV_32F);
    cv::Mat shows = closedGaps(moving) & (background.invented == 0) &
                    (grown(key.labels != 0, params.mask_margin_px) == 0);
    if (!background.shaded_at_times.empty()) shows.setTo(0, background.shaded_at_times);
    now.copyTo(look, shows);
  }
  const InpaintParams guide =
      any_moving ? alongRestingPlanes(place, moving, background.invented == 0) : place;
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
  background.live = LiveFill(live_origin, filled.lift, background.invented, key.bgr, key.labels);
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

cv::Mat steadyKeyFrame(const std::vector<ClipFrame>& frames, const cv::Mat& moving,
                       cv::Mat& steadiness) {
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
      const bool still =
          moving.at<std::uint8_t>(v, u) == 0 && 4 * same >= 3 * static_cast<int>(frames.size());
      steady.at<cv::Vec3f>(v, u) = still ? cv::Vec3f(sum / same) : cv::Vec3f(k[0], k[1], k[2]);
      steadiness.at<std::uint8_t>(v, u) =
          static_cast<std::uint8_t>(still ? std::min(same, 255) : 1);
    }
  }
  return steady;
}

}  // namespace calipso::render
