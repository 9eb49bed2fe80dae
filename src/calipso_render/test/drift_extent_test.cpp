// Where a background drifts, its drift being known.

#include "place/drift_extent.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace calipso::render {
namespace {

constexpr int kWide = 200, kHigh = 160, kFrames = 9, kHorizon = 120;
const cv::Rect kObject(85, 60, 30, 96);  // before the horizon, at rest

cv::Mat noise(const cv::Size& size, double sigma, double scale, int seed) {
  cv::Mat m(size, CV_32F);
  cv::RNG random(seed);
  random.fill(m, cv::RNG::NORMAL, 0.0, sigma * scale * 3.5);
  cv::GaussianBlur(m, m, {}, scale);
  return m;
}

struct Clip {
  std::vector<DriftPicture> pictures;
  std::vector<cv::Point2f> shifts;
  cv::Mat ground = cv::Mat::zeros(kHigh, kWide, CV_8U);
};

// Clouds that drift, the less of them, the nearer to the horizon; below it a coast that rests, or
// water that ripples.
Clip coast(bool ripples) {
  const cv::Mat clouds = noise({kWide + 60, kHigh}, 15.0, 4.0, 3),
                land = noise({kWide, kHigh}, 15.0, 2.0, 4);
  Clip clip;
  clip.ground.rowRange(kHorizon, kHigh) = 255;
  for (int k = 0; k < kFrames; ++k) {
    cv::Mat grey = clouds.colRange(3 * k, 3 * k + kWide).clone();
    for (int v = 0; v < kHorizon; ++v)
      grey.row(v) *= std::clamp((kHorizon - 20 - v) / 40.0, 0.0, 1.0);
    grey += 180.0f;
    const cv::Rect below(0, kHorizon, kWide, kHigh - kHorizon);
    grey(below) = (ripples ? noise(land.size(), 10.0, 2.0, 50 + k) : land)(below) + 120.0f;
    grey += noise(grey.size(), 0.7, 1.0, 100 + k);
    cv::Mat covered = cv::Mat::zeros(grey.size(), CV_8U);
    covered(kObject) = 255, grey(kObject) = 30.0f;
    clip.pictures.push_back({grey, covered});
    clip.shifts.push_back({-3.0f * static_cast<float>(k), 0.0f});
  }
  return clip;
}

// Pixels on the wrong side of the horizon, that itself left out.
int wrong(const cv::Mat& where) {
  const int near = 3;
  return cv::countNonZero(where.rowRange(0, kHorizon - near) == 0) +
         cv::countNonZero(where.rowRange(kHorizon + near, kHigh));
}

TEST(DriftExtent, EndsAtWhatRestsAlsoBehindAnObject) {
  const Clip clip = coast(false);
  const cv::Mat where = whereDrifting(clip.pictures, clip.shifts, clip.ground);
  ASSERT_FALSE(where.empty());
  EXPECT_LT(wrong(where), where.total() / 100);
}

TEST(DriftExtent, EndsAtWhatMovesOtherwise) {
  const Clip clip = coast(true);
  const cv::Mat where = whereDrifting(clip.pictures, clip.shifts, clip.ground);
  ASSERT_FALSE(where.empty());
  EXPECT_LT(wrong(where), where.total() / 100);
}

// Clouds that drift beyond a round window, and an object that hides them, up to the window's trim.
struct Window {
  cv::Mat pane = cv::Mat::zeros(kHigh, kWide, CV_8U), object = pane.clone(), covered;
  Clip clip;

  // @param mottled deviation of the trim's colours
  explicit Window(double mottled) {
    const cv::Mat clouds = noise({kWide + 60, kHigh}, 15.0, 4.0, 3),
                  trim = noise({kWide, kHigh}, mottled, 3.0, 5);
    cv::circle(pane, {100, 60}, 90, 255, -1);
    object(cv::Rect(100, 60, 100, 100)) = 255;
    object &= pane;
    cv::dilate(object, covered, cv::Mat::ones(7, 7, CV_8U));
    for (int k = 0; k < kFrames; ++k) {
      cv::Mat grey = trim + 90.0f;
      cv::Mat(clouds.colRange(3 * k, 3 * k + kWide) + 180.0f).copyTo(grey, pane);
      grey.setTo(30.0f, object);
      grey += noise(grey.size(), 0.7, 1.0, 100 + k);
      clip.pictures.push_back({grey, covered});
      clip.shifts.push_back({-3.0f * static_cast<float>(k), 0.0f});
    }
  }
};

TEST(DriftExtent, GoesUpToARoundWindowsTrimBehindAnObjectThatEndsThere) {
  const Window w(0.0);
  const cv::Mat where = whereDrifting(w.clip.pictures, w.clip.shifts, cv::Mat());
  ASSERT_FALSE(where.empty());
  EXPECT_LT(cv::countNonZero((where == 0) & w.object), cv::countNonZero(w.object) / 100);
}

TEST(DriftExtent, LeavesOutAMottledTrimBesideWhatHidesTheDrift) {
  const Window w(4.0);
  const cv::Mat where = whereDrifting(w.clip.pictures, w.clip.shifts, cv::Mat());
  ASSERT_FALSE(where.empty());
  cv::Mat trim;
  cv::erode(~(w.pane | w.covered), trim, cv::Mat::ones(3, 3, CV_8U));  // cells are of 2 px
  EXPECT_LT(cv::countNonZero(where & trim), 10);
}

TEST(DriftExtent, IsNowhereIfAnotherDriftWasMeant) {
  Clip clip = coast(false);
  for (cv::Point2f& shift : clip.shifts) shift.x = -shift.x;
  EXPECT_TRUE(whereDrifting(clip.pictures, clip.shifts, cv::Mat()).empty());
}

}  // namespace
}  // namespace calipso::render
