#include "calipso_render/background.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/clip_sample.hpp"
#include "calipso_render/inpaint.hpp"
#include "calipso_render/renderer.hpp"
#include "render_test_scene.hpp"

namespace calipso::render {
namespace {

using namespace testing;

// The empty table with a square that wanders to the right by 12 px per frame.
std::vector<ClipFrame> wanderingSquare(int frames) {
  std::vector<ClipFrame> clip;
  for (int k = 0; k < frames; ++k) {
    ClipFrame f{emptyTable(), cv::Mat::zeros(kHeight, kWidth, CV_8U), camera()};
    const cv::Rect square(10 + 12 * k, 40, 16, 16);
    f.bgr(square).setTo(cv::Scalar(0, 0, 255));
    f.labels(square).setTo(kBallLabel);
    clip.push_back(f);
  }
  return clip;
}

TEST(SeenBackground, IsExactWhereAnyFrameShowsIt) {
  const Background b = seenBackground(wanderingSquare(8), false);
  EXPECT_EQ(cv::countNonZero(b.invented), 0);
  cv::Mat plate;
  b.plate.convertTo(plate, CV_8U);
  EXPECT_EQ(cv::norm(plate, emptyTable(), cv::NORM_INF), 0.0);
}

// Shade that creeps over a cloth stays within the noise for a while.
TEST(SteadyKeyFrame, AveragesWhatRestsAlone) {
  std::vector<ClipFrame> clip;
  for (int k = 0; k < 12; ++k) {
    clip.push_back({cv::Mat(20, 40, CV_8UC3, cv::Scalar::all(100 + k)),
                    cv::Mat(20, 40, CV_8U, cv::Scalar(kBallLabel)), camera()});
  }
  cv::Mat moving = cv::Mat::zeros(20, 40, CV_8U), steadiness;
  moving.colRange(20, 40).setTo(255);
  const cv::Mat steady = steadyKeyFrame(clip, moving, steadiness);
  EXPECT_EQ(steady.at<cv::Vec3f>(10, 10), cv::Vec3f(105.5f, 105.5f, 105.5f));
  EXPECT_EQ(steadiness.at<std::uint8_t>(10, 10), 12);
  EXPECT_EQ(steady.at<cv::Vec3f>(10, 30), cv::Vec3f(100.0f, 100.0f, 100.0f));
  EXPECT_EQ(steadiness.at<std::uint8_t>(10, 30), 1);
}

TEST(SeenBackground, CountsTheFramesThatShowAPixel) {
  const Background b = seenBackground(wanderingSquare(8), false);
  EXPECT_EQ(b.count.at<std::uint8_t>(5, 5), 8);
  EXPECT_EQ(b.count.at<std::uint8_t>(48, 18), 7);  // only the first frame's square is there
}

TEST(SeenBackground, LeavesOutPassingShadows) {
  std::vector<ClipFrame> clip = wanderingSquare(9);
  for (int k = 0; k < 4; ++k) clip[k].bgr(cv::Rect(60, 80, 20, 20)) *= 0.6;
  const Background b = seenBackground(clip, true);
  cv::Mat plate;
  b.plate.convertTo(plate, CV_8U);
  EXPECT_EQ(cv::norm(plate, emptyTable(), cv::NORM_INF), 0.0);
}

// A mask that misses a piece of what rests does not show the place there.
TEST(SeenBackground, ShowsNothingOfWhatRestsWhereALaterMaskMissesIt) {
  const ObjectModel ball = ballAt({0.0, -0.3, 0.28});
  ClipFrame frame = frameWithBall(ball);
  const cv::Rect box = cv::boundingRect(frame.labels);
  const cv::Rect bite(box.x + box.width / 2 - 8, box.y + box.height / 2 - 8, 16, 16);
  ClipSample clip;
  clip.add(frame);
  for (int k = 1; k < 6; ++k) {
    frame.labels = frame.labels.clone();
    frame.labels(bite).setTo(0);
    clip.add(frame);
  }
  RenderParams params;
  params.planes = table();
  const Prepared prepared = prepare(clip, {ball}, params);
  EXPECT_EQ(cv::countNonZero(prepared.background.count(bite) & prepared.key_labels(bite)), 0);
}

// Noise of one code value, the same in every run.
void addGrain(std::vector<ClipFrame>& clip) {
  cv::RNG random(7);
  for (ClipFrame& f : clip) {
    cv::Mat grain(f.bgr.size(), CV_16SC3), sum;
    random.fill(grain, cv::RNG::NORMAL, 0.0, 1.0);
    cv::add(f.bgr, grain, sum, cv::noArray(), CV_8U);
    f.bgr = sum;
  }
}

TEST(SeenBackground, LeavesOutAShadowThatComesToRest) {
  std::vector<ClipFrame> clip = wanderingSquare(12);
  const cv::Rect place(60, 80, 20, 20);
  for (int k = 3; k < 12; ++k)
    cv::multiply(clip[k].bgr(place), cv::Scalar(0.77, 0.73, 0.68), clip[k].bgr(place));
  addGrain(clip);
  const Background b = seenBackground(clip, true);
  cv::Mat plate;
  b.plate.convertTo(plate, CV_8U);
  EXPECT_LE(cv::norm(plate(place), emptyTable()(place), cv::NORM_INF), 5.0);
}

TEST(SeenBackground, SinglePixelsOfSuchAShadowGoWithThoseAroundThem) {
  std::vector<ClipFrame> clip = wanderingSquare(12);
  const cv::Rect place(60, 80, 20, 20), few(68, 88, 2, 1);
  for (int k = 3; k < 12; ++k)
    cv::multiply(clip[k].bgr(place), cv::Scalar(0.77, 0.73, 0.68), clip[k].bgr(place));
  cv::multiply(clip[0].bgr(few), cv::Scalar(0.77, 0.73, 0.68),
               clip[0].bgr(few));  // lit in two frames only: too few to tell by themselves
  const Background b = seenBackground(clip, true);
  cv::Mat plate;
  b.plate.convertTo(plate, CV_8U);
  EXPECT_LE(cv::norm(plate(few), emptyTable()(few), cv::NORM_INF), 2.0);
}

TEST(SeenBackground, BrightStrangersInFewFramesAreNoLight) {
  // Brighter in one channel alone: no shadow's colours, so what most frames show is the place.
  std::vector<ClipFrame> clip = wanderingSquare(12);
  const cv::Rect place(60, 80, 20, 20);
  for (int k = 0; k < 3; ++k) clip[k].bgr(place) += cv::Scalar(70, 0, 0);
  const Background b = seenBackground(clip, true);
  cv::Mat plate;
  b.plate.convertTo(plate, CV_8U);
  EXPECT_EQ(cv::norm(plate(place), emptyTable()(place), cv::NORM_INF), 0.0);
}

TEST(InventBackground, FillsOnlyTheHole) {
  Background b = seenBackground(wanderingSquare(1), false);
  const cv::Mat before = b.plate.clone(), hole = b.invented.clone();
  ASSERT_GT(cv::countNonZero(hole), 0);
  inventBackground(cv::Mat(), wanderingSquare(1).front(), {}, {}, b);
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      if (hole.at<std::uint8_t>(v, u) == 0) {
        ASSERT_EQ(b.plate.at<cv::Vec3f>(v, u), before.at<cv::Vec3f>(v, u));
      } else {
        // The square was pure red; the table has a third channel below the first never.
        ASSERT_GT(b.plate.at<cv::Vec3f>(v, u)[1], 20.0f);
      }
    }
  }
}

// Water below row 38. What passes has a red rim that its mask misses, and at the key frame it
// touches what is hidden all the time; the margin covers the rim.
TEST(InventBackground, CopiesNoRimThatTheMarginCovers) {
  const cv::Rect hidden(80, 40, 20, 40);
  constexpr int kRim = 14, kShore = 38;
  std::vector<ClipFrame> clip;
  for (int k = 0; k < 8; ++k) {
    ClipFrame f{cv::Mat(kHeight, kWidth, CV_8UC3), cv::Mat::zeros(kHeight, kWidth, CV_8U),
                camera()};
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u)
        f.bgr.at<cv::Vec3b>(v, u) = cv::Vec3b::all(cv::saturate_cast<std::uint8_t>(
            120.0 + 30.0 * std::sin(0.3 * u + (v < kShore ? 0.0 : 1.9 * k) + 0.5 * v)));
    }
    const cv::Rect passing(k == 0 ? 31 : 120, 40, 20, 40);
    f.bgr(passing + cv::Size(kRim, 0)).setTo(cv::Scalar(0, 0, 255));
    f.labels(passing).setTo(kBallLabel);
    f.labels(hidden).setTo(kBallLabel + 1);
    clip.push_back(f);
  }
  addGrain(clip);
  BackgroundParams params;
  params.mask_margin_px = kRim + 1;
  Background b = seenBackground(clip, false, params);
  inventBackground(cv::Mat(), clip.front(), {}, params, b);
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      const cv::Vec3f c = b.plate.at<cv::Vec3f>(v, u);
      ASSERT_LT(c[2] - c[0], 60.0f) << u << ", " << v;
    }
  }
}

// Water below row 60 waves, and what is above rests; an object hides some of both all the time.
TEST(InventBackground, WhatIsHiddenRestsWhereTheRowsAroundRest) {
  std::vector<ClipFrame> clip;
  const cv::Rect object(70, 30, 30, 60);
  for (int k = 0; k < 8; ++k) {
    ClipFrame f{cv::Mat(kHeight, kWidth, CV_8UC3), cv::Mat::zeros(kHeight, kWidth, CV_8U),
                camera()};
    for (int v = 0; v < kHeight; ++v) {
      for (int u = 0; u < kWidth; ++u) {
        const double wave =
            v < 60 ? std::sin(0.7 * u + 0.4 * v) : std::sin(0.3 * u + 1.9 * k + 0.5 * v);
        f.bgr.at<cv::Vec3b>(v, u) =
            cv::Vec3b::all(cv::saturate_cast<std::uint8_t>(120.0 + 30.0 * wave));
      }
    }
    f.bgr(object).setTo(cv::Scalar(0, 0, 255));
    f.labels(object).setTo(kBallLabel);
    clip.push_back(f);
  }
  addGrain(clip);
  Background b = seenBackground(clip, false);
  inventBackground(cv::Mat(), clip.front(), {}, {}, b);
  ASSERT_FALSE(b.live.empty());
  const auto live = [&](int u, int v) {
    cv::Vec3f colour;
    return b.live.at(clip[1].bgr, clip[1].labels, b.live.corrections(clip[1].bgr, clip[1].labels),
                     1.0f, u, v, colour);
  };
  int above = 0, below = 0;
  for (int u = object.x; u < object.br().x; ++u) above += live(u, 45), below += live(u, 75);
  EXPECT_EQ(above, 0);
  EXPECT_GT(below, object.width * 8 / 10);
}

// A carpet of dark saturated stitches below a plain wall: grain and coding make it change by more
// than the wall does, yet it rests.
TEST(InventBackground, NoisyTextureDoesNotMove) {
  constexpr int kPlain = kHeight / 3;  // rows of wall
  cv::Mat place(kHeight, kWidth, CV_8UC3, cv::Scalar::all(140));
  for (int v = kPlain; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u)
      place.at<cv::Vec3b>(v, u) =
          (u / 3 + v / 2) % 2 == 0 ? cv::Vec3b(30, 40, 190) : cv::Vec3b(120, 70, 40);
  }
  const cv::Rect object(70, 50, 30, 40);
  std::vector<ClipFrame> clip;
  cv::RNG random(3);
  for (int k = 0; k < 8; ++k) {
    clip.push_back({place.clone(), cv::Mat::zeros(kHeight, kWidth, CV_8U), camera()});
    clip.back().labels(object).setTo(kBallLabel);
    cv::Mat grain(place.size(), CV_16SC3);
    random.fill(grain, cv::RNG::NORMAL, 0.0, 4.0);
    grain.rowRange(0, kPlain) /= 4;  // what is dark is noisier in code values
    cv::add(clip.back().bgr, grain, clip.back().bgr, cv::noArray(), CV_8U);
  }
  Background b = seenBackground(clip, false);
  inventBackground(cv::Mat(), clip.front(), {}, {}, b);
  EXPECT_TRUE(b.live.empty());
}

TEST(Inpaint, ContinuesStripes) {
  // Vertical stripes with a period of 8 px leave one way to fill the hole.
  cv::Mat image(96, 96, CV_32FC3), hole = cv::Mat::zeros(96, 96, CV_8U);
  for (int v = 0; v < 96; ++v) {
    for (int u = 0; u < 96; ++u)
      image.at<cv::Vec3f>(v, u) = cv::Vec3f::all(u % 8 < 4 ? 60.0f : 180.0f);
  }
  const cv::Mat truth = image.clone();
  const cv::Rect square(40, 40, 14, 14);
  hole(square).setTo(255);
  image(square).setTo(cv::Scalar::all(0));
  const InpaintResult r = inpaint(image, hole, cv::Mat());
  EXPECT_TRUE(r.patches_found);
  int wrong = 0;
  for (int v = square.y; v < square.br().y; ++v) {
    for (int u = square.x; u < square.br().x; ++u)
      wrong += std::abs(r.image.at<cv::Vec3f>(v, u)[0] - truth.at<cv::Vec3f>(v, u)[0]) > 1.0f;
  }
  EXPECT_LE(wrong, square.area() / 20);
}

TEST(ClipSample, KeepsTheKeyFrameAndItsBound) {
  ClipSample sample(4);
  for (int k = 0; k < 100; ++k) {
    sample.add({cv::Mat(2, 2, CV_8UC3, cv::Scalar::all(k)), cv::Mat::zeros(2, 2, CV_8U), Camera()});
    ASSERT_LE(sample.frames().size(), 4u);
  }
  EXPECT_EQ(sample.seen(), 100u);
  EXPECT_EQ(sample.frames().front().bgr.at<cv::Vec3b>(0, 0)[0], 0);
  EXPECT_GE(sample.frames().back().bgr.at<cv::Vec3b>(0, 0)[0], 64);  // reaches into the last half
}

TEST(ClipSample, RefusesAnotherSize) {
  ClipSample sample;
  sample.add({cv::Mat(4, 4, CV_8UC3), cv::Mat(4, 4, CV_8U), Camera()});
  EXPECT_THROW(sample.add({cv::Mat(4, 5, CV_8UC3), cv::Mat(4, 5, CV_8U), Camera()}),
               std::invalid_argument);
  EXPECT_THROW(sample.add({cv::Mat(4, 4, CV_8UC3), cv::Mat(3, 4, CV_8U), Camera()}),
               std::invalid_argument);
}

TEST(GroundNearness, IsThePlanesBelowTheHorizonAndWhatLiesBeyond) {
  // 2 m above the ground, looking level: a pixel that looks down by (v - cy) / fy sees it at 2 fy /
  // (v - cy).
  Camera camera;
  camera.width = 40, camera.height = 30, camera.fx = camera.fy = 50.0, camera.cx = 19.5,
  camera.cy = 10.0;
  camera.world_from_camera.linear() << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  camera.world_from_camera.translation() = Eigen::Vector3d(0, 0, 2);
  cv::Mat scenery = cv::Mat::zeros(30, 40, CV_32F);
  scenery.at<float>(20, 5) = 0.02f, scenery.at<float>(20, 6) = 0.5f;
  const cv::Mat nearness = groundNearness({SupportPlane()}, camera, scenery);
  EXPECT_EQ(nearness.at<float>(4, 8), 0.0f);
  EXPECT_NEAR(nearness.at<float>(20, 8), 0.1f, 1e-6f);
  EXPECT_NEAR(nearness.at<float>(20, 5), 0.02f, 1e-6f);  // the plane has ended before
  EXPECT_NEAR(nearness.at<float>(20, 6), 0.1f, 1e-6f);   // something stands on it
  EXPECT_TRUE(groundNearness({}, camera, scenery).empty());
}

}  // namespace
}  // namespace calipso::render
