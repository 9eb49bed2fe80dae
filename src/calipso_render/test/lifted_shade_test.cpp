#include "place/lifted_shade.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"

namespace calipso::render {
namespace {

constexpr int kMargin = 7;
const cv::Vec3f kUmbra(0.5f, 0.4f, 0.3f);
constexpr float kHides = 0.7f;  // what liftShade() takes an object to hide of the light from above

// A textured plane with a round shadow, in whose middle a contact hides the sky.
class LiftedShade : public ::testing::Test {
 protected:
  void SetUp() override {
    cv::RNG random(1);
    for (int v = 0; v < size_.height; ++v) {
      for (int u = 0; u < size_.width; ++u) {
        const float away = std::hypot(u - 100.0f, v - 80.0f);
        sun_.at<float>(v, u) = std::clamp((away - 40.0f) / 4.0f, 0.0f, 1.0f);
        sky_.at<float>(v, u) = std::clamp(away / 40.0f, 0.0f, 1.0f);
        const float grain = random.uniform(-6.0f, 6.0f), check = (u / 9 + v / 9) % 2 ? 30.0f : 0.0f;
        place_.at<cv::Vec3f>(v, u) = {90.0f + check + grain, 110.0f + check + grain,
                                      130.0f + check + grain};
      }
    }
    cv::GaussianBlur(sky_, sky_, {}, 2.0);
  }

  // The place with what sun and sky leave of its light. @param umbra of the shadow it shows
  cv::Mat shaded(const cv::Vec3f& umbra) const {
    cv::Mat picture(size_, CV_32FC3);
    for (int v = 0; v < size_.height; ++v) {
      for (int u = 0; u < size_.width; ++u) {
        const float under = 1.0f - kHides * (1.0f - sky_.at<float>(v, u));
        for (int c = 0; c < 3; ++c) {
          const float light = umbra[c] * under + (1.0f - umbra[c]) * sun_.at<float>(v, u);
          picture.at<cv::Vec3f>(v, u)[c] =
              codeFromLinear(linearFromRealCode(place_.at<cv::Vec3f>(v, u)[c]) * light);
        }
      }
    }
    return picture;
  }

  cv::Mat lifted(const cv::Mat& picture, cv::Mat& plate) const {
    plate = picture.clone();
    return liftShade({picture, sun_, sky_, sunless_, unclear_, kMargin}, traces_,
                     {0.6f, 0.6f, 0.6f}, plate);
  }

  const cv::Size size_{200, 160};
  cv::Mat sun_{size_, CV_32F}, sky_{size_, CV_32F}, place_{size_, CV_32FC3};
  cv::Mat traces_{size_, CV_8U, cv::Scalar(255)}, unclear_ = cv::Mat::zeros(size_, CV_8U), sunless_;
};

TEST_F(LiftedShade, MostlyShadedIsWhatLeavesTooLittleToCopyFrom) {
  cv::Mat surface(size_, CV_8U, cv::Scalar(1)), traces = cv::Mat::zeros(size_, CV_8U),
                                                covered = traces.clone();
  surface.colRange(100, 200).setTo(2);
  traces.colRange(0, 50).setTo(255);     // half of one,
  traces.colRange(130, 200).setTo(255);  // most of the other,
  const auto where = [&] { return mostlyShaded(surface, 2, traces, covered); };
  EXPECT_EQ(cv::countNonZero(where() != (surface == 2)), 0);
  covered.colRange(60, 100).setTo(255);  // and of what is seen of the first, too
  EXPECT_EQ(cv::countNonZero(where() == 0), 0);
  EXPECT_EQ(cv::countNonZero(mostlyShaded(cv::Mat(), 2, traces, covered)), 0);
}

TEST_F(LiftedShade, MeasuresWhatTheSunLeavesAcrossBorders) {
  const cv::Mat picture = shaded(kUmbra);
  const auto umbra = umbraAtBorders({picture, sun_, sky_, sunless_, unclear_, kMargin},
                                    cv::Vec3f(0.6f, 0.6f, 0.6f));
  ASSERT_TRUE(umbra);
  // The checks' borders are crossed by a part of the pairs; the prediction's error counts outside.
  for (int c = 0; c < 3; ++c) EXPECT_NEAR((*umbra)[c], kUmbra[c], 0.04f);
}

TEST_F(LiftedShade, BringsThePlaceBackInShadeAndBesideIt) {
  cv::Mat plate;
  const cv::Mat where = lifted(shaded(kUmbra), plate);
  EXPECT_NE(where.at<std::uint8_t>(80, 126), 0);  // in the shadow, under most of the sky
  EXPECT_NE(where.at<std::uint8_t>(80, 155), 0);  // in the sun
  // Colours differ by 2.3 code values when light is off by 5 %.
  for (const cv::Point& p : {cv::Point(126, 80), cv::Point(155, 80), cv::Point(100, 106)}) {
    const cv::Vec3f error = plate.at<cv::Vec3f>(p) - place_.at<cv::Vec3f>(p);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(error[c], 0.0f, 5.0f) << p;
  }
}

TEST_F(LiftedShade, HasNoMoreGrainThanWhatLiesInTheLight) {
  cv::RNG random(3);
  cv::Mat noise(size_, CV_32FC3), plate, grain;
  random.fill(place_, cv::RNG::UNIFORM, 110.0, 122.0);
  random.fill(noise, cv::RNG::NORMAL, 0.0, 5.0);
  const cv::Mat where = lifted(shaded(kUmbra) + noise, plate), dark = where & (sun_ == 0.0f),
                lit = where & (sun_ == 1.0f);
  cv::Laplacian(plate, grain, -1);
  const auto strength = [&](const cv::Mat& mask) {
    cv::Scalar mean, deviation;
    cv::Mat inner;
    cv::erode(mask, inner, cv::Mat::ones(3, 3, CV_8U));
    cv::meanStdDev(grain, mean, deviation, inner);
    return cv::norm(deviation);
  };
  // Taken off alone, shade leaves 1.5 times as much.
  EXPECT_NEAR(strength(dark) / strength(lit), 1.0, 0.1);
}

TEST_F(LiftedShade, LeavesBordersContactsAndWhatIsUnclear) {
  unclear_(cv::Rect(150, 0, 50, 160)).setTo(255);
  traces_(cv::Rect(0, 0, 200, 20)).setTo(0);
  const cv::Mat picture = shaded(kUmbra);
  cv::Mat plate;
  const cv::Mat where = lifted(picture, plate);
  EXPECT_EQ(where.at<std::uint8_t>(80, 142), 0);  // the shadow's border
  EXPECT_EQ(where.at<std::uint8_t>(80, 104), 0);  // the contact
  EXPECT_EQ(cv::countNonZero(where & (unclear_ | (traces_ == 0))), 0);
  EXPECT_EQ(cv::norm(plate, picture, cv::NORM_INF, where == 0), 0.0);
}

// In the shade of a wall an object takes no sun from the place.
TEST_F(LiftedShade, LeavesTheShadeOfOtherThings) {
  const cv::Rect wall(0, 0, 90, size_.height);
  sunless_ = cv::Mat::zeros(size_, CV_8U);
  sunless_(wall).setTo(255), sun_(wall).setTo(1.0f);
  cv::Mat picture = shaded(kUmbra), without = picture.clone(), plate;
  for (int v = 0; v < wall.height; ++v) {
    for (int u = 0; u < wall.width; ++u) {
      const float under = 1.0f - kHides * (1.0f - sky_.at<float>(v, u));
      for (int c = 0; c < 3; ++c) {
        const float left = kUmbra[c] * linearFromRealCode(place_.at<cv::Vec3f>(v, u)[c]);
        without.at<cv::Vec3f>(v, u)[c] = codeFromLinear(left);
        picture.at<cv::Vec3f>(v, u)[c] = codeFromLinear(left * under);
      }
    }
  }
  const cv::Mat off = lifted(picture, plate)(wall) & (sky_(wall) < 0.9f);
  ASSERT_GT(cv::countNonZero(off), 500);
  EXPECT_LT(cv::norm(plate(wall), without(wall), cv::NORM_INF, off), 8.0);  // the sky is smoothed
}

TEST_F(LiftedShade, LeavesTheShadowThatIsNotSeen) {
  const cv::Mat picture = shaded({1.0f, 1.0f, 1.0f});
  EXPECT_FALSE(umbraAtBorders({picture, sun_, sky_, sunless_, unclear_, kMargin}, kUmbra));
  cv::Mat plate;
  EXPECT_EQ(cv::countNonZero(lifted(picture, plate) & (sun_ < 0.5f)), 0);
}

TEST_F(LiftedShade, LeavesTheShadowThatIsMostlyNoise) {
  const cv::Mat picture = shaded({0.2f, 0.2f, 0.2f});
  cv::Mat plate;
  EXPECT_EQ(cv::countNonZero(lifted(picture, plate) & (sun_ < 0.5f)), 0);
}

TEST_F(LiftedShade, LeavesTheShadowWhoseBordersDisagree) {
  cv::RNG random(2);
  random.fill(place_, cv::RNG::UNIFORM, 10.0f, 250.0f);
  cv::resize(place_(cv::Rect(0, 0, 25, 20)).clone(), place_, size_, 0, 0, cv::INTER_NEAREST);
  const cv::Mat picture = shaded(kUmbra);
  cv::Mat plate;
  EXPECT_EQ(cv::countNonZero(lifted(picture, plate) & (sun_ < 0.5f)), 0);
}

}  // namespace
}  // namespace calipso::render
