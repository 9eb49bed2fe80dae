#include "place/place_relief.hpp"

namespace calipso::render {

PicturePlane inPicture(const SupportPlane& plane, const Camera& camera) {
  const Eigen::Isometry3d& from_camera = camera.world_from_camera;
  const Eigen::Vector3d n = from_camera.linear().transpose() * plane.normal /
                            (plane.offset - plane.normal.dot(from_camera.translation()));
  return {{n.x() / camera.fx, n.y() / camera.fy,
           n.z() - n.x() * camera.cx / camera.fx - n.y() * camera.cy / camera.fy}};
}

Eigen::Vector3f PicturePlane::normal(const Camera& camera) const {
  const Eigen::Vector3d m(abc[0] * camera.fx, abc[1] * camera.fy,
                          abc[2] + abc[0] * camera.cx + abc[1] * camera.cy);
  return (camera.world_from_camera.linear() * -m.normalized()).cast<float>();
}

cv::Matx33d PicturePlane::fromPixels(const Camera& camera) const {
  const Eigen::Vector3d n(abc[0] * camera.fx, abc[1] * camera.fy,
                          abc[2] + abc[0] * camera.cx + abc[1] * camera.cy);
  const Eigen::Vector3d along = n.unitOrthogonal(), across = n.normalized().cross(along);
  cv::Matx33d H;
  for (int i = 0; i < 2; ++i) {
    const Eigen::Vector3d& e = i == 0 ? along : across;
    H(i, 0) = e.x() / camera.fx, H(i, 1) = e.y() / camera.fy;
    H(i, 2) = e.z() - e.x() * camera.cx / camera.fx - e.y() * camera.cy / camera.fy;
  }
  for (int j = 0; j < 3; ++j) H(2, j) = abc[j];
  return H;
}

std::vector<PicturePlane> inPicture(const std::vector<SupportPlane>& planes, const Camera& camera) {
  std::vector<PicturePlane> endless;
  for (const SupportPlane& plane : planes) {
    if (!plane.x_range) endless.push_back(inPicture(plane, camera));
  }
  return endless;
}

}  // namespace calipso::render
