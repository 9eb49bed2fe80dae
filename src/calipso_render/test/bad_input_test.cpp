// Clips that show too little: the best result, and a remark that says what was invented.

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "calipso_render/renderer.hpp"
#include "render_test_scene.hpp"
#include "shadow_check.hpp"

namespace calipso::render {
namespace {

using namespace testing;

const Eigen::Vector3d kCentre(0.0, 0.1, 0.12);

RenderParams params() {
  RenderParams p;
  p.planes = table();
  return p;
}

Prepared learn(const ClipFrame& frame, const ObjectModel& model, int frames = 3) {
  ClipSample clip;
  for (int k = 0; k < frames; ++k) clip.add(frame);
  return prepare(clip, {model}, params());
}

bool says(const Prepared& p, const std::string& what) {
  return std::any_of(p.remarks.begin(), p.remarks.end(), [&](const std::string& r) { return r.find(what) != std::string::npos; });
}

// Moved away, the object must leave a complete picture.
void expectFrame(const Prepared& p, const ClipFrame& key) {
  FrameInput in;
  in.bgr = key.bgr, in.labels = key.labels, in.camera = key.camera;
  ObjectInFrame ball;
  ball.name = "ball", ball.edited = true, ball.vertices = p.surfaces[0].key_vertices;
  for (Eigen::Vector3f& x : ball.vertices) x.x() += 0.1f;
  in.objects = {ball};
  const FrameOutput out = Renderer(std::make_shared<const Prepared>(p), params()).composite(in);
  EXPECT_EQ(out.bgr.size(), key.bgr.size());
  EXPECT_GT(cv::countNonZero(out.provenance), 500);
}

TEST(BadInput, NoFrameWithoutTheObject) {
  const ClipFrame key = frameWithBall(ballAt(kCentre));
  const Prepared p = learn(key, ballAt(kCentre));
  EXPECT_TRUE(says(p, "hides the same place in every frame"));
  expectFrame(p, key);
}

TEST(BadInput, AClipOfOneFrame) {
  const ClipFrame key = frameWithBall(ballAt(kCentre));
  const Prepared p = learn(key, ballAt(kCentre), 1);
  EXPECT_TRUE(says(p, "one frame"));
  expectFrame(p, key);
}

TEST(BadInput, AMaskThatCoversAlmostAll) {
  ClipFrame key = frameWithBall(ballAt(kCentre));
  key.labels.setTo(kBallLabel);
  key.labels(cv::Rect(0, 0, kWidth, 6)).setTo(0);
  const Prepared p = learn(key, ballAt(kCentre));
  EXPECT_TRUE(says(p, "95 % of the key frame"));
  EXPECT_TRUE(says(p, "invented; check the strokes"));
  expectFrame(p, key);
}

TEST(BadInput, SaturatedAndBlackPictures) {
  for (const int code : {255, 0}) {
    ClipFrame key = frameWithBall(ballAt(kCentre));
    key.bgr.setTo(cv::Scalar::all(code));
    const Prepared p = learn(key, ballAt(kCentre));
    EXPECT_TRUE(says(p, code > 0 ? "saturated in 100 %" : "black in 100 %"));
    expectFrame(p, key);
  }
}

TEST(BadInput, AMeshWithoutItsVisibleSide) {
  const ClipFrame key = frameWithBall(ballAt(kCentre));
  ObjectModel model = ballAt(kCentre);
  std::vector<int> kept;  // what looks down
  for (int t = 0; t < model.mesh.triangleCount(); ++t) {
    if (model.mesh.vertex(model.mesh.triangles(t, 0)).z() < -0.05) kept.push_back(t);
  }
  decltype(model.mesh.triangles) triangles(kept.size(), 3);
  for (std::size_t i = 0; i < kept.size(); ++i) triangles.row(i) = model.mesh.triangles.row(kept[i]);
  model.mesh.triangles = triangles;
  const Prepared p = learn(key, model);
  EXPECT_TRUE(says(p, "the side that the camera sees is missing"));
  expectFrame(p, key);
}

TEST(SeenShadows, BelievesWhatIsDarkerThanItsSurroundings) {
  cv::Mat picture(120, 160, CV_32FC3, cv::Scalar::all(150)), predicted = cv::Mat::zeros(picture.size(), CV_8U);
  cv::RNG random(1);
  cv::Mat grain(picture.size(), CV_32FC3);
  random.fill(grain, cv::RNG::NORMAL, 0.0, 12.0);
  picture += grain;
  const cv::Rect real(20, 30, 40, 40), wrong(95, 30, 40, 40);
  picture(real) *= 0.8f;
  predicted(real).setTo(255), predicted(wrong).setTo(255);
  const cv::Mat seen = seenShadows(predicted, picture, cv::Mat::zeros(picture.size(), CV_8U));
  EXPECT_EQ(cv::countNonZero(seen(real)), real.area());
  EXPECT_EQ(cv::countNonZero(seen(wrong)), 0);
  // Beside objects alone nothing can be compared: then it is believed.
  const cv::Mat objects = predicted == 0;
  EXPECT_EQ(cv::countNonZero(seenShadows(predicted, picture, objects)), cv::countNonZero(predicted));
}

}  // namespace
}  // namespace calipso::render
