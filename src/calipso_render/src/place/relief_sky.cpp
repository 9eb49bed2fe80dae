#include "place/relief_sky.hpp"

#include <algorithm>

namespace calipso::render {
namespace {

constexpr float kNear = 0.5f;  // radii of an object up to which it hides some of a wall's sky

struct Ball {
  Eigen::Vector3f centre;
  float radius;
};

Ball around(const Points& vertices) {
  Eigen::AlignedBox3f box;
  for (const Eigen::Vector3f& p : vertices) box.extend(p);
  return {box.center(), 0.5f * box.diagonal().norm()};
}

bool isNear(const Ball& ball, const Relief::Wall& wall) {
  return !wall.box.isEmpty() &&
         wall.box.exteriorDistance(ball.centre) < (1.0f + kNear) * ball.radius;
}

}  // namespace

ReliefSky::ReliefSky(const Relief& relief, const std::vector<Occluder>& occluders, int resolution) {
  std::vector<Ball> balls;
  for (const Occluder& o : occluders) balls.push_back(around(*o.vertices));
  for (const Relief::Wall& wall : relief.walls) {
    std::vector<Occluder> near;
    double farthest = 0.0;
    for (std::size_t i = 0; i < occluders.size(); ++i) {
      if (occluders[i].vertices->empty() || !isNear(balls[i], wall)) continue;
      near.push_back(occluders[i]);
      farthest = std::max<double>(farthest, kNear * balls[i].radius);
    }
    over_.push_back(nullptr);
    if (near.empty()) continue;
    over_.back() = std::make_unique<const SkyMap>(near, wall.normal.cast<double>(),
                                                  SkyMap::Params{resolution, kSkyRadius, farthest});
    relief_ = &relief;
  }
}

float ReliefSky::at(int u, int v) const {
  if (empty() || !relief_->at(u, v)) return 1.0f;
  const int wall = relief_->wall.at<std::uint8_t>(v, u);
  if (wall == 0 || !over_[wall - 1]) return 1.0f;
  const Receiver r = relief_->receiver(u, v);
  return over_[wall - 1]->visibility(r.position, r.normal);
}

cv::Mat ReliefSky::visibility(const cv::Size& size) const {
  cv::Mat visible(size, CV_32F, cv::Scalar(1.0f));
#pragma omp parallel for schedule(dynamic, 8)
  for (int v = 0; v < size.height; ++v) {
    for (int u = 0; u < size.width; ++u) visible.at<float>(v, u) = at(u, v);
  }
  return visible;
}

}  // namespace calipso::render
