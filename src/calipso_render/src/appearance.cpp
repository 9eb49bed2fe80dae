#include "calipso_render/appearance.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "calipso_render/inpaint.hpp"

namespace calipso::render {
namespace {

constexpr float kMatt = 0.25f;  // part of a pixel's light that is never taken for a highlight
constexpr int kMargin = 12;  // px around the object that albedo is extended by

// Trust in a pixel as a picture of the object alone, by distance from the mask's rim (px): the first
// pixels mix with the background and with what compression spreads.
float rimTrust(float depth) {
  if (depth <= 1.0f) return 0.02f;
  return std::clamp((depth - 1.0f) / 1.5f, 0.05f, 1.0f);
}

cv::Mat trustOf(const cv::Mat& labels, int index) {
  cv::Mat padded, depth;
  cv::copyMakeBorder(labels == index, padded, 1, 1, 1, 1, cv::BORDER_REPLICATE);
  cv::distanceTransform(padded, depth, cv::DIST_L2, 5);
  depth = depth(cv::Rect(1, 1, labels.cols, labels.rows));
  cv::Mat trust = cv::Mat::zeros(labels.size(), CV_32F);
  for (int v = 0; v < labels.rows; ++v) {
    for (int u = 0; u < labels.cols; ++u) {
      const float d = depth.at<float>(v, u);
      if (d > 0.0f) trust.at<float>(v, u) = rimTrust(d);
    }
  }
  return trust;
}

struct Shaded {
  cv::Mat highlight;  // CV_32FC3: specular radiance
  cv::Mat light;     // CV_32FC3: shading of a white surface; 0 where the object is not seen
  cv::Mat nearness;  // CV_32FC1
  cv::Vec3f mean;
};

// Light on one actor's visible surface, pixel by pixel.
Shaded shade(const Actor& actor, const cv::Rect& region, const Camera& camera, const Light& light, const Gloss& gloss,
             const ShadowMap& sun) {
  Shaded s{cv::Mat::zeros(region.size(), CV_32FC3), cv::Mat::zeros(region.size(), CV_32FC3), cv::Mat::zeros(region.size(), CV_32F), {}};
  VisibilityBuffer buffer(region);
  buffer.draw(actor.screen, 0);
  const Eigen::Vector3f eye = camera.world_from_camera.translation().cast<float>();
  std::vector<cv::Vec3d> sums(region.height);
  std::vector<int> counts(region.height, 0);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < region.height; ++v) {
    for (int u = 0; u < region.width; ++u) {
      const std::uint32_t id = buffer.ids(v)[u];
      if (id == VisibilityBuffer::kNothing) continue;
      const SurfacePoint p = surfacePoint(actor, VisibilityBuffer::triangleOf(id), u + region.x, v + region.y, eye);
      const float visible = sun.visibility(p.position, p.normal);
      const cv::Vec3f l = diffuseShading(light, p.normal, visible, p.sky);
      s.light.at<cv::Vec3f>(v, u) = l;
      s.highlight.at<cv::Vec3f>(v, u) = specularShading(light, gloss, p.normal, (eye - p.position).normalized(), visible, p.sky);
      s.nearness.at<float>(v, u) = buffer.nearness(v)[u];
      sums[v] += cv::Vec3d(l), ++counts[v];
    }
  }
  cv::Vec3d sum;
  int count = 0;
  for (int v = 0; v < region.height; ++v) sum += sums[v], count += counts[v];
  s.mean = count > 0 ? cv::Vec3f(sum / count) : cv::Vec3f(1, 1, 1);
  return s;
}

Appearance makeAppearance(const Actor& actor, const cv::Mat& picture, const cv::Mat& labels, const Camera& camera,
                          const Light& light, const Gloss& gloss, const ShadowMap& sun) {
  Appearance a;
  a.gloss = gloss;
  a.key_camera = camera;
  const cv::Rect all(0, 0, picture.cols, picture.rows);
  cv::Rect mask_box = cv::boundingRect(labels == actor.surface->index);
  mask_box = mask_box.empty() ? mask_box : (mask_box + cv::Size(2 * kMargin, 2 * kMargin) - cv::Point(kMargin, kMargin)) & all;
  a.region = boundsOf(actor.screen, kMargin, picture.size()) | mask_box;
  if (a.region.empty()) a.region = cv::Rect(0, 0, 1, 1);
  const Shaded shaded = shade(actor, a.region, camera, light, gloss, sun);
  a.key_nearness = shaded.nearness;
  a.mean_light = shaded.mean;
  const cv::Vec3f floor = lightFloor(a.mean_light);
  cv::Mat trust = trustOf(labels, actor.surface->index)(a.region).clone();
  cv::Mat albedo(a.region.size(), CV_32FC3, cv::Scalar::all(0));
  for (int v = 0; v < a.region.height; ++v) {
    for (int u = 0; u < a.region.width; ++u) {
      if (shaded.nearness.at<float>(v, u) == 0.0f) trust.at<float>(v, u) = 0.0f;
      const cv::Vec3f code = picture.at<cv::Vec3f>(v + a.region.y, u + a.region.x);
      cv::Vec3f l = shaded.light.at<cv::Vec3f>(v, u);
      if (shaded.nearness.at<float>(v, u) == 0.0f) l = a.mean_light;
      const cv::Vec3f highlight = shaded.highlight.at<cv::Vec3f>(v, u);
      for (int c = 0; c < 3; ++c) {
        const float i = linearFromRealCode(code[c]);
        albedo.at<cv::Vec3f>(v, u)[c] = std::max(i - highlight[c], kMatt * i) / (l[c] + floor[c]);
      }
    }
  }
  a.albedo = pushPull(albedo, trust);
  return a;
}

}  // namespace

std::vector<Appearance> makeAppearances(const std::vector<Actor>& key, const cv::Mat& picture, const cv::Mat& labels,
                                        const Camera& camera, const Light& light, const Gloss& gloss,
                                        const ShadowMap& sun) {
  std::vector<Appearance> appearances;
  for (const Actor& actor : key) appearances.push_back(makeAppearance(actor, picture, labels, camera, light, gloss, sun));
  return appearances;
}

cv::Vec3f Appearance::albedoAt(const Eigen::Vector3f& key_position) const {
  const Eigen::Vector2d q = key_camera.projectWorld(key_position.cast<double>());
  return sampleBicubic(albedo, static_cast<float>(q.x()) - region.x, static_cast<float>(q.y()) - region.y);
}

cv::Vec3f Appearance::radiance(const SurfacePoint& point, const cv::Vec3f& now, const cv::Vec3f& highlight) const {
  return albedoAt(point.key_position).mul(now + lightFloor(mean_light)) + highlight;
}

cv::Vec3f sampleBicubic(const cv::Mat& image, float u, float v) {
  const float fu = std::floor(u), fv = std::floor(v);
  const float x = u - fu, y = v - fv;
  const auto weights = [](float t, float* w) {
    const float t2 = t * t, t3 = t2 * t;
    w[0] = 0.5f * (-t + 2.0f * t2 - t3);
    w[1] = 0.5f * (2.0f - 5.0f * t2 + 3.0f * t3);
    w[2] = 0.5f * (t + 4.0f * t2 - 3.0f * t3);
    w[3] = 0.5f * (t3 - t2);
  };
  float wx[4], wy[4];
  weights(x, wx), weights(y, wy);
  const auto clampTo = [](float f, int limit) { return static_cast<int>(std::clamp(f, -8.0f, limit + 8.0f)); };
  const int i = clampTo(fu, image.cols), j = clampTo(fv, image.rows);
  cv::Vec3f sum;
  for (int b = 0; b < 4; ++b) {
    const cv::Vec3f* row = image.ptr<cv::Vec3f>(std::clamp(j - 1 + b, 0, image.rows - 1));
    cv::Vec3f line;
    for (int a = 0; a < 4; ++a) line += wx[a] * row[std::clamp(i - 1 + a, 0, image.cols - 1)];
    sum += wy[b] * line;
  }
  for (int c = 0; c < 3; ++c) sum[c] = std::max(sum[c], 0.0f);
  return sum;
}

}  // namespace calipso::render
