#include <gtest/gtest.h>

#include <algorithm>

#include "frame/plane_light.hpp"
#include "test_room.hpp"

namespace calipso::render {
namespace {

using namespace testing;

// A light that ends within a micrometre at a plane across floor and wall.
class HalfLight : public Visibility {
 public:
  float visibility(const Eigen::Vector3f& p, const Eigen::Vector3f&) const override {
    return std::clamp(0.5f + 1e6f * inside(p), 0.0f, 1.0f);
  }
  bool empty() const override { return false; }
  std::optional<float> uniform(const Eigen::Vector3f& p, const Eigen::Vector3f&,
                               float radius) const override {
    if (std::abs(inside(p)) <= radius) return std::nullopt;
    return inside(p) > 0.0f ? 1.0f : 0.0f;
  }

 private:
  static float inside(const Eigen::Vector3f& p) {
    return p.dot(Eigen::Vector3f(1.0f, 0.3f, 0.4f).normalized()) - 1.076f;
  }
};

// Pixels of a wall that a sharp shadow's border crosses are shaded in part, as those of planes, and
// are the same whatever part of the picture is asked for.
TEST(PlanesInLight, IsAsSoftAsAPixelOffThePlanes) {
  const PlaceView view(PlaneView(floorPlane(), roomCamera()), findRelief(Room().surfaces(), kSun));
  const HalfLight light;
  const auto levelsIn = [&](const cv::Rect& rect) {
    cv::Mat levels(rect.size(), CV_8U, cv::Scalar(255));
    planesInLight(view, light, rect, SquareMask(), levels);
    return levels;
  };
  const cv::Rect wall(3, 5, 150, 60), part(61, 13, 50, 41);
  const cv::Mat levels = levelsIn(wall);
  int in_part = 0;
  for (int v = wall.y; v < wall.br().y; ++v) {
    for (int u = wall.x; u < wall.br().x; ++u) {
      float seen = 0.0f;
      for (int k = 0; k < 4; ++k) {
        const Eigen::Vector3f ray =
            roomCamera().ray(u - 0.5f + (k & 1), v - 0.5f + (k >> 1)).cast<float>();
        const Eigen::Vector3f at(kWallAway * ray.x(), kWallAway, 1.0f - kWallAway * ray.y());
        seen += 0.25f * light.visibility(at, {});
      }
      const int level = levels.at<std::uint8_t>(v - wall.y, u - wall.x);
      ASSERT_NEAR(level, 255.0f * seen, 1.0f) << u << ", " << v;
      in_part += level > 0 && level < 255;
    }
  }
  EXPECT_GE(in_part, wall.height);
  EXPECT_EQ(cv::norm(levelsIn(part), levels(part - wall.tl()), cv::NORM_INF), 0.0);
}

// A light that nothing beyond the wall has.
class LightBefore : public Visibility {
 public:
  float visibility(const Eigen::Vector3f& p, const Eigen::Vector3f&) const override {
    return p.y() < kWallAway + 0.5f ? 1.0f : 0.0f;
  }
  bool empty() const override { return false; }
  std::optional<float> uniform(const Eigen::Vector3f&, const Eigen::Vector3f&,
                               float) const override {
    return std::nullopt;
  }
};

// Where one surface ends before another the picture mixes both.
TEST(PlanesInLight, IsAsSoftAsAPixelWhereASurfaceEnds) {
  constexpr int kEnds = 43;  // column: half of the wall is a metre farther away
  Relief relief = findRelief(Room().surfaces(), kSun);
  for (int v = 0; v < relief.seen.rows; ++v) {
    for (int u = kEnds; u < relief.seen.cols; ++u) {
      cv::Vec3f& at = relief.position.at<cv::Vec3f>(v, u);
      at[0] *= (kWallAway + 1.0f) / kWallAway, at[1] = kWallAway + 1.0f;
    }
  }
  const PlaceView view(PlaneView(floorPlane(), roomCamera()), relief);
  const cv::Rect wall(3, 5, 150, 60);
  cv::Mat levels(wall.size(), CV_8U, cv::Scalar(255));
  planesInLight(view, LightBefore(), wall, SquareMask(), levels);
  const std::uint8_t expected[] = {255, 191, 64, 0};  // weights 1, 2, 1 of the columns around
  for (int v = 1; v + 1 < levels.rows; ++v) {
    for (int k = 0; k < 4; ++k)
      ASSERT_NEAR(levels.at<std::uint8_t>(v, kEnds - 2 + k - wall.x), expected[k], 1) << v << k;
  }
}

}  // namespace
}  // namespace calipso::render
