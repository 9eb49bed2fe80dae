#include "texture/like_places.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "render_test_scene.hpp"
#include "texture/mesh_topology.hpp"

namespace calipso::render {
namespace {

using namespace testing;

const Eigen::Vector3f kEye(0.0f, -2.0f, 0.0f);
const cv::Vec3f kRed(0.1f, 0.1f, 0.6f), kYellow(0.1f, 0.5f, 0.6f);

float angleOf(const Eigen::Vector3f& x) { return std::atan2(x.x(), -x.y()); }  // 0 = towards kEye

// Twelve gores, red and yellow in turn, with a seam 45 degrees aside.
cv::Vec3f goreAt(const Eigen::Vector3f& x) {
  const double gores = (angleOf(x) - M_PI / 4.0) / (M_PI / 6.0) + 100.0;
  return static_cast<int>(std::floor(gores)) % 2 == 0 ? kRed : kYellow;
}

// Known is what is turned by up to 75 degrees from the eye.
std::vector<LikePlace> judged(const std::function<cv::Vec3f(const Eigen::Vector3f&)>& colour) {
  ObjectModel balloon = ballAt(Eigen::Vector3d::Zero());
  balloon.mesh.vertices.col(2) *= 1.5;  // so that it has but one axis
  const Surface surface = makeSurface(balloon);
  std::vector<KnownPlace> known;
  const auto isKnown = [](const Eigen::Vector3f& x) {
    return std::abs(angleOf(x)) < 1.3f && std::abs(x.z()) < 0.8f * kBallRadius;
  };
  for (const Eigen::Vector3f& x : surface.key_vertices) {
    if (isKnown(x)) known.push_back({{x, x.normalized()}, colour(x)});
  }
  std::vector<LikePlace> like = turnedPlaces(surface, kEye);
  judgeLikePlaces(
      known, 0.002f,
      [&](const Place& place) {
        return isKnown(place.point) ? std::make_optional(colour(place.point)) : std::nullopt;
      },
      like);
  return like;
}

// What is seen is repeated about places where its pattern repeats itself.
TEST(LikePlaces, AreTurnedAboutTheMiddlesOfGores) {
  std::vector<LikePlace> like = judged(goreAt);
  EXPECT_LT(like.front().agrees.value(), 0.2f);
  keepBest(3, like);
  ASSERT_EQ(like.size(), 3u);
  EXPECT_GT(like.front().agrees.value(), 0.8f);
  int same = 0, all = 0;
  for (int i = 0; i < 360; ++i, ++all) {
    const float angle = static_cast<float>(i * M_PI / 180.0);
    const Eigen::Vector3f x =
        static_cast<float>(kBallRadius) * Eigen::Vector3f(std::sin(angle), -std::cos(angle), 0.0f);
    same += goreAt(like.front().of({x, x.normalized()}).point) == goreAt(x);
  }
  EXPECT_GT(same, 300);
}

TEST(LikePlaces, OfOneColourAreThoseNearestToTheMiddle) {
  std::vector<LikePlace> like = judged([](const Eigen::Vector3f&) { return kRed; });
  const Place place{{0.0f, static_cast<float>(kBallRadius), 0.0f}, Eigen::Vector3f::UnitY()};
  const Eigen::Vector3f first = like.front().of(place).point;
  EXPECT_EQ(like.front().agrees, 1.0f);
  keepBest(3, like);
  EXPECT_EQ(like.front().of(place).point, first);
}

// Where nothing tells, the shape is believed unless what is seen speaks clearly for others.
TEST(LikePlaces, ThatNothingTellsOfComeBetweenTheOthers) {
  const auto same = [](const Place& place) { return place; };
  std::vector<LikePlace> like = {{same, 0.2f}, {same, 0.8f}, {same, std::nullopt}, {same, 0.95f}};
  keepBest(3, like);
  ASSERT_EQ(like.size(), 3u);
  EXPECT_EQ(like[0].agrees, 0.95f);
  EXPECT_FALSE(like[1].agrees);
  EXPECT_EQ(like[2].agrees, 0.8f);
}

// A ball between two others: the outer ones are each other's images, the middle one its own.
TEST(LikePlaces, MirroredAreOfTheMirroredPart) {
  ObjectModel model = ballAt(Eigen::Vector3d::Zero());
  const TriangleMesh one = ball(8);
  const Eigen::Index vertices = one.vertices.rows(), triangles = one.triangles.rows();
  model.mesh.vertices.resize(3 * vertices, 3), model.mesh.triangles.resize(3 * triangles, 3);
  for (int i = 0; i < 3; ++i) {
    model.mesh.vertices.middleRows(i * vertices, vertices) =
        one.vertices.rowwise() + Eigen::RowVector3d(3.0 * kBallRadius * (i - 1), 0.0, 0.0);
    model.mesh.triangles.middleRows(i * triangles, triangles) =
        one.triangles.array() + static_cast<int>(i * vertices);
  }
  const Surface surface = makeSurface(model);
  const std::vector<int> parts = connectedParts(surface.key_vertices, surface.triangles);
  const int left = parts[0], middle = parts[triangles], right = parts[2 * triangles];
  bool across = false;
  for (const LikePlace& like : mirroredPlaces(surface, parts)) {
    const Eigen::Vector3f x(-3.0f * static_cast<float>(kBallRadius), 0.0f, 0.0f);
    const Place image = like.of({x, Eigen::Vector3f::UnitX(), left});
    const bool changes = image.point.x() > 0.0f;
    EXPECT_EQ(image.part, changes ? right : left);
    EXPECT_EQ(like.of({{0, 0, 0}, Eigen::Vector3f::UnitX(), middle}).part, middle);
    across = across || changes;
  }
  EXPECT_TRUE(across);
}

// Spots that nothing repeats.
TEST(LikePlaces, OfSpotsDoNotAgree) {
  const std::vector<LikePlace> like = judged([](const Eigen::Vector3f& x) {
    std::mt19937 random(1);
    for (int i = 0; i < 3; ++i)
      random.seed(random() + static_cast<unsigned>(std::floor(x[i] / 0.015f)));
    return random() % 2 == 0 ? kRed : kYellow;
  });
  EXPECT_FALSE(like.empty());
  for (const LikePlace& l : like) EXPECT_FALSE(l.agreesWell());
}

}  // namespace
}  // namespace calipso::render
