#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "calipso_render/inpaint.hpp"
#include "place/plane_mirror.hpp"
#include "place/plane_view.hpp"

namespace calipso::render {
namespace {

constexpr float kAtNormal = 0.03f;  // reflectance at normal incidence: between water and varnish
constexpr int kSpreadStep = 4;      // px between the places where the spread is found

// The mirror image of a surface in a plane as the camera sees it; what lies below the plane is not
// mirrored.
ScreenMesh mirrored(const Actor& actor, const SupportPlane& plane, const Camera& camera) {
  const Eigen::Vector3f n = plane.normal.cast<float>();
  Points points = actor.vertices;
  for (Eigen::Vector3f& p : points)
    p -= (std::max(0.0f, n.dot(p) - static_cast<float>(plane.offset)) + n.dot(p) -
          static_cast<float>(plane.offset)) *
         n;
  ScreenMesh mesh = projectMesh(points, actor.surface->triangles, camera);
  const bool around_us = std::any_of(mesh.points.begin(), mesh.points.end(),
                                     [](const Eigen::Vector3f& p) { return std::isnan(p.z()); });
  mesh.hidden_side = around_us ? 0 : -actor.surface->winding;
  return mesh;
}

float schlick(float cosine) {
  const float rest = 1.0f - std::clamp(cosine, 0.0f, 1.0f), squared = rest * rest;
  return kAtNormal + (1.0f - kAtNormal) * squared * squared * rest;
}

void addPlane(const std::vector<const Actor*>& actors, const Radiance& radiance,
              const PlaneView& view, const SupportPlane& plane, const Camera& camera,
              const cv::Mat& off, MirrorImage& image, cv::Mat& near) {
  std::vector<ScreenMesh> meshes;
  cv::Rect box;
  for (const Actor* a : actors) {
    meshes.push_back(mirrored(*a, plane, camera));
    box |= boundsOf(meshes.back(), 1, {camera.width, camera.height});
  }
  if (box.empty()) return;
  const VisibilityBuffer buffer(box, pointersTo(meshes));
  const Eigen::Vector3f n = plane.normal.cast<float>(),
                        eye = camera.world_from_camera.translation().cast<float>();
  const Eigen::Vector3f mirrored_eye =
      eye - 2.0f * (n.dot(eye) - static_cast<float>(plane.offset)) * n;
  if (image.empty())
    image = {cv::Mat::zeros(camera.height, camera.width, CV_32FC3),
             cv::Mat::zeros(camera.height, camera.width, CV_32F),
             {},
             1.0f,
             {}};
  image.box |= box;
#pragma omp parallel for schedule(dynamic, 4)
  for (int v = box.y; v < box.br().y; ++v) {
    for (int u = box.x; u < box.br().x; ++u) {
      const std::uint32_t id = buffer.idAt(u, v);
      if (id == VisibilityBuffer::kNothing || (!off.empty() && off.at<std::uint8_t>(v, u) != 0))
        continue;
      Receiver receiver;
      if (!view.at(static_cast<float>(u), static_cast<float>(v), receiver) ||
          receiver.normal.dot(n) < 0.999f)
        continue;
      const float above = n.dot(receiver.position) - static_cast<float>(plane.offset);
      if (std::abs(above) > 1e-3f * (eye - receiver.position).norm()) continue;  // another plane
      const int slot = VisibilityBuffer::objectOf(id), triangle = VisibilityBuffer::triangleOf(id);
      const Eigen::Vector3f weights =
          barycentric(meshes[slot], triangle, static_cast<float>(u), static_cast<float>(v));
      const float part = schlick(n.dot((eye - receiver.position).normalized()));
      image.cover.at<float>(v, u) = part;
      near.at<float>(v, u) = buffer.nearnessAt(u, v);
      image.colour.at<cv::Vec3f>(v, u) =
          part * radiance(slot, surfacePoint(*actors[slot], triangle, weights, mirrored_eye));
    }
  }
}

// Means of what is known in squares of kSpreadStep px, for pushPull(), and how far they are known.
// @param box beyond it nothing is
void bringDown(const cv::Mat& near, const cv::Rect& box, cv::Mat& mean, cv::Mat& weight) {
  const cv::Size size((near.cols + kSpreadStep - 1) / kSpreadStep,
                      (near.rows + kSpreadStep - 1) / kSpreadStep);
  mean = cv::Mat::zeros(size, CV_32F), weight = cv::Mat::zeros(size, CV_32F);
#pragma omp parallel for schedule(static)
  for (int j = box.y / kSpreadStep; j <= (box.br().y - 1) / kSpreadStep; ++j) {
    for (int i = box.x / kSpreadStep; i <= (box.br().x - 1) / kSpreadStep; ++i) {
      float sum = 0.0f;
      int count = 0;
      for (int v = j * kSpreadStep; v < std::min(near.rows, (j + 1) * kSpreadStep); ++v) {
        for (int u = i * kSpreadStep; u < std::min(near.cols, (i + 1) * kSpreadStep); ++u) {
          sum += near.at<float>(v, u), count += near.at<float>(v, u) > 0.0f;
        }
      }
      if (count > 0)
        mean.at<float>(j, i) = sum / static_cast<float>(count), weight.at<float>(j, i) = 1.0f;
    }
  }
}

// A facet that is tilted by s turns the mirrored ray by 2 s: behind it, over the way D2 to the
// object, by 2 s D2 px f / (D1 + D2); along a row it is less by the cosine of incidence. The
// objects' distance is taken on smoothly beyond them. All of it changes slowly over the picture.
void findSpread(const PlaneView& view, const Camera& camera, const cv::Mat& near,
                MirrorImage& image) {
  cv::Mat mean, weight;
  bringDown(near, image.box, mean, weight);
  const cv::Mat filled = pushPull(mean, weight);
  cv::Mat spread = cv::Mat::zeros(weight.size(), CV_32F), whole;
  const Eigen::Isometry3f from_world = camera.world_from_camera.inverse().cast<float>();
  const Eigen::Vector3f eye = camera.world_from_camera.translation().cast<float>();
  std::vector<cv::Vec2d> cosines(spread.rows);  // per row: their sum, and of how many
#pragma omp parallel for schedule(static)
  for (int j = 0; j < spread.rows; ++j) {
    for (int i = 0; i < spread.cols; ++i) {
      constexpr float kMiddle = 0.5f * (kSpreadStep - 1);
      Receiver receiver;
      if (!view.at(static_cast<float>(i * kSpreadStep) + kMiddle,
                   static_cast<float>(j * kSpreadStep) + kMiddle, receiver))
        continue;
      const float depth = (from_world * receiver.position).z(),
                  behind = 1.0f - depth * filled.at<float>(j, i);
      spread.at<float>(j, i) = 2.0f * static_cast<float>(camera.fy) * std::max(0.0f, behind);
      if (weight.at<float>(j, i) > 0.0f)
        cosines[j] += cv::Vec2d(receiver.normal.dot((eye - receiver.position).normalized()), 1.0);
    }
  }
  cv::resize(spread, whole, spread.size() * kSpreadStep, 0, 0, cv::INTER_LINEAR);
  image.spread = whole(cv::Rect({0, 0}, near.size())).clone();
  const cv::Vec2d sum = std::accumulate(cosines.begin(), cosines.end(), cv::Vec2d());
  if (sum[1] > 0.0) image.across = static_cast<float>(sum[0] / sum[1]);
}

}  // namespace

cv::Vec3f mirroredRadiance(const Appearance& appearance, const Light& light, const Look& look,
                           const SurfacePoint& point) {
  const cv::Vec3f albedo = (look.albedo ? *look.albedo : appearance.albedoAt(point))
                               .mul(look.tint.value_or(cv::Vec3f(1, 1, 1)));
  return appearance.radiance(
      albedo, diffuseShading(light, point.normal, 1.0f, point.seen, appearance.thrown_back), {});
}

MirrorImage mirrorImage(const std::vector<const Actor*>& actors, const Radiance& radiance,
                        const std::vector<SupportPlane>& planes, const Camera& camera,
                        const cv::Mat& off) {
  MirrorImage image;
  const PlaneView view(planes, camera);
  cv::Mat near = cv::Mat::zeros(camera.height, camera.width, CV_32F);
  for (const SupportPlane& plane : planes) {
    if (plane.normal.dot(camera.world_from_camera.translation()) > plane.offset)
      addPlane(actors, radiance, view, plane, camera, off, image, near);
  }
  if (!image.empty()) findSpread(view, camera, near, image);
  return image;
}

}  // namespace calipso::render
