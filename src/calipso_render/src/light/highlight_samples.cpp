#include "light/highlight_samples.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"

namespace calipso::render {
namespace {

constexpr int kRim = 1;               // px of the mask's rim that are left out
constexpr float kNearMirror = 0.85f;  // cosine between normal and half vector
constexpr std::size_t kMost = 2500;

struct NormalMap {
  cv::Rect region;
  cv::Mat normals;    // CV_32FC3; 0 where the object is not seen
  cv::Mat triangles;  // CV_32SC1
};

NormalMap normalMap(const View& view, const Actor& actor, const Eigen::Vector3f& eye) {
  NormalMap map;
  map.region = boundsOf(actor.screen, 1, view.picture.size());
  map.normals = cv::Mat::zeros(map.region.size(), CV_32FC3);
  map.triangles = cv::Mat(map.region.size(), CV_32S, cv::Scalar(-1));
  const VisibilityBuffer buffer(map.region, {&actor.screen});
  for (int v = 0; v < map.region.height; ++v) {
    for (int u = 0; u < map.region.width; ++u) {
      const std::uint32_t id = buffer.ids(v)[u];
      if (id == VisibilityBuffer::kNothing) continue;
      map.triangles.at<int>(v, u) = VisibilityBuffer::triangleOf(id);
      const Eigen::Vector3f n = surfacePoint(actor, VisibilityBuffer::triangleOf(id),
                                             u + map.region.x, v + map.region.y, eye)
                                    .normal;
      map.normals.at<cv::Vec3f>(v, u) = {n.x(), n.y(), n.z()};
    }
  }
  return map;
}

// Turn of the normal across a pixel, as the deviation of a uniform spread over it.
float spreadAt(const cv::Mat& normals, int u, int v) {
  double sum = 0.0;
  int count = 0;
  const cv::Vec3f& here = normals.at<cv::Vec3f>(v, u);
  for (const cv::Point d : {cv::Point(1, 0), cv::Point(-1, 0), cv::Point(0, 1), cv::Point(0, -1)}) {
    const int x = u + d.x, y = v + d.y;
    if (x < 0 || y < 0 || x >= normals.cols || y >= normals.rows) continue;
    const cv::Vec3f& there = normals.at<cv::Vec3f>(y, x);
    if (there.dot(there) == 0.0f) continue;
    const cv::Vec3f turn = there - here;
    sum += turn.dot(turn), ++count;
  }
  return count > 0 ? static_cast<float>(std::sqrt(sum / count / 12.0)) : 0.0f;
}

int nearestCluster(const std::vector<LightSample>& samples, int picture, const Eigen::Vector3f& p) {
  float best = 1e30f;
  int cluster = -1;
  for (const LightSample& s : samples) {
    const float squared = s.picture == picture ? (s.position - p).squaredNorm() : 1e30f;
    if (squared < best) best = squared, cluster = s.cluster;
  }
  return cluster;
}

void collect(const View& view, int picture, std::size_t object, const Eigen::Vector3f& light,
             std::vector<HighlightSample>& highlights) {
  const Actor& actor = view.actors[object];
  const Eigen::Vector3f eye = view.camera.world_from_camera.translation().cast<float>();
  const NormalMap map = normalMap(view, actor, eye);
  cv::Mat inside;
  cv::erode(view.labels == actor.surface->index, inside,
            cv::Mat::ones(2 * kRim + 1, 2 * kRim + 1, CV_8U));
  for (int v = 0; v < map.region.height; ++v) {
    for (int u = 0; u < map.region.width; ++u) {
      const int triangle = map.triangles.at<int>(v, u);
      if (triangle < 0 || inside.at<std::uint8_t>(v + map.region.y, u + map.region.x) == 0)
        continue;
      const SurfacePoint s = surfacePoint(actor, triangle, u + map.region.x, v + map.region.y, eye);
      const Eigen::Vector3f towards = (eye - s.position).normalized();
      if (s.normal.dot((light + towards).normalized()) < kNearMirror || s.normal.dot(light) <= 0.0f)
        continue;
      const cv::Vec3f code = view.codeAt(v + map.region.y, u + map.region.x);
      HighlightSample h{{s.position, s.normal, towards, {}, -1, s.seen, picture},
                        spreadAt(map.normals, u, v),
                        object};
      for (int c = 0; c < 3; ++c) h.at.radiance[c] = linearFromRealCode(code[c]);
      highlights.push_back(h);
    }
  }
}

}  // namespace

std::vector<HighlightSample> highlightSamples(const std::vector<View>& views,
                                              const std::vector<bool>& moves,
                                              const std::vector<LightSample>& samples,
                                              const Eigen::Vector3f& light) {
  std::vector<HighlightSample> all, thinned;
  for (std::size_t object = 0; object < moves.size(); ++object) {
    std::vector<std::vector<HighlightSample>> of_view(moves[object] ? views.size() : 1);
#pragma omp parallel for schedule(dynamic, 1)
    for (std::size_t i = 0; i < of_view.size(); ++i)
      collect(views[i], static_cast<int>(i), object, light, of_view[i]);
    for (const std::vector<HighlightSample>& own : of_view)
      all.insert(all.end(), own.begin(), own.end());
  }
  const std::size_t step = std::max<std::size_t>(1, all.size() / kMost);
  for (std::size_t i = 0; i < all.size(); i += step) thinned.push_back(all[i]);
#pragma omp parallel for schedule(static)
  for (std::size_t i = 0; i < thinned.size(); ++i) {
    LightSample& at = thinned[i].at;
    at.cluster = nearestCluster(samples, at.picture, at.position);
  }
  thinned.erase(std::remove_if(thinned.begin(), thinned.end(),
                               [](const HighlightSample& h) { return h.at.cluster < 0; }),
                thinned.end());
  return thinned;
}

}  // namespace calipso::render
