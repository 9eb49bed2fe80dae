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
  std::vector<LikePlace> like = turnedPlaces(surface.key_vertices, surface.triangles, kEye);
  judgeLikePlaces(
      known, 0.002f,
      [&](const Place& place) {
        return isKnown(place.point) ? std::make_optional(colour(place.point)) : std::nullopt;
      },
      like);
  return like;
}

// Of 360 degrees around the middle, those in which a place and the one it is like have one colour.
int degreesAlike(const LikePlace& like,
                 const std::function<cv::Vec3f(const Eigen::Vector3f&)>& colour) {
  int same = 0;
  for (int i = 0; i < 360; ++i) {
    const float angle = static_cast<float>(i * M_PI / 180.0);
    const Eigen::Vector3f x =
        static_cast<float>(kBallRadius) * Eigen::Vector3f(std::sin(angle), -std::cos(angle), 0.0f);
    same += colour(like.of({x, x.normalized()}).point) == colour(x);
  }
  return same;
}

// What is seen is repeated about places where its pattern repeats itself.
TEST(LikePlaces, AreTurnedAboutTheMiddlesOfGores) {
  std::vector<LikePlace> like = judged(goreAt);
  EXPECT_LT(like.front().agrees.value(), 0.2f);
  like = bestFirst({}, like, 3);
  ASSERT_EQ(like.size(), 3u);
  EXPECT_GT(like.front().agrees.value(), 0.8f);
  EXPECT_GT(degreesAlike(like.front(), goreAt), 300);
}

// Gores of three colours in turn are no mirror images of each other, but of the fourth next.
TEST(LikePlaces, AreTurnedByThePartsThatDivideTheTurn) {
  const auto colour = [](const Eigen::Vector3f& x) {
    const cv::Vec3f colours[] = {kRed, kYellow, {0.6f, 0.1f, 0.1f}};
    return colours[static_cast<int>(std::floor(angleOf(x) / (M_PI / 6.0) + 120.2)) % 3];
  };
  const std::vector<LikePlace> like = bestFirst({}, judged(colour), 1);
  ASSERT_EQ(like.size(), 1u);
  EXPECT_GT(like.front().agrees.value(), 0.8f);
  EXPECT_GT(degreesAlike(like.front(), colour), 340);
}

TEST(LikePlaces, OfOneColourAreThoseNearestToTheMiddle) {
  std::vector<LikePlace> like = judged([](const Eigen::Vector3f&) { return kRed; });
  const Place place{{0.0f, static_cast<float>(kBallRadius), 0.0f}, Eigen::Vector3f::UnitY()};
  const Eigen::Vector3f first = like.front().of(place).point;
  EXPECT_EQ(like.front().agrees, 1.0f);
  like = bestFirst({}, like, 3);
  EXPECT_EQ(like.front().of(place).point, first);
}

// Where nothing tells, the shape is believed, after what is seen and before what that contradicts.
TEST(LikePlaces, ThatNothingTellsOfComeBetweenTheOthers) {
  const auto same = [](const Place& place) { return place; };
  const std::vector<LikePlace> like = bestFirst({{same, std::nullopt}, {same, 0.2f}},
                                                {{same, 0.8f}, {same, 0.1f}, {same, 0.95f}}, 3);
  ASSERT_EQ(like.size(), 5u);
  EXPECT_EQ(like[0].agrees, 0.95f);
  EXPECT_EQ(like[1].agrees, 0.8f);
  EXPECT_FALSE(like[2].agrees);
}

// However well turned places agree: a handle has its mirror image alone.
TEST(LikePlaces, MirroredAreAllKept) {
  const auto same = [](const Place& place) { return place; };
  const std::vector<LikePlace> like =
      bestFirst({{same, std::nullopt}}, std::vector<LikePlace>(5, {same, 1.0f}), 3);
  ASSERT_EQ(like.size(), 4u);
  EXPECT_FALSE(like.back().agrees);
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
  for (const LikePlace& like : mirroredPlaces(mirrorPlanes(surface.key_vertices, surface.triangles),
                                              surface.key_vertices, surface.triangles, parts)) {
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
