#include "place/hollow.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "calipso_render/colour.hpp"

namespace calipso::render {
namespace {

constexpr int kWide = 240, kHigh = 180;
constexpr double kRim = 0.1, kDeep = 0.05, kFoot = 0.01;  // m
const cv::Rect kFruit(96, 66, 44, 40);

// Down on a bowl around the axis x = y = 0.
Camera camera() {
  Camera c;
  c.width = kWide, c.height = kHigh, c.fx = c.fy = 560.0, c.cx = 119.5, c.cy = 89.5;
  const Eigen::Vector3d eye(0.0, -0.5, 0.5), z = (Eigen::Vector3d(0, 0, 0.02) - eye).normalized();
  c.world_from_camera.linear().col(0) = Eigen::Vector3d::UnitX(),
  c.world_from_camera.linear().col(1) = z.cross(Eigen::Vector3d::UnitX()),
  c.world_from_camera.linear().col(2) = z;
  c.world_from_camera.translation() = eye;
  return c;
}

double height(double r) { return kFoot + kDeep * r * r / (kRim * kRim); }

// A bowl whose inside has a dark ring, in uneven light, and what lies in it.
struct Bowl {
  std::vector<SupportPlane> table{1};
  cv::Mat plate = cv::Mat(kHigh, kWide, CV_32FC3), depth = cv::Mat(kHigh, kWide, CV_32F), scenery,
          labels = cv::Mat::zeros(kHigh, kWide, CV_8U), inside = labels.clone();

  explicit Bowl(bool round) {
    table[0].normal = Eigen::Vector3d::UnitZ(), table[0].offset = 0.0;
    for (int v = 0; v < kHigh; ++v) {
      for (int u = 0; u < kWide; ++u) see(u, v, round);
    }
    scenery = 1.0 / depth;
    labels(kFruit) = 1, scenery(kFruit) = 0.0f, depth(kFruit) = 0.5f;
  }
  void see(int u, int v, bool round) {
    const Camera c = camera();
    const Eigen::Vector3d eye = c.world_from_camera.translation(),
                          ray = c.world_from_camera.linear() * c.ray(u, v);
    float own = 0.5f;
    double t = (kFoot + kDeep - eye.z()) / ray.z();
    const double end = -eye.z() / ray.z();
    const auto radius = [&] {
      const Eigen::Vector3d p = eye + t * ray;
      return std::hypot(p.x(), round ? p.y() : 0.7 * p.y());
    };
    if (radius() < kRim) {
      while (eye.z() + t * ray.z() > height(radius())) t += 2e-4;
      own = radius() > 0.055 && radius() < 0.075 ? 0.15f : 0.6f;
      inside.at<std::uint8_t>(v, u) = 255;
    } else {
      while (t < end && radius() > kRim) t += 2e-4;  // its outside is upright
    }
    const float light = 1.0f + 0.004f * static_cast<float>(u - kWide / 2);
    depth.at<float>(v, u) = static_cast<float>(std::min(t, end));
    plate.at<cv::Vec3f>(v, u) = cv::Vec3f::all(codeFromLinear(own * light));
  }
  cv::Mat filled(cv::Mat& picture) const {
    cv::Mat hole = labels != 0;
    picture = plate.clone();
    picture.setTo(cv::Scalar::all(10), hole);
    return fillHollows(scenery, findSurfaces(scenery, depth, labels, table, camera()), table[0],
                       camera(), hole, picture);
  }
};

TEST(Hollow, ItsPatternGoesRoundBehindWhatLiesInIt) {
  const Bowl bowl(true);
  cv::Mat picture;
  const cv::Mat filled = bowl.filled(picture), wanted = bowl.inside & (bowl.labels != 0);
  ASSERT_GT(cv::countNonZero(wanted), 1500);
  EXPECT_GT(cv::countNonZero(filled & wanted), 0.98 * cv::countNonZero(wanted));
  EXPECT_EQ(cv::countNonZero(filled & (bowl.labels == 0)), 0);
  cv::Mat error;
  cv::absdiff(picture, bowl.plate, error);
  EXPECT_LT(cv::mean(error, filled)[0], 6.0);  // the ring's borders are a pixel soft
}

TEST(Hollow, IsNoneThatDoesNotTurnAboutAnAxis) {
  cv::Mat picture;
  EXPECT_EQ(cv::countNonZero(Bowl(false).filled(picture)), 0);
}

}  // namespace
}  // namespace calipso::render
