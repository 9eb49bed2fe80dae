#include "light/shadow_borders.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "calipso_render/rasterizer.hpp"
#include "calipso_render/ray_shadow.hpp"
#include "render_test_scene.hpp"

namespace calipso::render {
namespace {

using namespace testing;

const Eigen::Vector3f kSun = Eigen::Vector3f(0.5f, -0.4f, 0.77f).normalized();

Camera closeCamera() {
  Camera c = camera();
  c.width *= 3, c.height *= 3, c.fx *= 3.0, c.fy *= 3.0, c.cx = 239.5, c.cy = 179.5;
  return c;
}

// A ball above a plain table, and its shadow as dark as `shade` of the light, of a sun of `radius`.
struct Setting {
  Surface surface = makeSurface(ballAt({-0.1, 0.0, 0.2}));
  View view{{}, {}, closeCamera(), {makeActor(surface, surface.key_vertices, closeCamera())}};

  explicit Setting(float shade, double radius = 1e-4) {
    constexpr int kParts = 3;  // of a pixel, each way
    const cv::Size size(view.camera.width, view.camera.height);
    view.picture = cv::Mat(size, CV_32FC3), view.labels = cv::Mat::zeros(size, CV_8U);
    const Actor& ball = view.actors[0];
    const RayShadow sun({{&ball.vertices, &surface.triangles, surface.winding}},
                        kSun.cast<double>(), {radius, 24});
    const VisibilityBuffer seen({{0, 0}, size}, {&ball.screen});
    cv::RNG random(5);
    for (int v = 0; v < size.height; ++v) {
      for (int u = 0; u < size.width; ++u) {
        if (seen.ids(v)[u] != VisibilityBuffer::kNothing)
          view.labels.at<std::uint8_t>(v, u) = kBallLabel;
        float part = 0.0f;  // in shade
        for (int k = 0; k < kParts * kParts; ++k) {
          const auto table_there = receiverAt(table(), view.camera, u + (k % kParts - 1) / 3.0f,
                                              v + (k / kParts - 1) / 3.0f);
          if (table_there)
            part += (1.0f - sun.visibility(table_there->position, table_there->normal)) /
                    (kParts * kParts);
        }
        view.picture.at<cv::Vec3f>(v, u) =
            cv::Vec3f::all(codeFromLinear(0.3f * (1.0f - part * (1.0f - shade))) +
                           static_cast<float>(random.gaussian(1.0)));
      }
    }
  }

  std::optional<SunByBorders> sunFrom(const Eigen::Vector3f& start,
                                      const std::vector<SupportPlane>& planes) const {
    return sunByBorders({view}, planes, cv::Mat(), start.normalized(), 0.0f);
  }
};

double degreesBetween(const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
  return std::acos(std::min(1.0f, a.dot(b))) * 180.0 / M_PI;
}

TEST(ShadowBorders, PutTheSunWhereItsShadowsLie) {
  const Setting setting(0.5f);
  const Eigen::Vector3f s = kSun.unitOrthogonal(), t = kSun.cross(s);
  for (const Eigen::Vector3f& off : {s, Eigen::Vector3f(-s), t, Eigen::Vector3f(-t)}) {
    const auto found = setting.sunFrom(kSun + 0.014f * off, table());  // 0.8 degrees
    ASSERT_TRUE(found);
    // A pixel is a quarter of a degree, and some forty borders tell a fifth of one.
    EXPECT_LT(degreesBetween(found->direction, kSun), 0.15);
  }
}

TEST(ShadowBorders, AreAsSoftAsTheSunIsLarge) {
  for (const double radius : {0.02, 0.04}) {
    const auto found = Setting(0.5f, radius).sunFrom(kSun, table());
    ASSERT_TRUE(found && found->radius);
    // Borders are 3 and 6 px wide, told to a fifth or so, and a lower quantile counts.
    EXPECT_NEAR(*found->radius, radius, 0.3 * radius);
  }
}

TEST(ShadowBorders, TellNothingWhereNoneAreSeen) {
  EXPECT_FALSE(Setting(1.0f).sunFrom(kSun, table()));
  EXPECT_FALSE(Setting(0.5f).sunFrom(kSun, {}));
  // The shadow is somewhere else.
  EXPECT_FALSE(Setting(0.5f).sunFrom(kSun + Eigen::Vector3f(-0.6f, 0.0f, 0.0f), table()));
}

}  // namespace
}  // namespace calipso::render
