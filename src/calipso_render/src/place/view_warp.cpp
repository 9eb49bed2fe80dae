#include "place/view_warp.hpp"

namespace calipso::render {

bool sameView(const Camera& a, const Camera& b) {
  const bool lens = a.fx == b.fx && a.fy == b.fy && a.cx == b.cx && a.cy == b.cy &&
                    a.width == b.width && a.height == b.height;
  return lens && a.world_from_camera.isApprox(b.world_from_camera, 1e-9);
}

cv::Mat viewWarp(const cv::Mat& nearness, const Camera& from, const Camera& to) {
  const Eigen::Isometry3d way = from.world_from_camera.inverse() * to.world_from_camera;
  cv::Mat map(to.height, to.width, CV_32FC2);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < to.height; ++v) {
    for (int u = 0; u < to.width; ++u) {
      const Eigen::Vector3d p =
          way.linear() * to.ray(u, v) + nearness.at<float>(v, u) * way.translation();
      const Eigen::Vector2d q = p.z() > 1e-9 ? from.project(p) : Eigen::Vector2d(-1e4, -1e4);
      map.at<cv::Vec2f>(v, u) = cv::Vec2f(static_cast<float>(q.x()), static_cast<float>(q.y()));
    }
  }
  return map;
}

}  // namespace calipso::render
