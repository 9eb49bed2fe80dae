// Clips that show too little: the best result, and a remark that says what was invented.

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "calipso_render/renderer.hpp"
#include "render_test_scene.hpp"

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
  return std::any_of(p.remarks.begin(), p.remarks.end(),
                     [&](const std::string& r) { return r.find(what) != std::string::npos; });
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

// A flash would be the place in a brighter light.
TEST(BadInput, SomeWhiteFrames) {
  const ClipFrame key = frameWithBall(ballAt(kCentre));
  ClipSample clip;
  for (int k = 0; k < 12; ++k) {
    ClipFrame frame = k == 0 ? key : frameWithBall(ballAt(kCentre + Eigen::Vector3d(0.3, 0, 0)));
    if (k % 3 == 2) frame.bgr.setTo(cv::Scalar::all(255));
    clip.add(frame);
  }
  const Prepared p = prepare(clip, {ballAt(kCentre)}, params());
  EXPECT_TRUE(says(p, "4 of 12 frames are mostly white or black"));
  for (const cv::Point at : {cv::Point(20, 100), cv::Point(80, 55)})  // beside the ball, behind it
    EXPECT_NEAR(p.background.plate.at<cv::Vec3f>(at)[1], tableColour(at.x, at.y)[1], 2.0f);
  expectFrame(p, key);
  for (const int code : {255, 0}) {  // nothing is drawn into such a frame
    FrameInput in;
    in.bgr = cv::Mat(kHeight, kWidth, CV_8UC3, cv::Scalar::all(code));
    in.labels = key.labels, in.camera = key.camera;
    ObjectInFrame ball;
    ball.name = "ball", ball.removed = true, ball.vertices = p.surfaces[0].key_vertices;
    in.objects = {ball};
    const FrameOutput out = Renderer(std::make_shared<const Prepared>(p), params()).composite(in);
    EXPECT_EQ(cv::norm(out.bgr, in.bgr, cv::NORM_INF), 0.0);
    EXPECT_EQ(cv::countNonZero(out.provenance), 0);
  }
}

TEST(BadInput, AMeshWithHoles) {
  const ClipFrame key = frameWithBall(ballAt(kCentre));
  EXPECT_FALSE(says(learn(key, ballAt(kCentre)), "is open"));
  ObjectModel model = ballAt(kCentre);
  int kept = 0;
  for (int t = 0; t < model.mesh.triangleCount(); ++t) {
    if (t % 3 != 0) model.mesh.triangles.row(kept++) = model.mesh.triangles.row(t).eval();
  }
  model.mesh.triangles.conservativeResize(kept, 3);
  const Prepared p = learn(key, model);
  EXPECT_TRUE(says(p, "its model is open"));
  expectFrame(p, key);
}

TEST(BadInput, AMeshWithoutItsVisibleSide) {
  const ClipFrame key = frameWithBall(ballAt(kCentre));
  ObjectModel model = ballAt(kCentre);
  std::vector<int> kept;  // what looks down
  for (int t = 0; t < model.mesh.triangleCount(); ++t) {
    if (model.mesh.vertex(model.mesh.triangles(t, 0)).z() < -0.05) kept.push_back(t);
  }
  decltype(model.mesh.triangles) triangles(kept.size(), 3);
  for (std::size_t i = 0; i < kept.size(); ++i)
    triangles.row(i) = model.mesh.triangles.row(kept[i]);
  model.mesh.triangles = triangles;
  const Prepared p = learn(key, model);
  EXPECT_TRUE(says(p, "the side that the camera sees is missing"));
  expectFrame(p, key);
}

}  // namespace
}  // namespace calipso::render
