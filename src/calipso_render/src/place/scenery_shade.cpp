#include "place/scenery_shade.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "calipso_render/inpaint.hpp"
#include "draw/ray_scene.hpp"

namespace calipso::render {
namespace {

constexpr int kStride = 2;          // px between corners of the mesh, and between places
constexpr float kConnected = 0.1f;  // of the nearness: pixels of one surface
constexpr float kOff = 0.02f;       // of a place's distance: nearer by may be the place itself
// of these places: squares in which most decide, and gaps that come of what nobody sees of it
constexpr int kSpeck = 3, kGap = 13;

// Nearness of what rises above the support planes, 0 elsewhere.
cv::Mat risen(const cv::Mat& scenery, const PlaceSurfaces& surfaces) {
  const cv::Mat seen = (surfaces.label > surfaces.supports) & (scenery > 0.0f),
                hidden = (surfaces.alike == PlaceSurfaces::kCurved) & (scenery == 0.0f);
  cv::Mat nearness = cv::Mat::zeros(scenery.size(), CV_32F), weight;
  seen.convertTo(weight, CV_32F, 1.0 / 255.0);
  if (cv::countNonZero(hidden) > 0) pushPull(scenery, weight).copyTo(nearness, hidden);
  scenery.copyTo(nearness, seen);
  return nearness;
}

struct Mesh {
  Points vertices;
  Triangles triangles;
};

Mesh meshOf(const cv::Mat& nearness, const Camera& camera) {
  const int columns = (nearness.cols - 1) / kStride + 1, rows = (nearness.rows - 1) / kStride + 1;
  Mesh mesh;
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < columns; ++i) {
      const int u = i * kStride, v = j * kStride;
      const float near = nearness.at<float>(v, u);
      // What is not there is no corner of a triangle.
      mesh.vertices.push_back(
          (camera.world_from_camera * Eigen::Vector3d(camera.ray(u, v) / std::max(near, 1e-6f)))
              .cast<float>());
      if (i + 1 == columns || j + 1 == rows) continue;
      const auto [least, most] =
          std::minmax({near, nearness.at<float>(v, u + kStride), nearness.at<float>(v + kStride, u),
                       nearness.at<float>(v + kStride, u + kStride)});
      if (most == 0.0f || least < (1.0f - kConnected) * most) continue;
      const int first = j * columns + i;
      mesh.triangles.push_back({first, first + 1, first + columns});
      mesh.triangles.push_back({first + 1, first + columns + 1, first + columns});
    }
  }
  return mesh;
}

}  // namespace

cv::Mat shadeOfScenery(const cv::Mat& scenery, const PlaceSurfaces& surfaces, const Camera& camera,
                       const Eigen::Vector3f& to_sun, const ReceiverOf& receiver) {
  if (surfaces.empty()) return {};
  const Mesh mesh = meshOf(risen(scenery, surfaces), camera);
  if (mesh.triangles.empty()) return {};
  const RayScene scene({{&mesh.vertices, &mesh.triangles}});
  const Eigen::Vector3f eye = camera.world_from_camera.translation().cast<float>();
  cv::Mat shade =
      cv::Mat::zeros((camera.height + 1) / kStride, (camera.width + 1) / kStride, CV_8U);
#pragma omp parallel for schedule(dynamic, 4)
  for (int j = 0; j < shade.rows; ++j) {
    for (int i = 0; i < shade.cols; ++i) {
      const std::optional<Receiver> place = receiver(i * kStride, j * kStride);
      if (!place) continue;
      const float off = kOff * (place->position - eye).norm();
      if (scene.blocked(place->position + off * to_sun, to_sun)) shade.at<std::uint8_t>(j, i) = 255;
    }
  }
  cv::medianBlur(shade, shade, kSpeck);
  cv::morphologyEx(shade, shade, cv::MORPH_CLOSE,
                   cv::getStructuringElement(cv::MORPH_ELLIPSE, {kGap, kGap}));
  if (cv::countNonZero(shade) == 0) return {};
  cv::resize(shade, shade, {camera.width, camera.height}, 0.0, 0.0, cv::INTER_NEAREST);
  return shade;
}

}  // namespace calipso::render
