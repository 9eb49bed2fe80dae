#include "texture/hidden_front.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "grain_pictures.hpp"

namespace calipso::render {
namespace {

using namespace testing;

// A front of two sides, the left one striped and the right one bland, another object (2) before it.
struct Front {
  static constexpr int kWidth = 160, kHeight = 100, kEdge = 80, kPeriod = 10;

  cv::Mat labels{kHeight, kWidth, CV_8U, cv::Scalar(1)};
  Surface surface;
  const std::vector<int> pieces = {0, 1};
  Reflectance seen;

  Front() {
    surface.index = 1;
    surface.triangles = {{0, 1, 2}, {0, 1, 2}};
    surface.key_vertices.resize(3);
    seen.region = {0, 0, kWidth, kHeight};
    seen.mean_light = {1, 1, 1};
    seen.nearness = cv::Mat(kHeight, kWidth, CV_32F, cv::Scalar(1.0f));
    seen.trust = seen.nearness.clone(), seen.clear = seen.nearness.clone();
    seen.triangle = cv::Mat(kHeight, kWidth, CV_32S, cv::Scalar(0));
    seen.triangle.colRange(kEdge, kWidth).setTo(1);
    cv::cvtColor(0.0002 * grain(kWidth, kHeight), seen.albedo, cv::COLOR_BGR2BGRA);
    seen.albedo += cv::Scalar::all(0.2);
    for (int u = 0; u < kEdge; u += kPeriod)
      seen.albedo.colRange(u, u + kPeriod / 2) += cv::Scalar::all(0.3);
  }
  void hide(const cv::Rect& there) {
    labels(there).setTo(2), seen.trust(there).setTo(0.0f);
    seen.albedo(there).setTo(cv::Scalar(0.0, 0.0, 0.9, 0.0));
  }
  std::optional<Reflectance> filled() const { return hiddenFront(labels, surface, pieces, seen); }
};

TEST(HiddenFront, GoesOnAsItIsSeenBesideWhatHidesIt) {
  Front front;
  const cv::Mat truth = front.seen.albedo.clone();
  const cv::Rect hidden(50, 40, 50, 20);
  front.hide(hidden);
  const auto filled = front.filled();
  ASSERT_TRUE(filled);
  int alike = 0;
  for (int v = hidden.y; v < hidden.br().y; ++v) {
    for (int u = hidden.x; u < hidden.br().x; ++u) {
      EXPECT_GT(filled->trust.at<float>(v, u), 0.0f);
      const cv::Vec4f& c = filled->albedo.at<cv::Vec4f>(v, u);
      EXPECT_LT(c[2], 0.6f) << u << " " << v;  // nothing of the one before it
      alike += std::abs(c[1] - truth.at<cv::Vec4f>(v, u)[1]) < 0.1f;
    }
  }
  EXPECT_GT(alike, 0.9 * hidden.area());
  EXPECT_EQ(cv::norm(filled->albedo(cv::Rect(0, 0, 40, 30)), truth(cv::Rect(0, 0, 40, 30))), 0.0);
  EXPECT_EQ(filled->trust.at<float>(10, 10), 0.0f);
}

TEST(HiddenFront, IsLeftWhereLittleIsHiddenOrSeen) {
  Front whole, rail, covered;
  EXPECT_FALSE(whole.filled());
  rail.hide({0, 50, Front::kWidth, 4});
  EXPECT_FALSE(rail.filled());
  covered.hide({0, 0, Front::kWidth, 80});
  EXPECT_FALSE(covered.filled());
}

}  // namespace
}  // namespace calipso::render
