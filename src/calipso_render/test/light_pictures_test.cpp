#include "light/light_pictures.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "ball_setting.hpp"

namespace calipso::render {
namespace {

using namespace testing;

cv::Mat repeated(const cv::Mat& picture, int times) {
  cv::Mat out;
  cv::resize(picture, out, {}, times, times, cv::INTER_NEAREST);
  return out;
}

// The ball's frame with every pixel repeated in a square.
ClipFrame repeated(ClipFrame frame, int times) {
  Camera& c = frame.camera;
  c.width *= times, c.height *= times, c.fx *= times, c.fy *= times;
  c.cx = times * c.cx + 0.5 * (times - 1), c.cy = times * c.cy + 0.5 * (times - 1);
  frame.bgr = repeated(frame.bgr, times), frame.labels = repeated(frame.labels, times);
  return frame;
}

LightPictures picturesOf(const ClipFrame& frame, const Surface& ball) {
  cv::Mat depth(frame.bgr.size(), CV_32F, cv::Scalar(2.0));
  depth.setTo(1.0f, frame.labels != 0);
  cv::Mat picture;
  frame.bgr.convertTo(picture, CV_32F);
  Background plate;
  plate.plate = picture, plate.count = frame.labels + 3;
  plate.spread = depth.clone();
  return {
      {{picture, frame.labels, frame.camera, {makeActor(ball, ball.key_vertices, frame.camera)}}},
      plate,
      depth,
      0.3f};
}

TEST(LightPictures, ThatAreLargeAreTheSameBroughtDown) {
  const Surface ball = makeSurface(ballAt(kCentre));
  const LightPictures wanted = picturesOf(repeated(frameWithBall(ballAt(kCentre)), 4), ball),
                      got = atWorkingSize(
                          picturesOf(repeated(frameWithBall(ballAt(kCentre)), 8), ball));
  const View &small = got.views[0], &as = wanted.views[0];
  EXPECT_EQ(cv::norm(small.picture, as.picture, cv::NORM_INF), 0.0);
  EXPECT_EQ(cv::norm(small.labels, as.labels, cv::NORM_INF), 0.0);
  EXPECT_EQ(cv::norm(got.depth, wanted.depth, cv::NORM_INF), 0.0);
  EXPECT_EQ(cv::norm(got.plate.plate, wanted.plate.plate, cv::NORM_INF), 0.0);
  EXPECT_EQ(cv::norm(got.plate.count, wanted.plate.count, cv::NORM_INF), 0.0);
  EXPECT_EQ(cv::norm(got.plate.spread, wanted.plate.spread, cv::NORM_INF), 0.0);
  EXPECT_EQ(small.camera.width, as.camera.width);
  for (std::size_t i = 0; i < as.actors[0].screen.points.size(); ++i)
    ASSERT_LT((small.actors[0].screen.points[i] - as.actors[0].screen.points[i]).norm(), 1e-3f);
  EXPECT_EQ(small.actors[0].screen.hidden_side, as.actors[0].screen.hidden_side);
}

TEST(LightPictures, ThatAreSmallStayAsTheyAre) {
  const Surface ball = makeSurface(ballAt(kCentre));
  const LightPictures given = picturesOf(repeated(frameWithBall(ballAt(kCentre)), 4), ball);
  const LightPictures same = atWorkingSize(given);
  EXPECT_EQ(same.views[0].picture.data, given.views[0].picture.data);
  EXPECT_EQ(same.blur, given.blur);
}

// Rims and what a highlight is mixed with are as broad as pixels are wide.
TEST(LightPictures, LargeOnesTellTheLightThatSmallOnesTell) {
  const auto lightIn = [](int times) {
    ClipSample clip;
    clip.add(repeated(frameWithBall(ballAt(kCentre)), times));
    return prepare(clip, {ballAt(kCentre)}, params()).light;
  };
  const LightFit small = lightIn(4), large = lightIn(8);
  EXPECT_LT((large.light.direction - small.light.direction).norm(), 1e-4f);
  EXPECT_LT(cv::norm(large.light.sun - small.light.sun), 1e-3);
  EXPECT_NEAR(large.gloss.roughness, small.gloss.roughness, 1e-3f);
}

}  // namespace
}  // namespace calipso::render
