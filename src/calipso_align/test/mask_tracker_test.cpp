#include "calipso_align/mask_tracker.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <string>

#include "../src/layer_search.hpp"
#include "synthetic_picture.hpp"

namespace calipso::align {
namespace {

using testing::disc;
using testing::intersectionOverUnion;
using testing::maskOf;

const cv::Size kSize(200, 150);

// A disc with stripes, so that the flow sees it move, on a background with a gradient.
cv::Mat picture(double u0, double v0, int seed, const cv::Size& size = kSize, double noise = 2.0) {
  cv::Mat image(size, CV_8UC3);
  cv::RNG rng(seed);
  for (int v = 0; v < size.height; ++v)
    for (int u = 0; u < size.width; ++u) {
      const double alpha = std::clamp(0.5 - disc(u0, v0, 25)(u, v), 0.0, 1.0);
      const double stripe = 30.0 * std::sin(0.5 * (u - u0) + 0.3 * (v - v0));
      const cv::Vec3d fore(50, 90 + stripe, 190), back(150 + 0.2 * u, 150 + 0.2 * v, 140);
      for (int c = 0; c < 3; ++c)
        image.at<cv::Vec3b>(v, u)[c] = cv::saturate_cast<uchar>(
            alpha * fore[c] + (1.0 - alpha) * back[c] + rng.gaussian(noise));
    }
  return image;
}

cv::Mat truth(double u0, double v0) { return maskOf(kSize, disc(u0, v0, 25)); }

// The same twice as large, so that its noise is, too.
const cv::Size kUsual(640, 480);
cv::Mat largePicture(double u0, double v0, int seed) {
  cv::Mat large;
  cv::resize(picture(u0, v0, seed, kUsual, 3.0), large, kUsual * 2, 0, 0, cv::INTER_CUBIC);
  return large;
}

cv::Mat largeTruth(double u0, double v0) {
  return maskOf(kUsual * 2, disc(2 * u0 + 0.5, 2 * v0 + 0.5, 50));
}

TEST(MaskTracker, FollowsATranslation) {
  MaskTracker tracker(picture(60, 60, 1), truth(60, 60) / 255);
  for (int k = 1; k <= 12; ++k) {
    const double u = 60 + 4.3 * k, v = 60 + 1.7 * k;
    const TrackedMask tracked = tracker.track(picture(u, v, k + 1));
    EXPECT_GE(intersectionOverUnion(tracked.labels == 1, truth(u, v)), 0.97) << "frame " << k;
    EXPECT_GE(tracked.confidence, 0.6f);
  }
}

TEST(MaskTracker, FollowsAJump) {
  MaskTracker tracker(picture(60, 60, 1), truth(60, 60) / 255);
  const TrackedMask tracked = tracker.track(picture(110, 90, 2));
  EXPECT_GE(intersectionOverUnion(tracked.labels == 1, truth(110, 90)), 0.95);
}

TEST(MaskTracker, AStillObjectKeepsItsMaskExactly) {
  const cv::Mat labels = truth(60, 60) / 255;
  MaskTracker tracker(picture(60, 60, 1), labels);
  for (int k = 2; k < 6; ++k) {
    const TrackedMask tracked = tracker.track(picture(60, 60, k));  // other noise, same scene
    EXPECT_EQ(cv::countNonZero(tracked.labels != labels), 0);
    EXPECT_EQ(tracked.confidence, 1.0f);
  }
}

// What goes 80 px in a frame goes 160 px if the picture is twice as large.
TEST(CoarseShift, FindsAJumpInALargePicture) {
  const TrackerParams params = forPicture(kUsual * 2, {});
  const auto means = [&](double u0, double v0, int seed) {
    return blockMeans(largePicture(u0, v0, seed), params.block_px);
  };
  const cv::Mat before = means(100, 100, 1);
  const cv::Point shift = coarseShift(largeTruth(100, 100), means(180, 140, 2), before,
                                      cv::Mat(before.size(), CV_8U, cv::Scalar(255)), params);
  EXPECT_NEAR(shift.x, 160, params.block_px);
  EXPECT_NEAR(shift.y, 80, params.block_px);
}

TEST(MaskTracker, AStillObjectKeepsItsMaskInALargePicture) {
  const cv::Mat labels = largeTruth(100, 100) / 255;
  MaskTracker tracker(largePicture(100, 100, 1), labels);
  for (int k = 2; k < 5; ++k) {
    const TrackedMask tracked = tracker.track(largePicture(100, 100, k));
    EXPECT_EQ(cv::countNonZero(tracked.labels != labels), 0);
    EXPECT_EQ(tracked.confidence, 1.0f);
  }
}

TEST(MaskTracker, OwnsUpWhenTheObjectIsGone) {
  MaskTracker tracker(picture(60, 60, 1), truth(60, 60) / 255);
  EXPECT_LT(tracker.track(picture(-100, -100, 2)).confidence, 0.5f);
}

TEST(MaskTracker, TakesUpAnObjectThatComesBack) {
  const auto height = [](int k) { return 60.0 - 20.0 * k + 1.0 * k * k; };  // above the picture
  MaskTracker tracker(picture(60, height(0), 1), truth(60, height(0)) / 255);
  TrackedMask tracked;
  bool was_gone = false;
  for (int k = 1; k <= 20; ++k) {
    tracked = tracker.track(picture(60 + 4 * k, height(k), k + 1));
    was_gone = was_gone || cv::countNonZero(tracked.labels) == 0;
  }
  EXPECT_TRUE(was_gone);
  EXPECT_GE(intersectionOverUnion(tracked.labels == 1, truth(140, height(20))), 0.95);
}

// Strip by strip, each of which is too little to tell it by.
TEST(MaskTracker, TakesUpAnObjectThatComesBackSlowly) {
  const auto height = [](int k) { return k < 6 ? 60.0 - 20.0 * k : -40.0 + 1.5 * (k - 5); };
  MaskTracker tracker(picture(60, height(0), 1), truth(60, height(0)) / 255);
  TrackedMask tracked;
  bool was_gone = false;
  for (int k = 1; k <= 60; ++k) {
    tracked = tracker.track(picture(60, height(k), k + 1));
    was_gone = was_gone || cv::countNonZero(tracked.labels) == 0;
  }
  EXPECT_TRUE(was_gone);
  EXPECT_GE(intersectionOverUnion(tracked.labels == 1, truth(60, height(60))), 0.95);
}

// A moving object of the wall's own colour: only where it was seen before tells it from the wall.
TEST(MaskTracker, ARememberedBackgroundIsNotTakenIn) {
  const auto withTwin = [](double u0, int seed) {
    cv::Mat image = picture(u0, 60, seed);
    image(cv::Rect(120, 40, 60, 40)).setTo(cv::Scalar(50, 90, 190));  // stands still
    return image;
  };
  MaskTracker tracker(withTwin(60, 1), truth(60, 60) / 255);
  TrackedMask tracked;
  for (int k = 1; k <= 10; ++k) tracked = tracker.track(withTwin(60 + 3.4 * k, k + 1));
  const cv::Mat found = tracked.labels == 1;
  EXPECT_GE(intersectionOverUnion(found, truth(94, 60)), 0.95);
}

// What light does to the background next to an object is no part of it.
TEST(MaskTracker, AShadowThatComesAlongIsLeftOut) {
  const auto withShadow = [](double u0, int seed) {
    cv::Mat image = picture(u0, 60, seed);
    const cv::Mat object = maskOf(kSize, disc(u0, 60, 26.5)),
                  shade = maskOf(kSize, disc(u0 + 20, 80, 25)) & ~object;
    cv::Mat darker;
    image.convertTo(darker, -1, 0.6);
    darker.copyTo(image, shade);
    return image;
  };
  MaskTracker tracker(withShadow(60, 1), truth(60, 60) / 255);
  TrackedMask tracked;
  for (int k = 1; k <= 10; ++k) tracked = tracker.track(withShadow(60 + 3.0 * k, k + 1));
  EXPECT_GE(intersectionOverUnion(tracked.labels == 1, truth(90, 60)), 0.95);
}

// A ball that rolls: its surface flows at up to twice the outline's speed, and turns new colours to
// the camera.
TEST(MaskTracker, FollowsABallThatRolls) {
  const double radius = 25.0;
  const auto rolling = [&](double u0, int seed) {
    cv::Mat image = picture(-100, -100, seed);
    cv::Mat darker;
    image.convertTo(darker, -1, 0.55);
    darker.copyTo(image, maskOf(kSize, disc(u0 + 14, 80, 25)));
    for (int v = 0; v < kSize.height; ++v)
      for (int u = 0; u < kSize.width; ++u) {
        const double x = (u - u0) / radius, y = (v - 60.0) / radius;
        if (x * x + y * y > 1.0) continue;
        const double turned = std::atan2(x, std::sqrt(1.0 - x * x - y * y)) - u0 / radius;
        image.at<cv::Vec3b>(v, u) =
            std::sin(3.0 * turned) > 0.0 ? cv::Vec3b(60, 50, 170) : cv::Vec3b(205, 215, 220);
      }
    return image;
  };
  MaskTracker tracker(rolling(40, 1), truth(40, 60) / 255);
  for (int k = 1; k <= 9; ++k) {
    const double u = 40 + 12.0 * k;
    const TrackedMask tracked = tracker.track(rolling(u, k + 1));
    // What the ball hid in the key frame nobody has seen: the first strip it leaves is told by
    // colour alone.
    EXPECT_GE(intersectionOverUnion(tracked.labels == 1, truth(u, 60)), k == 1 ? 0.85 : 0.95)
        << "frame " << k;
  }
}

// A bar that lands on its end: from one frame to the next it shows a third of its area, and what
// looks most like it before is a bar that lies about.
TEST(MaskTracker, FollowsABarThatTurnsItsEnd) {
  const auto bar = [](double u0, double v0, double half) {
    return [=](double u, double v) {
      return testing::box(u0 - half, v0 - 9, u0 + half, v0 + 9)(u, v);
    };
  };
  const auto frame = [&](double u0, double v0, double half, int seed) {
    cv::Mat image = picture(-100, -100, seed);
    for (const cv::Mat& mask : {maskOf(kSize, bar(150, 40, 27)), maskOf(kSize, bar(u0, v0, half))})
      image.setTo(cv::Scalar(50, 90, 190), mask);
    return image;
  };
  MaskTracker tracker(frame(50, 60, 27, 1), maskOf(kSize, bar(50, 60, 27)) / 255);
  for (int k = 1; k <= 4; ++k) tracker.track(frame(50 + 6 * k, 60 + 6 * k, 27, k + 1));
  const TrackedMask tracked = tracker.track(frame(70, 108, 9, 6));
  EXPECT_GE(intersectionOverUnion(tracked.labels == 1, maskOf(kSize, bar(70, 108, 9))), 0.9);
}

// A dark thing passes behind a box with a dark window: what one of them was expected to be is not
// the other's.
TEST(MaskTracker, ObjectsOfOneColourKeepToTheirOwn) {
  const cv::Rect body(80, 60, 50, 50), window(90, 66, 30, 20);
  cv::Mat box = cv::Mat::zeros(kSize, CV_8U);
  box(body).setTo(255);
  const auto behind = [&](double u0) { return cv::Mat(maskOf(kSize, disc(u0, 60, 18)) & ~box); };
  const auto frame = [&](double u0, int seed) {
    cv::Mat image = picture(-100, -100, seed);
    image.setTo(cv::Scalar(40, 38, 36), behind(u0));
    image(body).setTo(cv::Scalar(50, 90, 190));
    image(window).setTo(cv::Scalar(42, 38, 36));
    return image;
  };
  MaskTracker tracker(frame(55, 1), (box & 1) | (behind(55) & 2));
  for (int k = 1; k <= 15; ++k) {
    const double u = 55 + 5.0 * k;
    const TrackedMask tracked = tracker.track(frame(u, k + 1));
    EXPECT_GE(intersectionOverUnion(tracked.labels == 1, box), 0.97) << "frame " << k;
    EXPECT_GE(intersectionOverUnion(tracked.labels == 2, behind(u)), 0.9) << "frame " << k;
  }
}

// A side that comes into view in a jump is the object's, although nothing moved there.
TEST(MaskTracker, TakesInASideThatComesIntoView) {
  const auto box = [](int width, int seed) {
    cv::Mat image = picture(-100, -100, seed);
    for (int u = 40; u < 40 + width; ++u)
      image(cv::Rect(u, 40, 1, 60))
          .setTo(u / 6 % 2 ? cv::Scalar(60, 50, 170) : cv::Scalar(50, 90, 190));
    return image;
  };
  const auto boxMask = [](int width) {
    cv::Mat mask = cv::Mat::zeros(kSize, CV_8U);
    mask(cv::Rect(40, 40, width, 60)).setTo(255);
    return mask;
  };
  MaskTracker tracker(box(40, 1), boxMask(40) / 255);
  for (int k = 1; k <= 4; ++k) {
    const int width = 40 + 15 * k;
    const TrackedMask tracked = tracker.track(box(width, k + 1));
    EXPECT_GE(intersectionOverUnion(tracked.labels == 1, boxMask(width)), 0.96) << "frame " << k;
  }
}

TEST(MaskTracker, NamesWrongSizes) {
  MaskTracker tracker(picture(60, 60, 1), truth(60, 60) / 255);
  try {
    tracker.track(cv::Mat::zeros(10, 20, CV_8UC3));
    FAIL() << "nothing was thrown";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("20x10"), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("200x150"), std::string::npos) << error.what();
  }
  EXPECT_THROW(MaskTracker(picture(60, 60, 1), cv::Mat::zeros(10, 20, CV_8U)),
               std::invalid_argument);
}

}  // namespace
}  // namespace calipso::align
