#pragma once

#include <Eigen/Geometry>

namespace calipso {

// Pinhole camera without distortion. Camera frame: x right, y down, z forward (REP 103 optical).
// Pixels are u (column), v (row); pixel centres at integer coordinates, as in OpenCV.
struct Camera {
  int width = 0;                                  // px
  int height = 0;                                 // px
  double fx = 0.0, fy = 0.0, cx = 0.0, cy = 0.0;  // px
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();

  // Pixel of a point in the camera frame. @pre p_camera.z() > 0
  Eigen::Vector2d project(const Eigen::Vector3d& p_camera) const {
    return {fx * p_camera.x() / p_camera.z() + cx, fy * p_camera.y() / p_camera.z() + cy};
  }

  // Pixel of a point in the world. @pre the point lies in front of the camera
  Eigen::Vector2d projectWorld(const Eigen::Vector3d& p_world) const {
    return project(world_from_camera.inverse() * p_world);
  }

  // Direction of pixel (u, v)'s sight line in the camera frame, scaled to z = 1.
  Eigen::Vector3d ray(double u, double v) const { return {(u - cx) / fx, (v - cy) / fy, 1.0}; }

  // 2 x 3 derivative of project() at p_camera.
  Eigen::Matrix<double, 2, 3> projectJacobian(const Eigen::Vector3d& p_camera) const {
    const double iz = 1.0 / p_camera.z();
    Eigen::Matrix<double, 2, 3> d;
    d << fx * iz, 0.0, -fx * p_camera.x() * iz * iz, 0.0, fy * iz, -fy * p_camera.y() * iz * iz;
    return d;
  }
};

}  // namespace calipso
