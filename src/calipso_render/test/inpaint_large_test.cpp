#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "fill/inpaint_at_size.hpp"
#include "grain_pictures.hpp"

namespace calipso::render {
namespace {

using namespace testing;

// A picture whose sides are no multiples of anything, and a hole in it: rows of boards with joints
// as broad as such a picture has them, over grain.
struct Boards {
  cv::Mat image = 0.1 * grain(1283, 721) + cv::Scalar::all(150.0),
          hole = cv::Mat::zeros(721, 1283, CV_8U), truth;

  Boards() {
    for (const int v : {120, 371, 600})
      cv::line(image, {0, v}, {1282, v + 60}, cv::Scalar::all(40.0), 7, cv::LINE_8);
    hole(cv::Rect(500, 300, 241, 203)).setTo(255);
    truth = image.clone();
    image.setTo(cv::Scalar::all(0.0), hole);
  }
};

TEST(InpaintLarge, ConnectsLinesThatAreBroad) {
  Boards b;
  const InpaintResult filled = inpaint(b.image, b.hole, cv::Mat());
  for (int u = 505; u < 740; u += 5) {
    const int v = 371 + cvRound(60.0 * u / 1282.0);
    EXPECT_LT(filled.image.at<cv::Vec3f>(v, u)[1], 90.0f) << u;  // half way to the boards
  }
}

// Every pixel of the hole has a sample of the large picture, with its grain, not an enlarged one.
TEST(InpaintLarge, KeepsTheGrain) {
  Boards b;
  const InpaintResult filled = inpaint(b.image, b.hole, cv::Mat());
  cv::Mat difference;
  cv::absdiff(filled.image, b.image, difference);
  EXPECT_EQ(cv::norm(difference, cv::NORM_INF, cv::Mat(b.hole == 0)), 0.0);
  const cv::Rect plain(520, 440, 200, 50);  // between joints
  const auto deviation = [&](const cv::Mat& image) {
    cv::Scalar mean, deviations;
    cv::meanStdDev(image(plain), mean, deviations);
    return deviations[1];
  };
  EXPECT_NEAR(deviation(filled.image), deviation(b.truth), 0.15 * deviation(b.truth));
  for (int v = 0; v < b.hole.rows; ++v) {
    for (int u = 0; u < b.hole.cols; ++u) {
      const cv::Vec2s from = filled.origin.at<cv::Vec2s>(v, u);
      if (b.hole.at<std::uint8_t>(v, u) == 0) {
        ASSERT_EQ(from, cv::Vec2s(-1, -1));
      } else if (from[0] >= 0) {
        ASSERT_EQ(b.hole.at<std::uint8_t>(from[1], from[0]), 0);
      }
    }
  }
}

// However far pictures of 640 px drift, what they show stays as broad as it is.
TEST(InpaintLarge, APanoramaOfSmallPicturesIsNotReduced) {
  Boards b;
  const InpaintResult own = inpaintAtSize(b.image, b.hole, cv::Mat(), {});
  const auto differs = [&](const InpaintResult& filled) {
    return cv::norm(filled.image, own.image, cv::NORM_INF) > 0.0;
  };
  EXPECT_FALSE(differs(inpaintAsIn({640, 360}, b.image, b.hole, cv::Mat())));
  EXPECT_TRUE(differs(inpaint(b.image, b.hole, cv::Mat())));
}

// What is known of the place goes along: planes, surfaces, what must not be copied.
TEST(InpaintLarge, CopiesFromTheSameSurfaceAndNoBannedPlace) {
  Boards b;
  cv::Mat banned = cv::Mat::zeros(b.hole.size(), CV_8U);
  banned(cv::Rect(0, 0, 500, 721)).setTo(255);
  InpaintParams params;
  params.surface = cv::Mat(b.hole.size(), CV_8U, cv::Scalar(1));
  params.surface.rowRange(400, 721).setTo(2);
  const InpaintResult filled = inpaint(b.image, b.hole, banned, params);
  int copies = 0, across = 0;
  for (int v = 300; v < 503; ++v) {
    for (int u = 500; u < 741; ++u) {
      const cv::Vec2s from = filled.origin.at<cv::Vec2s>(v, u);
      if (from[0] < 0) continue;
      ++copies;
      ASSERT_GE(from[0], 500);
      across += (from[1] < 400) != (v < 400);
    }
  }
  EXPECT_GT(copies, 45000);  // of 48923
  EXPECT_LT(across, 500);    // along the border, half way between the pixels of the smaller picture
}

}  // namespace
}  // namespace calipso::render
