// A background that drifts as a whole: found, followed, and drawn where objects hide it.

#include "calipso_render/drifting_background.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "render_test_scene.hpp"

namespace calipso::render {
namespace {

constexpr int kWide = 320, kHigh = 200, kFrames = 13, kTrim = 12;
constexpr int kAround = 40;  // px of clouds beyond the picture
const cv::Rect kObject(140, 70, 40, 60);
const cv::Point2f kPace(-2.3f, 0.4f);  // px per frame

// Clouds: noise of two scales that does not repeat itself, (0, 0) in its middle.
const cv::Mat& clouds() {
  static const cv::Mat picture = [] {
    cv::Mat fine(kHigh + 2 * kAround, kWide + 2 * kAround, CV_32FC3),
        coarse(fine.size() / 8, CV_32FC3);
    cv::RNG random(7);
    random.fill(fine, cv::RNG::NORMAL, 0.0, 60.0), random.fill(coarse, cv::RNG::NORMAL, 0.0, 40.0);
    cv::GaussianBlur(fine, fine, {}, 1.5);
    cv::resize(coarse, coarse, fine.size(), 0, 0, cv::INTER_CUBIC);
    return cv::Mat(fine + coarse + cv::Scalar(170, 150, 130));
  }();
  return picture;
}

cv::Vec3b cloudAt(float x, float y) {
  cv::Mat pixel;
  cv::getRectSubPix(clouds(), {1, 1}, {x + kAround, y + kAround}, pixel);
  return cv::Vec3b(pixel.at<cv::Vec3f>(0));
}

enum class Motion { kDrifts, kRests, kRipples };

// A window with a trim that rests; behind it what moves; before it, within the trim, an object.
// @param cut px by which its lower right corner is cut off
ClipFrame frameAt(int k, Motion motion, const cv::Rect& object, int cut = 0) {
  ClipFrame f{cv::Mat(kHigh, kWide, CV_8UC3), cv::Mat::zeros(kHigh, kWide, CV_8U), Camera()};
  f.camera.width = kWide, f.camera.height = kHigh;
  f.stamp_ns = 33'000'000LL * k;
  cv::RNG noise(100 + k);
  for (int v = 0; v < kHigh; ++v) {
    for (int u = 0; u < kWide; ++u) {
      cv::Point2f shift;
      if (motion == Motion::kDrifts) shift = kPace * static_cast<float>(k);
      if (motion == Motion::kRipples)
        shift = {4.0f * std::sin(1.7f * k + 0.2f * v), 3.0f * std::sin(2.3f * k + 0.3f * u)};
      cv::Vec3b c = cloudAt(u - shift.x, v - shift.y);
      const bool trim = u < kTrim || v < kTrim || u >= kWide - kTrim || v >= kHigh - kTrim ||
                        u + v >= kWide + kHigh - 2 * kTrim - cut;
      if (trim)
        c = cv::Vec3b::all(static_cast<uchar>(60 + 8 * ((u / 3 + v / 5) % 3)));
      else if (object.contains({u, v}))
        c = {20, 30, 200}, f.labels.at<uchar>(v, u) = 1;
      for (int i = 0; i < 3; ++i) c[i] = cv::saturate_cast<uchar>(c[i] + noise.gaussian(1.5));
      f.bgr.at<cv::Vec3b>(v, u) = c;
    }
  }
  return f;
}

std::vector<ClipFrame> clipOf(Motion motion, const cv::Rect& object = kObject) {
  std::vector<ClipFrame> frames;
  for (int k = 0; k < kFrames; ++k) frames.push_back(frameAt(k, motion, object));
  return frames;
}

TEST(DriftingBackground, IsFollowedBesideWhatRests) {
  const DriftingBackground drifting(clipOf(Motion::kDrifts), 2, cv::Mat());
  ASSERT_TRUE(drifting.established());
  for (const int k : {1, 6, 12}) {
    const auto shift = drifting.shiftAt(33'000'000LL * k);
    ASSERT_TRUE(shift);
    EXPECT_NEAR(shift->x, kPace.x * k, 0.05) << k;
    EXPECT_NEAR(shift->y, kPace.y * k, 0.05) << k;
  }
  const auto between = drifting.shiftAt(33'000'000LL * 7 / 2);
  ASSERT_TRUE(between);
  EXPECT_NEAR(between->x, kPace.x * 3.5f, 0.05);
  EXPECT_FALSE(drifting.shiftAt(33'000'000LL * 30)) << "the clip does not cover it";
  const cv::Rect inside(2 * kTrim, 2 * kTrim, kWide - 4 * kTrim, kHigh - 4 * kTrim);
  EXPECT_LT(cv::countNonZero(drifting.where()(inside) == 0), 0.01 * inside.area())
      << "also behind the object";
  EXPECT_LT(cv::countNonZero(drifting.where().colRange(0, kTrim - 3)), 10) << "the trim rests";
}

std::vector<ClipFrame> enlarged(std::vector<ClipFrame> frames, int times, int by) {
  for (ClipFrame& f : frames) {
    cv::resize(f.bgr, f.bgr, {}, times, times, by);
    cv::resize(f.labels, f.labels, {}, times, times, cv::INTER_NEAREST);
    f.camera.width *= times, f.camera.height *= times;
  }
  return frames;
}

// Where a large picture drifts is told in a reduced one, how far in itself.
TEST(DriftingBackground, IsFoundInLargePicturesAsInSmallOnes) {
  const std::vector<ClipFrame> frames = enlarged(clipOf(Motion::kDrifts), 2, cv::INTER_LINEAR);
  const DriftingBackground small(frames, 2, cv::Mat()),
      large(enlarged(frames, 2, cv::INTER_NEAREST), 2, cv::Mat());
  ASSERT_TRUE(small.established() && large.established());
  cv::Mat wanted;
  cv::resize(small.where(), wanted, {}, 2, 2, cv::INTER_NEAREST);
  ASSERT_EQ(large.where().size(), wanted.size());
  EXPECT_LT(cv::countNonZero(large.where() != wanted), 0.001 * wanted.total());
  for (const int k : {1, 6, 12}) {
    const auto shift = large.shiftAt(33'000'000LL * k);
    ASSERT_TRUE(shift);
    EXPECT_NEAR(shift->x, 4.0f * kPace.x * k, 0.1) << k;
    EXPECT_NEAR(shift->y, 4.0f * kPace.y * k, 0.1) << k;
  }
}

TEST(DriftingBackground, WhatOtherFramesShowBesideTheObjectIsSeenWhereItIsNow) {
  const cv::Rect narrow(140, 70, 14, 60);  // the clouds come by it within the clip
  const DriftingBackground drifting(clipOf(Motion::kDrifts, narrow), 2, cv::Mat());
  ASSERT_TRUE(drifting.established());
  for (const int k : {0, 5, 12}) {
    cv::Mat plate(kHigh, kWide, CV_32FC3, cv::Scalar()),
        invented = cv::Mat::zeros(kHigh, kWide, CV_8U);
    drifting.draw(*drifting.shiftAt(33'000'000LL * k), plate, invented);
    EXPECT_EQ(cv::countNonZero(invented(narrow)), 0) << k;
    double squares = 0.0;
    for (int v = narrow.y; v < narrow.br().y; ++v) {
      for (int u = narrow.x; u < narrow.br().x; ++u) {
        const cv::Vec3b truth = cloudAt(u - kPace.x * k, v - kPace.y * k);
        const double d = codeFromLinear(plate.at<cv::Vec3f>(v, u)[1]) - truth[1];
        squares += d * d / narrow.area();
      }
    }
    EXPECT_LT(std::sqrt(squares), 1.5) << "code values, frame " << k;
  }
}

TEST(DriftingBackground, WhatNoFrameShowsIsInventedOnceAndDriftsAlong) {
  const cv::Rect wide(100, 60, 100, 80);
  const DriftingBackground drifting(clipOf(Motion::kDrifts, wide), 2, cv::Mat());
  ASSERT_TRUE(drifting.established());
  cv::Mat plates[2], invented[2];
  for (int i = 0; i < 2; ++i) {
    plates[i] = cv::Mat::zeros(kHigh, kWide, CV_32FC3),
    invented[i] = cv::Mat::zeros(kHigh, kWide, CV_8U);
    drifting.draw(cv::Point2f(-4.0f * i, 0.0f), plates[i], invented[i]);
  }
  const cv::Rect middle(140, 90, 20, 20), later = middle - cv::Point(4, 0);
  EXPECT_EQ(cv::countNonZero(invented[0](middle)), middle.area());
  EXPECT_LT(cv::norm(plates[0](middle), plates[1](later), cv::NORM_INF), 1e-5);
  EXPECT_GT(cv::mean(plates[0](middle))[2], 0.1) << "clouds, not the object";
}

TEST(DriftingBackground, IsInventedNowhereBesideWhatIsTakenOutOfAFrame) {
  const int margin = 3;
  const cv::Rect wide(100, 60, 100, 80), taken(100 - margin, 60 - margin, 106, 86);
  const std::vector<ClipFrame> frames = clipOf(Motion::kDrifts, wide);
  const DriftingBackground drifting(frames, margin, cv::Mat());
  ASSERT_TRUE(drifting.established());
  for (const int k : {0, 4, 12}) {
    cv::Mat plate(kHigh, kWide, CV_32FC3, cv::Scalar()),
        invented = cv::Mat::zeros(kHigh, kWide, CV_8U);
    drifting.draw(*drifting.shiftAt(frames[k].stamp_ns), plate, invented);
    invented(taken) = 0;
    const cv::Rect around(80, 40, 140, 120);
    EXPECT_EQ(cv::countNonZero(invented(around)), 0) << k;
  }
}

// An object in a cut corner of the window, up to the trim.
TEST(DriftingBackground, TakesNothingOfTheTrimAlong) {
  const cv::Rect corner(180, 80, kWide, kHigh);
  std::vector<ClipFrame> frames;
  for (int k = 0; k < kFrames; ++k) frames.push_back(frameAt(k, Motion::kDrifts, corner, 80));
  const DriftingBackground drifting(frames, 2, cv::Mat());
  ASSERT_TRUE(drifting.established());
  cv::Mat plate(kHigh, kWide, CV_32FC3, cv::Scalar(1, 1, 1)),
      invented = cv::Mat::zeros(kHigh, kWide, CV_8U);
  drifting.draw(*drifting.shiftAt(frames.back().stamp_ns), plate, invented);
  int grey = 0;  // the trim is dark and grey, clouds are coloured
  for (int v = 0; v < kHigh; ++v) {
    for (int u = 0; u < kWide; ++u) {
      const cv::Vec3f& c = plate.at<cv::Vec3f>(v, u);
      grey += frames[0].labels.at<std::uint8_t>(v, u) != 0 && c[0] < linearFromCode(100) &&
              std::abs(c[0] - c[1]) < 0.02f && std::abs(c[0] - c[2]) < 0.02f;
    }
  }
  EXPECT_LT(grey, 50);
}

TEST(DriftingBackground, IsBroughtToWhatAFrameShowsAroundTheObject) {
  const DriftingBackground drifting(clipOf(Motion::kDrifts), 2, cv::Mat());
  ASSERT_TRUE(drifting.established());
  ClipFrame brighter = frameAt(5, Motion::kDrifts, kObject);
  brighter.bgr.convertTo(brighter.bgr, CV_8UC3, 1.03);
  cv::Mat plate(kHigh, kWide, CV_32FC3, cv::Scalar()),
      invented = cv::Mat::zeros(kHigh, kWide, CV_8U);
  drifting.draw(*drifting.shiftAt(brighter.stamp_ns), plate, invented);
  const cv::Scalar before = cv::mean(plate(kObject));
  drifting.matchTo(brighter.bgr, brighter.labels != 0, plate);
  const cv::Scalar after = cv::mean(plate(kObject));
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(after[c] / before[c], std::pow(1.03, 2.2), 0.02) << c;
}

// A ball at rest before clouds, as brightly lit as `gain` says, beside a wall that rests, too.
ClipFrame ballFrame(int k, double gain) {
  ClipFrame f = testing::frameWithBall(testing::ballAt({0.0, 0.0, 0.12}));
  for (int v = 0; v < f.bgr.rows; ++v) {
    for (int u = 0; u < f.bgr.cols; ++u) {
      const bool wall = u < 30 || v >= 100;
      const cv::Vec3b c = wall ? cv::Vec3b::all(static_cast<uchar>(90 + 8 * ((u / 3 + v / 5) % 3)))
                               : cloudAt(u - kPace.x * k, v - kPace.y * k);
      if (f.labels.at<uchar>(v, u) == 0)
        for (int i = 0; i < 3; ++i)
          f.bgr.at<cv::Vec3b>(v, u)[i] = cv::saturate_cast<uchar>(gain * c[i]);
    }
  }
  f.stamp_ns = 33'000'000LL * k;
  return f;
}

TEST(DriftingBackground, FramesBeyondTheClipAreFilledFromThemselves) {
  ClipSample clip;
  for (int k = 0; k < kFrames; ++k) clip.add(ballFrame(k, 1.0));
  RenderParams params;
  params.add_noise = false;
  const auto prepared =
      std::make_shared<const Prepared>(prepare(clip, {testing::ballAt({0.0, 0.0, 0.12})}, params));
  ASSERT_TRUE(prepared->background.drifting.established());
  const ClipFrame later = ballFrame(kFrames - 1, 0.6);  // evening
  FrameInput input;
  input.bgr = later.bgr, input.labels = later.labels, input.camera = later.camera;
  input.stamp_ns = 33'000'000LL * 1000;
  ObjectInFrame ball;
  ball.name = "ball", ball.removed = true;
  input.objects.push_back(ball);
  const FrameOutput out = Renderer(prepared, params).composite(input);
  const cv::Mat hidden = later.labels != 0;
  const cv::Rect clouds_seen(30, 0, 130, 100);
  const double inside = cv::mean(out.bgr, hidden)[1],
               around = cv::mean(later.bgr(clouds_seen), later.labels(clouds_seen) == 0)[1];
  EXPECT_NEAR(inside, around, 0.2 * around);
  EXPECT_EQ(cv::countNonZero((out.provenance != kInvented) & hidden), 0);
}

TEST(DriftingBackground, IsNoneWithoutTimesInOrder) {
  std::vector<ClipFrame> frames = clipOf(Motion::kDrifts), resting = clipOf(Motion::kRests);
  EXPECT_FALSE(DriftingBackground(frames, 2, cv::Mat()).untimed());
  for (ClipFrame& f : frames) f.stamp_ns = 0;
  for (ClipFrame& f : resting) f.stamp_ns = 0;
  const DriftingBackground drifting(frames, 2, cv::Mat());
  EXPECT_FALSE(drifting.established());
  EXPECT_TRUE(drifting.untimed());
  EXPECT_FALSE(DriftingBackground(resting, 2, cv::Mat()).untimed());
}

TEST(DriftingBackground, IsFoundInWidePictures) {
  std::vector<ClipFrame> frames = clipOf(Motion::kDrifts);
  const double larger = 4.3;  // 1376 px: the first guess is made on a coarser grid
  for (ClipFrame& f : frames) {
    cv::resize(f.bgr, f.bgr, {}, larger, larger, cv::INTER_CUBIC);
    cv::resize(f.labels, f.labels, {}, larger, larger, cv::INTER_NEAREST);
  }
  const DriftingBackground drifting(frames, 2, cv::Mat());
  ASSERT_TRUE(drifting.established());
  const auto shift = drifting.shiftAt(frames.back().stamp_ns);
  ASSERT_TRUE(shift);
  EXPECT_NEAR(shift->x, larger * kPace.x * (kFrames - 1), 0.3);
  EXPECT_NEAR(shift->y, larger * kPace.y * (kFrames - 1), 0.3);
}

// Sky over hills, whose pattern is as mild as smooth: where they count the sky seems to rest as well.
TEST(DriftingBackground, IsFollowedWhereMostOfThePictureRests) {
  constexpr int kSkyline = 90;
  constexpr double kMild = 0.4;  // contrast of the sky
  std::vector<ClipFrame> frames = clipOf(Motion::kDrifts, {150, 30, 30, 40});
  cv::Mat hills(kHigh, kWide, CV_32FC3);
  cv::RNG(3).fill(hills, cv::RNG::NORMAL, 0.0, 130.0);
  cv::GaussianBlur(hills, hills, {}, 3.0);
  hills += cv::Scalar(70, 90, 80);
  for (ClipFrame& f : frames) {
    cv::Mat noise(hills.size(), CV_32FC3);
    cv::RNG(f.stamp_ns).fill(noise, cv::RNG::NORMAL, 0.0, 1.5);
    f.bgr.convertTo(f.bgr, CV_8U, kMild, 100.0);
    cv::Mat(hills + noise)
        .rowRange(kSkyline, kHigh)
        .convertTo(f.bgr.rowRange(kSkyline, kHigh), CV_8U);
    f.labels.rowRange(kSkyline, kHigh) = 0;
  }
  const DriftingBackground drifting(frames, 2, cv::Mat());
  ASSERT_TRUE(drifting.established());
  const auto shift = drifting.shiftAt(33'000'000LL * 12);
  ASSERT_TRUE(shift);
  EXPECT_NEAR(shift->x, kPace.x * 12.0f, 0.1);
  EXPECT_NEAR(shift->y, kPace.y * 12.0f, 0.1);
  EXPECT_LT(cv::countNonZero(drifting.where().rowRange(kSkyline + 4, kHigh)), 50) << "hills rest";
}

TEST(DriftingBackground, NothingDriftsWhereThePlaceRestsOrRipples) {
  EXPECT_FALSE(DriftingBackground(clipOf(Motion::kRests), 2, cv::Mat()).established());
  EXPECT_FALSE(DriftingBackground(clipOf(Motion::kRipples), 2, cv::Mat()).established());
  EXPECT_FALSE(
      DriftingBackground({frameAt(0, Motion::kDrifts, kObject)}, 2, cv::Mat()).established());
}

}  // namespace
}  // namespace calipso::render
