#include "draw/joint_visibility.hpp"

#include <gtest/gtest.h>

#include "ball_setting.hpp"
#include "frame/occlusion.hpp"

namespace calipso::render {
namespace {

using namespace testing;

struct Balls {
  Points near, far;
  Triangles triangles;

  explicit Balls(const Eigen::Vector3f& apart) {
    const Surface surface = makeSurface(ballAt({0.0, 0.0, kBallRadius}));
    near = far = surface.key_vertices, triangles = surface.triangles;
    for (Eigen::Vector3f& p : far) p += apart;
  }
  std::vector<Occluder> both() const { return {{&near, &triangles, 1}, {&far, &triangles, 1}}; }
};

TEST(NearGroups, JoinWhatIsNear) {
  const Balls beside({0.25f, 0.0f, 0.0f}), apart({4.0f, 0.0f, 0.0f}), above({0.0f, 0.0f, 4.0f});
  EXPECT_EQ(nearGroups(beside.both(), Eigen::Vector3d::UnitZ()).size(), 1u);
  EXPECT_EQ(nearGroups(apart.both(), Eigen::Vector3d::UnitZ()).size(), 2u);
  EXPECT_EQ(nearGroups(above.both(), Eigen::Vector3d::UnitZ()).size(), 1u);
  EXPECT_TRUE(nearGroups({}, Eigen::Vector3d::UnitZ()).empty());
}

TEST(NearGroups, AreFewHoweverManyThereAre) {
  std::vector<Balls> spread;
  for (int k = 0; k < 9; ++k) spread.emplace_back(Eigen::Vector3f(5.0f * k, 0.0f, 0.0f));
  std::vector<Occluder> all;
  for (const Balls& b : spread) all.push_back({&b.far, &b.triangles, 1});
  std::size_t members = 0;
  const auto groups = nearGroups(all, Eigen::Vector3d::UnitZ());
  for (const auto& group : groups) members += group.size();
  EXPECT_LE(groups.size(), 4u);
  EXPECT_EQ(members, all.size());
}

// What is thrown far away leaves what stays its shadow and the dark of its contact.
TEST(JointVisibility, IsAsFineAsThatOfEach) {
  const Balls balls({0.0f, 12.0f, 9.0f});
  const std::vector<Occluder> one = {balls.both().front()};
  const RenderParams p = params();
  const auto alone = sunVisibility(one, sunlight(), p),
             joint = sunVisibility(balls.both(), sunlight(), p), sky_alone = skyVisibility(one, p),
             sky_joint = skyVisibility(balls.both(), p);
  int shaded = 0;
  for (float x = -0.4f; x < 0.4f; x += 0.02f) {
    for (float y = -0.4f; y < 0.4f; y += 0.02f) {
      const Eigen::Vector3f at(x, y, 0.0f), up = Eigen::Vector3f::UnitZ();
      ASSERT_EQ(joint->visibility(at, up), alone->visibility(at, up));
      ASSERT_NEAR(sky_joint->visibility(at, up), sky_alone->visibility(at, up), 1e-3f);
      if (const auto known = joint->uniform(at, up, 0.01f)) {
        ASSERT_EQ(*known, joint->visibility(at, up));
      }
      shaded += joint->visibility(at, up) < 0.5f;
    }
  }
  EXPECT_GT(shaded, 20);
}

// A post whose lower end is in the ground shades from there on.
TEST(ShadowBounds, HoldTheFootOfWhatIsSunk) {
  const Setting s(params());
  const RenderParams p = params();
  const FrameInput in = s.input(true, Eigen::Vector3f::Zero());
  const StagedFrame frame(*s.prepared, p, in);
  const Eigen::Vector3f sun = sunlight().direction;
  Points post;
  for (const float z : {-0.1f, 0.25f})
    for (const float x : {-0.02f, 0.02f})
      for (const float y : {0.08f, 0.12f}) post.emplace_back(x, y, z);
  const cv::Rect bounds = shadowBounds(frame, Relief(), post, sun);
  for (float h = 0.0f; h < 0.2f; h += 0.01f) {
    const Eigen::Vector3f foot = Eigen::Vector3f(0.0f, 0.1f, h) - sun * (h / sun.z());
    const Eigen::Vector2d pixel = in.camera.projectWorld(foot.cast<double>());
    if (!frame.whole().contains(cv::Point(cvRound(pixel.x()), cvRound(pixel.y())))) continue;
    EXPECT_TRUE(bounds.contains(cv::Point(cvRound(pixel.x()), cvRound(pixel.y())))) << h;
  }
}

}  // namespace
}  // namespace calipso::render
