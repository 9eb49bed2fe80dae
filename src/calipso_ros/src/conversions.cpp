#include "calipso_ros/conversions.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace calipso {

namespace {

template <typename Translation, typename Rotation>
Eigen::Isometry3d poseOf(const Translation& t, const Rotation& r) {
  const Eigen::Quaterniond q(r.w, r.x, r.y, r.z);
  const Eigen::Vector3d translation(t.x, t.y, t.z);
  if (!q.coeffs().allFinite() || !translation.allFinite() || q.norm() < 1e-6) {
    throw std::invalid_argument(
        "a pose is not finite or its quaternion is zero; set w = 1 for none");
  }
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = q.normalized().toRotationMatrix();
  pose.translation() = translation;
  return pose;
}

template <typename Quaternion>
void setRotation(Quaternion& msg, const Eigen::Matrix3d& rotation) {
  const Eigen::Quaterniond q(rotation);
  msg.x = q.x();
  msg.y = q.y();
  msg.z = q.z();
  msg.w = q.w();
}

}  // namespace

std::int64_t nanoseconds(const ros::Time& stamp) {
  return static_cast<std::int64_t>(stamp.toNSec());
}

geometry_msgs::Point toPointMsg(const Eigen::Vector3d& p) {
  geometry_msgs::Point msg;
  msg.x = p.x();
  msg.y = p.y();
  msg.z = p.z();
  return msg;
}

geometry_msgs::Vector3 toVectorMsg(const Eigen::Vector3d& v) {
  geometry_msgs::Vector3 msg;
  msg.x = v.x();
  msg.y = v.y();
  msg.z = v.z();
  return msg;
}

Eigen::Vector3d fromMsg(const geometry_msgs::Point& p) { return {p.x, p.y, p.z}; }
Eigen::Vector3d fromMsg(const geometry_msgs::Vector3& v) { return {v.x, v.y, v.z}; }

geometry_msgs::Pose toMsg(const Eigen::Isometry3d& pose) {
  geometry_msgs::Pose msg;
  msg.position = toPointMsg(pose.translation());
  setRotation(msg.orientation, pose.linear());
  return msg;
}

geometry_msgs::Transform toTransformMsg(const Eigen::Isometry3d& pose) {
  geometry_msgs::Transform msg;
  msg.translation = toVectorMsg(pose.translation());
  setRotation(msg.rotation, pose.linear());
  return msg;
}

Eigen::Isometry3d fromMsg(const geometry_msgs::Pose& pose) {
  return poseOf(pose.position, pose.orientation);
}

Eigen::Isometry3d fromMsg(const geometry_msgs::Transform& transform) {
  return poseOf(transform.translation, transform.rotation);
}

calipso_msgs::Mesh toMsg(const TriangleMesh& mesh) {
  calipso_msgs::Mesh msg;
  msg.vertices.assign(mesh.vertices.data(), mesh.vertices.data() + mesh.vertices.size());
  msg.triangles.assign(mesh.triangles.data(), mesh.triangles.data() + mesh.triangles.size());
  return msg;
}

TriangleMesh fromMsg(const calipso_msgs::Mesh& msg) {
  if (msg.vertices.size() % 3 != 0 || msg.triangles.size() % 3 != 0) {
    throw std::invalid_argument("a mesh's vertices or triangles are not a multiple of 3 numbers");
  }
  TriangleMesh mesh;
  mesh.vertices.resize(static_cast<Eigen::Index>(msg.vertices.size() / 3), 3);
  mesh.triangles.resize(static_cast<Eigen::Index>(msg.triangles.size() / 3), 3);
  std::copy(msg.vertices.begin(), msg.vertices.end(), mesh.vertices.data());
  for (std::size_t i = 0; i < msg.triangles.size(); ++i) {
    if (msg.triangles[i] >= msg.vertices.size() / 3) {
      throw std::invalid_argument("triangle " + std::to_string(i / 3) + " has index " +
                                  std::to_string(msg.triangles[i]) + ", but there are " +
                                  std::to_string(msg.vertices.size() / 3) + " vertices");
    }
    mesh.triangles.data()[i] = static_cast<int>(msg.triangles[i]);
  }
  return mesh;
}

sensor_msgs::CameraInfo toMsg(const Camera& camera) {
  sensor_msgs::CameraInfo info;
  info.width = static_cast<unsigned>(camera.width);
  info.height = static_cast<unsigned>(camera.height);
  info.distortion_model = "plumb_bob";
  info.D.assign(5, 0.0);
  info.K = {camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0};
  info.R = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
  info.P = {camera.fx, 0.0, camera.cx, 0.0, 0.0, camera.fy, camera.cy, 0.0, 0.0, 0.0, 1.0, 0.0};
  return info;
}

sensor_msgs::CameraInfo infoOfTopic(const std::string& image_topic, sensor_msgs::CameraInfo info) {
  if (image_topic.find("image_rect") == std::string::npos) return info;
  for (std::size_t i = 0; i < 9; ++i) info.K[i] = info.P[i + i / 3];
  info.D.assign(info.D.size(), 0.0);
  info.R = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
  return info;
}

Camera fromMsg(const sensor_msgs::CameraInfo& info, const Eigen::Isometry3d& world_from_camera) {
  const auto distorted =
      std::find_if(info.D.begin(), info.D.end(), [](double d) { return d != 0.0; });
  if (distorted != info.D.end()) {
    throw std::invalid_argument("camera_info has distortion (D has " + std::to_string(*distorted) +
                                "); undistort the images first (image_proc)");
  }
  const auto given = [](double value) { return std::to_string(value) + ", "; };
  const bool finite =
      std::all_of(info.K.begin(), info.K.end(), [](double k) { return std::isfinite(k); });
  if (!finite || info.K[0] <= 0.0 || info.K[4] <= 0.0 || info.width == 0 || info.height == 0) {
    throw std::invalid_argument("camera_info has fx, fy, cx, cy = " + given(info.K[0]) +
                                given(info.K[4]) + given(info.K[2]) + given(info.K[5]) + "size " +
                                std::to_string(info.width) + "x" + std::to_string(info.height) +
                                "; fx, fy and size must be > 0, all finite: calibrate the camera");
  }
  Camera camera;
  camera.width = static_cast<int>(info.width);
  camera.height = static_cast<int>(info.height);
  camera.fx = info.K[0];
  camera.fy = info.K[4];
  camera.cx = info.K[2];
  camera.cy = info.K[5];
  camera.world_from_camera = world_from_camera;
  return camera;
}

}  // namespace calipso
