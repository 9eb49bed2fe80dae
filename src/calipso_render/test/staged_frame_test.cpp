#include "frame/staged_frame.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

#include "ball_setting.hpp"

namespace calipso::render {
namespace {

using namespace testing;

// As files have it whose triangles have vertices of their own. @param doubled triangle that it has
// twice; < 0: none
ObjectModel inPieces(const ObjectModel& whole, int doubled) {
  ObjectModel apart = whole;
  const int own = whole.mesh.triangleCount(), count = doubled < 0 ? own : own + 1;
  apart.mesh.vertices.resize(3 * count, 3), apart.mesh.triangles.resize(count, 3);
  for (int t = 0; t < count; ++t) {
    for (int k = 0; k < 3; ++k) {
      const int vertex = whole.mesh.triangles(t < own ? t : doubled, k);
      apart.mesh.vertices.row(3 * t + k) = whole.mesh.vertex(vertex).transpose();
      apart.mesh.triangles(t, k) = 3 * t + k;
    }
  }
  return apart;
}

TEST(MakeSurface, JoinsTrianglesThatMeet) {
  const ObjectModel whole = ballAt(kCentre);
  const int count = whole.mesh.triangleCount();
  EXPECT_EQ(makeSurface(inPieces(whole, -1)).winding, makeSurface(whole).winding);
  for (const int doubled : {-1, count / 2}) {
    const Surface joined = makeSurface(inPieces(whole, doubled));
    EXPECT_EQ(joined.key_vertices.size(), 3 * joined.triangles.size());
    for (int t = 0; t < count; ++t) {
      for (int k = 0; k < 3 && t != doubled; ++k) {
        const Eigen::Vector3f normal = joined.key_normals[joined.corners[t][k]],
                              place = joined.key_vertices[joined.triangles[t][k]];
        if (normal.isZero()) continue;  // a triangle at a pole has no area
        ASSERT_GT(normal.dot((place - kCentre.cast<float>()).normalized()), 0.99f) << t;
      }
    }
  }
}

TEST(StagedFrame, TellsHowFarASurfaceHasMoved) {
  const Setting s(params());
  const RenderParams p = params();
  const Eigen::Vector3f move(0.02f, 0.0f, 0.01f);
  const FrameInput in = s.input(true, move);
  const StagedFrame frame(*s.prepared, p, in);
  ASSERT_EQ(frame.objects.size(), 1u);
  ASSERT_TRUE(frame.objects[0].edited && frame.objects[0].isAtRestInVideo());
  const VisibilityBuffer seen(frame.whole(), {&frame.objects[0].actor.screen});
  int pixels = 0;
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      const std::uint32_t id = seen.ids(v)[u];
      if (id == VisibilityBuffer::kNothing) continue;
      const Eigen::Vector3f now =
          surfacePoint(frame.objects[0].actor, VisibilityBuffer::triangleOf(id), u, v, frame.eye)
              .position;
      const Eigen::Vector2d expected = in.camera.projectWorld(now.cast<double>()) -
                                       in.camera.projectWorld((now - move).cast<double>());
      // within a triangle of some pixels the picture is all but affine
      ASSERT_LT((frame.movement(id, u, v).cast<double>() - expected).norm(), 0.05);
      ASSERT_EQ(frame.stillness(id, u, v), 0.0f);
      ++pixels;
    }
  }
  EXPECT_GT(pixels, 300);
}

TEST(StagedFrame, WhatIsNotMovedIsStill) {
  const Setting s(params());
  const RenderParams p = params();
  const FrameInput in = s.input(true, Eigen::Vector3f::Zero());
  const StagedFrame frame(*s.prepared, p, in);
  const VisibilityBuffer seen(frame.whole(), {&frame.objects[0].actor.screen});
  const Eigen::Vector2d middle = in.camera.projectWorld(kCentre);
  const int u = static_cast<int>(middle.x()), v = static_cast<int>(middle.y());
  ASSERT_NE(seen.idAt(u, v), VisibilityBuffer::kNothing);
  EXPECT_EQ(frame.stillness(seen.idAt(u, v), u, v), 1.0f);
}

// A cloth that blows away from the camera is lit otherwise before it leaves its pixels.
TEST(StagedFrame, WhatHasTurnedInItsPlaceIsNotStill) {
  const Setting s(params());
  const RenderParams p = params();
  const auto middleStillness = [&](float lean) {  // along the views' rays, more to the right
    FrameInput in = s.input(true, Eigen::Vector3f::Zero());
    const Eigen::Vector3f eye = in.camera.world_from_camera.translation().cast<float>(),
                          right = in.camera.world_from_camera.linear().col(0).cast<float>();
    const float distance = (kCentre.cast<float>() - eye).norm();
    for (Eigen::Vector3f& x : in.objects[0].vertices)
      x += (x - eye) * (lean / distance * right.dot(x - kCentre.cast<float>()));
    const StagedFrame frame(*s.prepared, p, in);
    const VisibilityBuffer seen(frame.whole(), {&frame.objects[0].actor.screen});
    const Eigen::Vector2d middle = in.camera.projectWorld(kCentre);
    const int u = static_cast<int>(middle.x()), v = static_cast<int>(middle.y());
    EXPECT_LT(frame.movement(seen.idAt(u, v), u, v).norm(), kStillPx);
    return frame.stillness(seen.idAt(u, v), u, v);
  };
  EXPECT_EQ(middleStillness(0.01f), 1.0f);
  EXPECT_EQ(middleStillness(0.1f), 0.0f);
}

TEST(StagedFrame, WhatIsRemovedCannotBeSeenAndWhatIsNotEditedHasNoPlaceToReturnTo) {
  const Setting s(params());
  const RenderParams p = params();
  FrameInput in = s.input(false, Eigen::Vector3f::Zero());
  const StagedFrame same(*s.prepared, p, in);
  ASSERT_EQ(same.objects.size(), 1u);
  EXPECT_FALSE(same.edited[0] || same.objects[0].edited || same.objects[0].isAtRestInVideo());
  in.objects[0].removed = true;
  const StagedFrame gone(*s.prepared, p, in);
  EXPECT_TRUE(gone.edited[0]);
  EXPECT_TRUE(gone.objects.empty());
}

// Of what sways, the part that differs from the key frame is elsewhere, the other one is at rest.
TEST(StagedFrame, APartOfWhatSwaysMayBeElsewhere) {
  const Setting s(params());
  Prepared prepared = *s.prepared;
  prepared.sways[0] = true;
  const RenderParams p = params();
  FrameInput in = s.input(true, Eigen::Vector3f::Zero());
  in.bgr = in.bgr.clone();
  const Eigen::Vector2d middle = in.camera.projectWorld(kCentre);
  const int u = static_cast<int>(middle.x()), v = static_cast<int>(middle.y());
  in.bgr(cv::Rect(0, 0, u, kHeight)).setTo(cv::Scalar::all(255));
  const StagedFrame frame(prepared, p, in);
  ASSERT_TRUE(frame.at_rest[0]);
  EXPECT_TRUE(frame.isElsewhere(u - 8, v));
  EXPECT_FALSE(frame.isElsewhere(u + 8, v));
}

TEST(StagedFrame, ASegmentationOfAnotherSizeIsRefused) {
  const Setting s(params());
  FrameInput in = s.input(true, Eigen::Vector3f::Zero());
  in.labels = cv::Mat::zeros(10, 10, CV_8U);
  EXPECT_THROW(Renderer(s.prepared, params()).composite(in), std::invalid_argument);
}

}  // namespace
}  // namespace calipso::render
