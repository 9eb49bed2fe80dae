#pragma once

#include <cmath>

#include "calipso_align/contour.hpp"
#include "calipso_align/low_order_map.hpp"
#include "calipso_align/silhouette.hpp"

// A shape without symmetry, a camera that looks at it, and its contour as a picture would show it.
namespace calipso::align::test {

// A closed pear of about a metre, bent and with a bump on one side. #V = 2 + rings * segments.
inline TriangleMesh pear(int rings = 18, int segments = 24) {
  TriangleMesh mesh;
  mesh.vertices.resize(2 + rings * segments, 3);
  mesh.vertices.row(0) << 0.0, 0.0, -0.5;
  mesh.vertices.row(1) << 0.12, 0.0, 0.5;
  for (int i = 0; i < rings; ++i) {
    const double polar = M_PI * (i + 1) / (rings + 1), z = -0.5 * std::cos(polar);
    for (int j = 0; j < segments; ++j) {
      const double turn = 2.0 * M_PI * j / segments;
      const double radius =
          (0.28 - 0.16 * z) * std::sin(polar) * (1.0 + 0.25 * std::cos(turn - 1.0));
      mesh.vertices.row(2 + i * segments + j)
          << radius * std::cos(turn) + 0.12 * (z + 0.5) * (z + 0.5),
          radius * std::sin(turn), z;
    }
  }
  std::vector<Eigen::RowVector3i> faces;
  const auto at = [&](int i, int j) { return 2 + i * segments + (j % segments); };
  for (int j = 0; j < segments; ++j) {
    faces.emplace_back(0, at(0, j + 1), at(0, j));
    faces.emplace_back(1, at(rings - 1, j), at(rings - 1, j + 1));
    for (int i = 0; i + 1 < rings; ++i) {
      faces.emplace_back(at(i, j), at(i, j + 1), at(i + 1, j + 1));
      faces.emplace_back(at(i, j), at(i + 1, j + 1), at(i + 1, j));
    }
  }
  mesh.triangles.resize(static_cast<int>(faces.size()), 3);
  for (size_t f = 0; f < faces.size(); ++f) mesh.triangles.row(static_cast<int>(f)) = faces[f];
  return mesh;
}

// A box about the origin.
inline TriangleMesh box(const Eigen::Vector3d& half) {
  TriangleMesh mesh;
  mesh.vertices.resize(8, 3);
  for (int i = 0; i < 8; ++i)
    for (int k = 0; k < 3; ++k) mesh.vertices(i, k) = (i >> k) % 2 ? half[k] : -half[k];
  mesh.triangles.resize(12, 3);
  mesh.triangles << 0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,  //
      2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5;
  return mesh;
}

// What the camera below sees of a mesh, wound the other way round.
inline TriangleMesh frontInsideOut(const TriangleMesh& mesh) {
  TriangleMesh front = mesh;
  int faces = 0;
  for (int f = 0; f < mesh.triangleCount(); ++f) {
    const Eigen::RowVector3i t = mesh.triangles.row(f);
    const Eigen::Vector3d a = mesh.vertex(t[0]), b = mesh.vertex(t[1]), c = mesh.vertex(t[2]);
    if ((b - a).cross(c - a).y() < 0.0) front.triangles.row(faces++) << t[0], t[2], t[1];
  }
  front.triangles.conservativeResize(faces, 3);
  return front;
}

// A square plate of so many metres to either side of its middle, with a square hole of 0.2, 2 m in
// front of a camera at its own origin.
struct PlateWithHole {
  Points x{8, 3};
  Triangles triangles{8, 3};

  explicit PlateWithHole(double half) {
    for (int k = 0; k < 4; ++k) {
      const double u = k == 0 || k == 3 ? -1 : 1, v = k < 2 ? -1 : 1;
      x.row(k) << half * u, half * v, 2.0;
      x.row(4 + k) << 0.2 * u, 0.2 * v, 2.0;
      const int next = (k + 1) % 4;
      triangles.row(2 * k) << k, 4 + k, next;
      triangles.row(2 * k + 1) << next, 4 + k, 4 + next;
    }
  }
};

// Of every kind of deformation a little.
inline LowOrderMap::Parameters someParameters() {
  LowOrderMap::Parameters p;
  for (int i = 0; i < p.size(); ++i) p[i] = 0.1 * std::sin(1.7 * i + 0.4);
  return p;
}

// 3 m in front of the origin, looking along world y; z up.
inline Camera frontCamera() {
  Camera camera;
  camera.width = 320;
  camera.height = 240;
  camera.fx = camera.fy = 500.0;
  camera.cx = 159.5;
  camera.cy = 119.5;
  camera.world_from_camera.linear() << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  camera.world_from_camera.translation() << 0.0, -3.0, 0.0;
  return camera;
}

inline Points inCamera(const Camera& camera, const Eigen::Isometry3d& pose, const Points& points) {
  return transformed(camera.world_from_camera.inverse() * pose, points);
}

// The contour of a mesh at a pose, traced around the rendered pixels.
inline std::vector<ContourLoop> contourOf(const TriangleMesh& mesh, const Eigen::Isometry3d& pose,
                                          const Camera& camera) {
  const Points x = inCamera(camera, pose, mesh.vertices);
  const cv::Mat1b mask = maskOf(renderDepth(x, mesh.triangles, camera), camera);
  return traceLoops(mask / 255, 1, {});
}

// Turned about the vertical and moved across the sight line.
inline Eigen::Isometry3d roughPose() {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = Eigen::AngleAxisd(0.1, Eigen::Vector3d(0.3, 0.5, 0.8).normalized()).matrix();
  pose.translation() << 0.08, 0.0, -0.06;
  return pose;
}

}  // namespace calipso::align::test
