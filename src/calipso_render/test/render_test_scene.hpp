#pragma once

#include <cmath>
#include <opencv2/core.hpp>

#include "calipso_render/colour.hpp"
#include "calipso_render/renderer.hpp"

namespace calipso::render::testing {

// A matt ball above a textured table in exact light: what every picture test needs, without files.
inline constexpr int kWidth = 160, kHeight = 120, kBallLabel = 1;
inline constexpr double kBallRadius = 0.1;

inline Camera camera() {
  Camera c;
  c.width = kWidth, c.height = kHeight;
  c.fx = c.fy = 180.0, c.cx = 79.5, c.cy = 59.5;
  // Looks along +y, slightly down.
  Eigen::Matrix3d axes;
  const double s = std::sin(0.5), k = std::cos(0.5);
  axes.col(0) = Eigen::Vector3d(1, 0, 0);
  axes.col(1) = Eigen::Vector3d(0, -s, -k);
  axes.col(2) = Eigen::Vector3d(0, k, -s);
  c.world_from_camera.linear() = axes;
  c.world_from_camera.translation() = Eigen::Vector3d(0.0, -0.7, 0.5);
  return c;
}

inline TriangleMesh ball(int rings = 24) {
  TriangleMesh m;
  const int columns = 2 * rings;
  m.vertices.resize((rings + 1) * columns, 3);
  m.triangles.resize(2 * rings * columns, 3);
  int t = 0;
  for (int i = 0; i <= rings; ++i) {
    for (int j = 0; j < columns; ++j) {
      const double a = M_PI * i / rings, b = 2.0 * M_PI * j / columns;
      m.vertices.row(i * columns + j) =
          kBallRadius *
          Eigen::RowVector3d(std::sin(a) * std::cos(b), std::sin(a) * std::sin(b), std::cos(a));
      if (i == rings) continue;
      const int k = (j + 1) % columns;
      m.triangles.row(t++) =
          Eigen::RowVector3i(i * columns + j, (i + 1) * columns + j, (i + 1) * columns + k);
      m.triangles.row(t++) =
          Eigen::RowVector3i(i * columns + j, (i + 1) * columns + k, i * columns + k);
    }
  }
  return m;
}

inline ObjectModel ballAt(const Eigen::Vector3d& centre, const std::string& name = "ball",
                          int index = kBallLabel) {
  ObjectModel model{name, index, ball(), Eigen::Isometry3d::Identity()};
  model.world_from_object.translation() = centre;
  return model;
}

inline Light sunlight() {
  Light light;
  light.direction = Eigen::Vector3f(0.5f, -0.4f, 0.77f).normalized();
  light.sun = {0.7f, 0.7f, 0.7f};
  light.ambient[0] = {0.3f, 0.3f, 0.3f};
  return light;
}

inline std::vector<SupportPlane> table() {
  SupportPlane plane;
  plane.name = "table";
  return {plane};
}

inline cv::Vec3b tableColour(int u, int v) {
  const double x = 120.0 + 40.0 * std::sin(0.35 * u + 0.1 * v) + 20.0 * std::sin(0.23 * v);
  return cv::Vec3b(quantise(static_cast<float>(0.7 * x)), quantise(static_cast<float>(0.9 * x)),
                   quantise(static_cast<float>(x)));
}

inline cv::Mat emptyTable() {
  cv::Mat picture(kHeight, kWidth, CV_8UC3);
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) picture.at<cv::Vec3b>(v, u) = tableColour(u, v);
  }
  return picture;
}

// Calls `act(u, v, point)` for every pixel whose centre an actor covers.
template <typename Act>
void forEachPixelOf(const Actor& actor, const Act& act) {
  const VisibilityBuffer buffer({0, 0, kWidth, kHeight}, {&actor.screen});
  const Eigen::Vector3f eye = camera().world_from_camera.translation().cast<float>();
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      const std::uint32_t id = buffer.ids(v)[u];
      if (id == VisibilityBuffer::kNothing) continue;
      act(u, v, surfacePoint(actor, VisibilityBuffer::triangleOf(id), u, v, eye));
    }
  }
}

// The ball drawn over the table, with the labels of the pixels whose centre it covers.
inline ClipFrame frameWithBall(const ObjectModel& model) {
  ClipFrame frame{emptyTable(), cv::Mat::zeros(kHeight, kWidth, CV_8U), camera()};
  const Surface surface = makeSurface(model);
  forEachPixelOf(makeActor(surface, surface.key_vertices, frame.camera),
                 [&](int u, int v, const SurfacePoint& p) {
                   const cv::Vec3f shade = diffuseShading(sunlight(), p.normal, 1.0f);
                   const cv::Vec3f albedo(0.15f, 0.3f, 0.6f);
                   for (int c = 0; c < 3; ++c)
                     frame.bgr.at<cv::Vec3b>(v, u)[c] =
                         quantise(codeFromLinear(albedo[c] * shade[c]));
                   frame.labels.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(model.index);
                 });
  return frame;
}

inline double psnr(const cv::Mat& a, const cv::Mat& b, const cv::Mat& mask) {
  double sum = 0.0;
  long count = 0;
  for (int v = 0; v < a.rows; ++v) {
    for (int u = 0; u < a.cols; ++u) {
      if (mask.at<std::uint8_t>(v, u) == 0) continue;
      for (int c = 0; c < 3; ++c) {
        const double d = double(a.at<cv::Vec3b>(v, u)[c]) - b.at<cv::Vec3b>(v, u)[c];
        sum += d * d, ++count;
      }
    }
  }
  return sum > 0.0 ? 10.0 * std::log10(255.0 * 255.0 * count / sum) : 99.0;
}

}  // namespace calipso::render::testing
