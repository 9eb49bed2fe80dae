// What objects mirror of a place that pictures show.

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "ball_samples.hpp"
#include "calipso_render/colour.hpp"
#include "calipso_render/light_fit.hpp"
#include "render_test_scene.hpp"

namespace calipso::render {
namespace {

using namespace testing;

// A glossy ball before a place that the picture shows, its sun told by a shadow.
TEST(FitLight, LetsRimsMirrorWhatIsSeenBehindThem) {
  const Eigen::Vector3f sun = Eigen::Vector3f(0.5f, -0.5f, 0.7f).normalized(), up(0, 0, 1),
                        view(0, -1, 0);
  LightEvidence evidence = glossyBallWithShadow(sun);
  evidence.behind = {0.06f, 0.1f, 0.14f};
  const LightFit fit = fitLight(evidence, up, view);
  ASSERT_TRUE(fit.from_shadows);
  ASSERT_GT(fit.gloss.around, 0.0f);
  const cv::Vec3f mirrored = fit.gloss.around * ambientAt(asMirrored(fit.light), -view),
                  towards_camera = ambientAt(asMirrored(fit.light), view);
  // A dielectric's part of it; what is behind the camera is as before.
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(mirrored[c], 0.04f * evidence.behind[c], 1e-5f);
    EXPECT_NEAR(towards_camera[c], ambientAt(fit.light, view)[c], 1e-5f);
  }
}

// A red wall behind the ball, and green farther from it than 40 px.
TEST(LightEvidence, TellsWhatIsSeenBesideTheObjects) {
  const ObjectModel model = ballAt({0.0, 0.1, 0.12});
  const ClipFrame key = frameWithBall(model);
  cv::Mat beside;
  cv::dilate(key.labels != 0, beside, cv::Mat::ones(81, 81, CV_8U));
  cv::Mat picture(key.labels.size(), CV_32FC3, cv::Scalar(0, 200, 0));
  picture.setTo(cv::Scalar(0, 0, 100), beside);
  picture.setTo(cv::Scalar(250, 0, 0), key.labels != 0);
  const Surface surface = makeSurface(model);
  View view;
  view.picture = picture, view.labels = key.labels, view.camera = key.camera;
  view.actors = {makeActor(surface, surface.key_vertices, key.camera)};
  const LightEvidence evidence = lightEvidence({view}, {false}, {}, Background(), cv::Mat());
  EXPECT_NEAR(evidence.behind[0], 0.0f, 1e-6f);
  EXPECT_NEAR(evidence.behind[1], 0.0f, 1e-6f);
  EXPECT_NEAR(evidence.behind[2], linearFromRealCode(100.0f), 1e-5f);
}

}  // namespace
}  // namespace calipso::render
