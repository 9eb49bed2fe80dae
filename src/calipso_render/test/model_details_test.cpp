#include "model_details.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "ball_setting.hpp"

namespace calipso::render::testing {
namespace {

const cv::Scalar kGreen(30, 140, 30);

// A ball with a rail beside it that its model lacks.
struct RailSetting {
  ClipFrame key = frameWithBall(ballAt(kCentre));
  cv::Mat depth = cv::Mat::zeros(kHeight, kWidth, CV_32F);
  cv::Rect rail;  // beside the ball

  RailSetting() {
    const Surface surface = makeSurface(ballAt(kCentre));
    const Actor actor = makeActor(surface, surface.key_vertices, key.camera);
    const float z = depthOf(kCentre.cast<float>());
    forEachPixelOf(actor, [&](int u, int v, const SurfacePoint& p) {
      depth.at<float>(v, u) = depthOf(p.position);
    });
    const cv::Rect box = cv::boundingRect(key.labels);
    rail = {box.br().x, box.y + box.height / 2 - 1, 18, 3};
    key.labels(rail).setTo(kBallLabel), key.bgr(rail).setTo(kGreen);
    depth(rail).setTo(z);
  }
  float depthOf(const Eigen::Vector3f& p) const {
    return static_cast<float>((key.camera.world_from_camera.inverse() * p.cast<double>()).z());
  }
  std::shared_ptr<const Prepared> prepared(const cv::Mat& with_depth) const {
    RenderParams p = params();
    p.depth = with_depth;
    ClipSample clip;
    clip.add(key);
    return std::make_shared<const Prepared>(prepare(clip, {ballAt(kCentre)}, p));
  }
  // The ball moved 30 cm to the left, as a simulator has it: without the rail.
  FrameInput movedLeft(const Prepared& p) const {
    FrameInput in = ballMovedLeft(key, p);
    in.objects[0].vertices.resize(makeSurface(ballAt(kCentre)).key_vertices.size());
    return in;
  }
};

int greenPixels(const cv::Mat& bgr) {
  cv::Mat green;
  cv::inRange(bgr, kGreen - cv::Scalar::all(25), kGreen + cv::Scalar::all(25), green);
  return cv::countNonZero(green);
}

TEST(ModelDetails, WhatTheModelLacksGoesAlong) {
  const RailSetting s;
  const auto prepared = s.prepared(s.depth);
  EXPECT_GT(prepared->surfaces[0].detailVertices(), 0u);
  const FrameOutput out = Renderer(prepared, params()).composite(s.movedLeft(*prepared));
  EXPECT_EQ(greenPixels(out.bgr(s.rail)), 0);
  // where the same point of the rail is now
  const double z = s.depthOf(kCentre.cast<float>());
  const int left = cvRound(0.3 * s.key.camera.fx / z);
  const cv::Rect now = s.rail - cv::Point(left, 0);
  EXPECT_GT(greenPixels(out.bgr(now)), s.rail.width);  // its rim is mixed with the table
}

// Guy lines, twigs: parts of them can be single pixels.
TEST(ModelDetails, HairsOfAnyShapeAreTaken) {
  cv::RNG random(3);
  for (int seed = 0; seed < 40; ++seed) {
    RailSetting s;
    const cv::Rect box = cv::boundingRect(s.key.labels);
    const float z = s.depthOf(kCentre.cast<float>());
    for (int hair = 0; hair < 4; ++hair) {
      cv::Point p(box.x + box.width / 2, box.y - 1);
      for (int k = 0; k < 60; ++k) {
        p += cv::Point(random.uniform(-1, 2), random.uniform(-1, 2));
        p.x = std::clamp(p.x, 1, kWidth - 2), p.y = std::clamp(p.y, 1, kHeight - 2);
        s.key.labels.at<std::uint8_t>(p) = kBallLabel, s.depth.at<float>(p) = z;
      }
    }
    ASSERT_NO_THROW(s.prepared(s.depth)) << seed;
  }
}

// Specks of a mask are no details, nor do single pixels that are left of one do harm.
TEST(ModelDetails, SpecksAreLeftOut) {
  RailSetting s;
  s.key.labels(s.rail).setTo(0);
  s.key.labels(cv::Rect(s.rail.br() - cv::Point(2, 1), cv::Size(2, 1))).setTo(kBallLabel);
  EXPECT_EQ(s.prepared(s.depth)->surfaces[0].detailVertices(), 0u);
  s.key.labels(cv::Rect(s.rail.br() - cv::Point(9, 1), cv::Size(9, 1))).setTo(kBallLabel);
  EXPECT_GT(s.prepared(s.depth)->surfaces[0].detailVertices(), 0u);
}

TEST(ModelDetails, NothingIsAddedWithoutADepthImage) {
  const RailSetting s;
  const auto prepared = s.prepared({});
  EXPECT_EQ(prepared->surfaces[0].detailVertices(), 0u);
}

TEST(ModelDetails, WhatIsAsFarAsThePlaceIsNoDetail) {
  RailSetting s;
  for (int v = s.rail.y; v < s.rail.br().y; ++v) {
    for (int u = s.rail.x; u < s.rail.br().x; ++u)
      s.depth.at<float>(v, u) = s.depthOf(receiverAt(table(), s.key.camera, u, v)->position);
  }
  const auto prepared = s.prepared(s.depth);
  EXPECT_EQ(prepared->surfaces[0].detailVertices(), 0u);
}

// A detail is found where the camera sees it: the model is as symmetric as it was without.
TEST(ModelDetails, TheModelStaysSymmetric) {
  RailSetting s;
  const cv::Rect flag(s.rail.tl(), cv::Size(40, 30));
  s.key.labels(flag).setTo(kBallLabel), s.key.bgr(flag).setTo(kGreen);
  s.depth(flag).setTo(s.depthOf(kCentre.cast<float>()));
  const auto with = s.prepared(s.depth), without = s.prepared({});
  ASSERT_GT(with->surfaces[0].detailVertices(), 0u);
  EXPECT_EQ(withoutDetails(with->surfaces[0], with->surfaces[0].key_vertices),
            without->surfaces[0].key_vertices);
  EXPECT_EQ(modelTriangles(with->surfaces[0]), without->surfaces[0].triangles);
  const float copied = without->appearances[0].copied * without->appearances[0].texture.size(),
              still = with->appearances[0].copied * with->appearances[0].texture.size();
  EXPECT_GT(copied, 100.0f);
  EXPECT_NEAR(still, copied, 0.1f * copied);
}

// Where a detail is, the model does not look as its mirror image does, not even at its flat rim.
TEST(ModelDetails, NothingIsCopiedBesideThem) {
  constexpr int kNear = 3;  // px
  RailSetting s;
  const cv::Rect flag(s.rail.x, s.rail.y - 15, 40, 30);
  const cv::Rect beside(flag.x - kNear, flag.y, kNear, flag.height);
  s.key.bgr(beside).setTo(cv::Scalar(200, 30, 20), s.key.labels(beside) == kBallLabel);
  s.key.labels(flag).setTo(kBallLabel), s.key.bgr(flag).setTo(kGreen);
  s.depth(flag).setTo(s.depthOf(kCentre.cast<float>()));
  const auto prepared = s.prepared(s.depth);
  const Surface& surface = prepared->surfaces[0];
  const SurfaceTexture& texture = prepared->appearances[0].texture;
  const Eigen::Vector3f eye = s.key.camera.world_from_camera.translation().cast<float>();
  int blue = 0, all = 0;
  for (int t = 0; t < texture.triangleCount(); ++t) {
    if (isDetail(surface, t)) continue;
    for (std::size_t i = texture.firstOf(t); i < texture.firstOf(t + 1); ++i) {
      const Eigen::Vector3f w = texture.weightsOf(t, i - texture.firstOf(t));
      Eigen::Vector3f at = Eigen::Vector3f::Zero();
      for (int k = 0; k < 3; ++k) at += w[k] * surface.key_vertices[surface.triangles[t][k]];
      const Eigen::Vector2d pixel = s.key.camera.projectWorld(at.cast<double>());
      const Eigen::Vector3f normal = at - kCentre.cast<float>();
      if (normal.dot(eye - at) < 0.0f || pixel.x() < flag.x - 1.5 ||
          std::abs(pixel.y() - s.rail.y) > 10.0)
        continue;
      const cv::Vec4f& c = texture.texels[i];
      ++all, blue += c[0] > 2.0f * c[2];
    }
  }
  EXPECT_GT(all, 20);
  EXPECT_GT(blue, 0.3 * all) << "the rest is seen too flatly";
}

TEST(ModelDetails, TheyTurnWithTheModel) {
  const RailSetting s;
  const auto prepared = s.prepared(s.depth);
  const Surface& surface = prepared->surfaces[0];
  const std::size_t of_model = surface.key_vertices.size() - surface.detailVertices();
  Eigen::Isometry3d turn(Eigen::AngleAxisd(1.1, Eigen::Vector3d(1, 2, 3).normalized()));
  turn.translation() = Eigen::Vector3d(0.2, -0.1, 0.4);
  const Points all = transformed(surface.key_vertices, turn);
  const Points hung = withDetails(surface, Points(all.begin(), all.begin() + of_model));
  ASSERT_EQ(hung.size(), all.size());
  for (std::size_t i = 0; i < all.size(); ++i) EXPECT_LT((hung[i] - all[i]).norm(), 1e-4f) << i;
}

}  // namespace
}  // namespace calipso::render::testing
