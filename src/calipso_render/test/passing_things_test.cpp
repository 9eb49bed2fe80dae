#include "calipso_render/passing_things.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <opencv2/imgproc.hpp>

#include "ball_setting.hpp"
#include "calipso_render/renderer.hpp"
#include "render_test_scene.hpp"

namespace calipso::render {
namespace {

constexpr int kColumns = 96, kRows = 64;
constexpr int kBall = 18;  // px

// Waves, over which in frame k a ball passes.
cv::Rect ballIn(int k) { return {8 * k - 20, 20, kBall, kBall}; }

ClipFrame wavesIn(int k, bool with_ball) {
  ClipFrame f{cv::Mat(kRows, kColumns, CV_8UC3), cv::Mat::zeros(kRows, kColumns, CV_8U), Camera()};
  for (int v = 0; v < kRows; ++v) {
    for (int u = 0; u < kColumns; ++u)
      f.bgr.at<cv::Vec3b>(v, u) = cv::Vec3b::all(
          cv::saturate_cast<std::uint8_t>(120.0 + 40.0 * std::sin(0.9 * u + 0.6 * v + 1.9 * k)));
  }
  const cv::Rect ball = ballIn(k) & cv::Rect({0, 0}, f.bgr.size());
  if (with_ball) f.bgr(ball).setTo(cv::Scalar(30, 40, 220));
  return f;
}

PassingThings learnt(int frames) {
  std::vector<ClipFrame> clip;
  for (int k = 0; k < frames; ++k) clip.push_back(wavesIn(k, true));
  return {clip, 3};
}

TEST(PassingThings, AreToldFromWaves) {
  const PassingThings passing = learnt(16);
  for (int k = 4; k < 10; ++k) {
    const ClipFrame f = wavesIn(k, true);
    const cv::Mat covered = passing.addedTo(f.labels, f.bgr);
    const cv::Rect ball = ballIn(k), inside(ball.x + 3, ball.y + 3, kBall - 6, kBall - 6);
    EXPECT_EQ(cv::countNonZero(covered(inside)), inside.area()) << k;
    cv::Mat elsewhere = covered.clone();
    elsewhere(cv::Rect(ball.x - 12, ball.y - 12, kBall + 24, kBall + 24) &
              cv::Rect({0, 0}, covered.size()))
        .setTo(0);
    EXPECT_EQ(cv::countNonZero(elsewhere), 0) << k;
  }
}

TEST(PassingThings, WavesAloneAreNone) {
  const PassingThings passing = learnt(16);
  for (int k = 16; k < 24; ++k) {
    const ClipFrame f = wavesIn(k, false);
    EXPECT_EQ(cv::countNonZero(passing.addedTo(f.labels, f.bgr)), 0) << k;
  }
}

TEST(PassingThings, ObjectsStayWhatTheyAre) {
  ClipFrame f = wavesIn(6, true);
  f.labels(ballIn(6)).setTo(3);
  const cv::Mat covered = learnt(16).addedTo(f.labels, f.bgr);
  EXPECT_EQ(cv::countNonZero(covered == 3), kBall * kBall);
}

// A ball at rest among waves, between which something red goes by behind it.
ClipFrame wavesAroundBall(int k, const ObjectModel& model) {
  ClipFrame f = testing::frameWithBall(model);
  const cv::Rect hidden = cv::boundingRect(f.labels != 0);
  for (int v = hidden.y - 10; v < hidden.br().y + 10; ++v) {
    for (int u = 0; u < f.bgr.cols; ++u)
      if (f.labels.at<std::uint8_t>(v, u) == 0)
        f.bgr.at<cv::Vec3b>(v, u) = cv::Vec3b::all(
            cv::saturate_cast<std::uint8_t>(120.0 + 40.0 * std::sin(0.9 * u + 0.6 * v + 1.9 * k)));
  }
  const cv::Rect red =
      cv::Rect(10 * k - 10, hidden.y, 20, hidden.height) & cv::Rect({0, 0}, f.bgr.size());
  f.bgr(red).setTo(cv::Scalar(30, 40, 220), f.labels(red) == 0);
  return f;
}

TEST(PassingThings, AreNotCopiedToWhatIsHidden) {
  const ObjectModel model = testing::ballAt({0, 0, testing::kBallRadius});
  ClipSample clip;
  for (int k = 0; k < 16; ++k) clip.add(wavesAroundBall(k, model));
  RenderParams params = testing::params();
  params.add_noise = false;
  const auto prepared = std::make_shared<Prepared>(prepare(clip, {model}, params));
  ASSERT_FALSE(prepared->background.live.empty());
  Renderer renderer(prepared, params);
  for (int k = 2; k < 16; ++k) {
    const ClipFrame f = wavesAroundBall(k, model);
    ObjectInFrame gone;
    gone.name = prepared->surfaces[0].name, gone.vertices = prepared->surfaces[0].key_vertices;
    gone.removed = true;
    const cv::Mat emptied =
        renderer.composite({f.bgr, f.labels, f.camera, 1000 * k, {gone}, {}}).bgr;
    int red = 0;
    for (int v = 0; v < emptied.rows; ++v) {
      for (int u = 0; u < emptied.cols; ++u) {
        const cv::Vec3b c = emptied.at<cv::Vec3b>(v, u);
        red += f.labels.at<std::uint8_t>(v, u) != 0 && c[2] > c[0] + 40;
      }
    }
    EXPECT_EQ(red, 0) << k;
  }
}

TEST(PassingThings, FewFramesTellNothing) {
  const ClipFrame f = wavesIn(6, true);
  EXPECT_EQ(cv::countNonZero(learnt(4).addedTo(f.labels, f.bgr)), 0);
}

}  // namespace
}  // namespace calipso::render
