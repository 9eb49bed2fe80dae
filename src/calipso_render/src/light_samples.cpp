#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "calipso_render/light_fit.hpp"

namespace calipso::render {
namespace {

constexpr int kPerObject = 1500;       // samples at most
constexpr int kRim = 3;                // px of the mask's rim that are left out
constexpr float kSaturated = 250.0f;   // code value
constexpr int kClustersPerObject = 4;

struct Pixel {
  int u, v;
};

// Pixels well inside the object's mask that its surface covers, thinned evenly.
std::vector<Pixel> usablePixels(const VisibilityBuffer& buffer, const cv::Mat& picture, const cv::Mat& inside) {
  std::vector<Pixel> pixels;
  const cv::Rect& r = buffer.region();
  for (int v = 0; v < r.height; ++v) {
    for (int u = 0; u < r.width; ++u) {
      if (buffer.ids(v)[u] == VisibilityBuffer::kNothing || inside.at<std::uint8_t>(v + r.y, u + r.x) == 0) continue;
      const cv::Vec3f& x = picture.at<cv::Vec3f>(v + r.y, u + r.x);
      if (std::max({x[0], x[1], x[2]}) < kSaturated) pixels.push_back({u + r.x, v + r.y});
    }
  }
  const std::size_t step = std::max<std::size_t>(1, pixels.size() / kPerObject);
  std::vector<Pixel> thinned;
  for (std::size_t i = 0; i < pixels.size(); i += step) thinned.push_back(pixels[i]);
  return thinned;
}

// Colour without brightness, which shading changes.
cv::Vec2f chromaticity(const cv::Vec3f& radiance) {
  const float sum = radiance[0] + radiance[1] + radiance[2] + 0.01f;
  return {radiance[0] / sum, radiance[2] / sum};
}

// Cluster of each sample, 0-based; returns how many there are.
int clusterByColour(std::vector<LightSample>& samples, std::size_t first, int base) {
  const int count = static_cast<int>(samples.size() - first);
  if (count < 8 * kClustersPerObject) return count > 0 ? 1 : 0;
  cv::Mat points(count, 1, CV_32FC2), labels;
  for (int i = 0; i < count; ++i) points.at<cv::Vec2f>(i) = chromaticity(samples[first + i].radiance);
  cv::theRNG().state = 1;  // k-means draws its starts from the shared generator
  cv::kmeans(points, kClustersPerObject, labels, {cv::TermCriteria::MAX_ITER | cv::TermCriteria::EPS, 20, 1e-4}, 2,
             cv::KMEANS_PP_CENTERS);
  for (int i = 0; i < count; ++i) samples[first + i].cluster = base + labels.at<int>(i);
  return kClustersPerObject;
}

}  // namespace

std::vector<LightSample> lightSamples(const std::vector<Actor>& actors, const cv::Mat& picture, const cv::Mat& labels,
                                      const Camera& camera, int& clusters) {
  const Eigen::Vector3f eye = camera.world_from_camera.translation().cast<float>();
  std::vector<LightSample> samples;
  clusters = 0;
  for (const Actor& actor : actors) {
    VisibilityBuffer buffer(boundsOf(actor.screen, 0, picture.size()));
    buffer.draw(actor.screen, 0);
    cv::Mat inside;
    cv::erode(labels == actor.surface->index, inside, cv::Mat::ones(2 * kRim + 1, 2 * kRim + 1, CV_8U));
    const std::size_t first = samples.size();
    for (const Pixel& p : usablePixels(buffer, picture, inside)) {
      const int triangle = VisibilityBuffer::triangleOf(buffer.idAt(p.u, p.v));
      const SurfacePoint s = surfacePoint(actor, triangle, p.u, p.v, eye);
      const cv::Vec3f& code = picture.at<cv::Vec3f>(p.v, p.u);
      LightSample sample{s.position, s.normal, (eye - s.position).normalized(), {}, clusters};
      for (int c = 0; c < 3; ++c) sample.radiance[c] = linearFromRealCode(code[c]);
      samples.push_back(sample);
    }
    clusters += clusterByColour(samples, first, clusters);
  }
  return samples;
}

}  // namespace calipso::render
