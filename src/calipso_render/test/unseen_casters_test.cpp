#include "place/unseen_casters.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "calipso_render/unseen_shade.hpp"
#include "grain_pictures.hpp"
#include "test_room.hpp"

namespace calipso::render {
namespace {

using testing::grain;

// A wall and a floor below it, the left third of both in the shade of something that is not seen. A
// shadow that passed over the wall's upper half told where it has the sun, but for noise.
class UnseenCasters : public ::testing::Test {
 protected:
  static constexpr int kEdge = 80, kFloor = 120;

  UnseenCasters()
      : plate(0.2 * grain(240, 180) + cv::Scalar::all(150.0)),
        surface(180, 240, CV_8U, cv::Scalar(1)),
        told(180, 240, CV_8U, cv::Scalar(kSunUntold)) {
    plate.colRange(0, kEdge) *= 0.5;
    surface.rowRange(kFloor, 180) = 2;
    told(cv::Rect(0, 0, 240, kFloor / 2)) = kSun, told(cv::Rect(0, 0, kEdge, kFloor / 2)) = kNoSun;
    cv::Mat wrong = grain(240, 180);
    cv::extractChannel(wrong, wrong, 0);
    told.setTo(kSun, (told == kNoSun) & (wrong > 180.0));
  }

  int hiddenAt(int u, int v) const {
    return unseenCastersShade(told, plate, surface).hidden.at<std::uint8_t>(v, u);
  }

  cv::Mat plate, surface, told;
};

TEST_F(UnseenCasters, ShadeWhereAPassingShadowDarkensNothingAndWhatIsAsDark) {
  EXPECT_EQ(hiddenAt(40, 30), 255);
  EXPECT_EQ(hiddenAt(40, 100), 255);  // no shadow passed there
  EXPECT_EQ(hiddenAt(160, 30), 0);
  EXPECT_EQ(hiddenAt(160, 100), 0);
  EXPECT_EQ(hiddenAt(40, 160), 0);  // of the floor nothing is known
}

// The wall tells how dark its shade is.
TEST_F(UnseenCasters, ShadeAnotherSurfaceOfWhichTheLitPartIsToldAlone) {
  told(cv::Rect(140, kFloor + 10, 90, 40)) = kSun;
  EXPECT_EQ(hiddenAt(40, 160), 255);
  EXPECT_EQ(hiddenAt(120, 160), 0);
  // what is as dark as that, but of another hue, is no shade
  cv::Mat floor = plate.rowRange(kFloor, 180).colRange(0, kEdge);
  cv::multiply(floor, cv::Scalar(1.5, 1.0, 0.7), floor);
  EXPECT_EQ(hiddenAt(40, 160), 0);
}

// Light that grows over 20 px.
TEST_F(UnseenCasters, ShadeSoftlyAsTheBrightnessHasIt) {
  for (int u = 0; u < 240; ++u) {
    const double lit = std::clamp((u - kEdge + 10) / 20.0, 0.0, 1.0),
                 code = std::pow((0.22 + 0.78 * lit), 1.0 / 2.2);
    plate.col(u) *= u < kEdge ? 2.0 * code : code;
  }
  EXPECT_NEAR(hiddenAt(kEdge, 100), 128, 25);
  EXPECT_NEAR(hiddenAt(kEdge - 6, 100), 204, 30);
  EXPECT_NEAR(hiddenAt(kEdge + 6, 100), 51, 30);
  EXPECT_GT(hiddenAt(kEdge - 20, 100), 245);
  EXPECT_LT(hiddenAt(kEdge + 20, 100), 10);
}

// Light that grows over 50 px, more than a smaller picture's borders of shade have.
TEST_F(UnseenCasters, ShadeLargePicturesAsSoftly) {
  constexpr int kTimes = 5, kLargeEdge = kTimes * kEdge;
  const cv::Size large = plate.size() * kTimes;
  plate = 0.2 * grain(large.width, large.height) + cv::Scalar::all(150.0);
  cv::resize(surface, surface, large, 0.0, 0.0, cv::INTER_NEAREST);
  cv::resize(told, told, large, 0.0, 0.0, cv::INTER_NEAREST);
  for (int u = 0; u < large.width; ++u) {
    const double lit = std::clamp((u - kLargeEdge + 25) / 50.0, 0.0, 1.0);
    plate.col(u) *= std::pow(0.22 + 0.78 * lit, 1.0 / 2.2);
  }
  EXPECT_NEAR(hiddenAt(kLargeEdge, 500), 128, 25);
  EXPECT_NEAR(hiddenAt(kLargeEdge - 19, 500), 225, 20);
  EXPECT_NEAR(hiddenAt(kLargeEdge + 19, 500), 30, 20);
  EXPECT_GT(hiddenAt(kLargeEdge - 50, 500), 245);
}

TEST_F(UnseenCasters, AreNotSoughtByBrightnessThatDoesNotTell) {
  plate.colRange(0, kEdge) *= 2.0;
  EXPECT_EQ(hiddenAt(40, 30), 255);
  EXPECT_EQ(hiddenAt(40, 100), 0);
}

// No shade shows on what is clipped: none is drawn there, but that tells nothing of the sun.
TEST_F(UnseenCasters, AreNotKnownWhereThePictureIsClipped) {
  EXPECT_EQ(unseenCastersShade(told, plate, surface).known.at<std::uint8_t>(100, 40), 255);
  plate.colRange(0, kEdge).setTo(255.0);
  const CastersShade shade = unseenCastersShade(told, plate, surface);
  EXPECT_EQ(shade.hidden.at<std::uint8_t>(30, 40), 255);
  EXPECT_EQ(cv::countNonZero(shade.known), 0);
}

// Nor where no surface has both, and brightness does not bear out what passing shade told.
TEST_F(UnseenCasters, AreNotKnownBesideSurfacesThatHaveBoth) {
  const CastersShade shade = unseenCastersShade(told, plate, {});
  EXPECT_EQ(shade.hidden.at<std::uint8_t>(30, 40), 255);
  EXPECT_EQ(cv::countNonZero(shade.known), 0);
}

TEST_F(UnseenCasters, AreNoneWhereAllShadowsDarken) {
  told.setTo(kSun, told == kNoSun);
  EXPECT_TRUE(unseenCastersShade(told, plate, surface).hidden.empty());
}

// The wall's left half lies in a shade that is known there alone. What the sun shines past on its way
// to that has none, either.
TEST(HiddenOnRelief, IsHiddenFromThePlaceBehindItAlongTheSun) {
  const Relief wall = findRelief(testing::Room().surfaces(), testing::kSun);
  const cv::Mat none = cv::Mat::zeros(testing::kHigh, testing::kWide, CV_8U);
  CastersShade shade{none.clone(), wall.seen.clone()};
  shade.hidden.colRange(0, testing::kWide / 2).setTo(255);
  const UnseenShade unseen(
      shade.hidden, shade.known,
      [&](int u, int v) {
        return wall.at(u, v) ? std::optional(wall.receiver(u, v)) : std::nullopt;
      },
      testing::kSun);
  Relief before = wall;  // nearer to the sun
  before.position = wall.position + cv::Scalar(0.5 * testing::kSun.x(), 0.5 * testing::kSun.y(),
                                               0.5 * testing::kSun.z());
  shade.known.rowRange(0, 30).setTo(0);
  const cv::Mat hidden = hiddenOnRelief({none, shade.known}, unseen, before);
  EXPECT_GT(hidden.at<std::uint8_t>(15, 30), 250);
  EXPECT_EQ(hidden.at<std::uint8_t>(15, 130), 0);
  EXPECT_EQ(hidden.at<std::uint8_t>(40, 30), 0);  // brightness tells
  EXPECT_EQ(cv::countNonZero(hidden & ~wall.seen), 0);
}

// With a quarter left in the shade and half the sun hidden, 0.625 are seen: 0.4 of it are 0.25.
TEST(LowestSun, LeavesWhatTheFullShadeWould) {
  const cv::Mat hidden = (cv::Mat_<std::uint8_t>(1, 3) << 0, 128, 255);
  const cv::Mat sun = lowestSun(hidden, cv::Mat(1, 3, CV_8U, cv::Scalar(64)));
  EXPECT_EQ(sun.at<std::uint8_t>(0), 0);
  EXPECT_NEAR(0.25 + 0.75 * sun.at<std::uint8_t>(1) / 255.0, 0.4, 0.005);
  EXPECT_EQ(sun.at<std::uint8_t>(2), 255);
  const cv::Mat black = cv::Mat::zeros(1, 3, CV_8U);
  EXPECT_EQ(lowestSun(hidden, black).at<std::uint8_t>(2), 255);
}

}  // namespace
}  // namespace calipso::render
