#include "calipso_flow/object_model.hpp"

#include <cmath>
#include <stdexcept>

namespace calipso::flow {
namespace {

// A closed body encloses more than this share of its bounding cube's volume.
constexpr double kLeastVolumeShare = 1e-5;

Eigen::Vector3d surfaceCentre(const TriangleMesh& mesh) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double area = 0.0;
  for (int t = 0; t < mesh.triangleCount(); ++t) {
    const Eigen::Vector3d a = mesh.vertex(mesh.triangles(t, 0));
    const Eigen::Vector3d b = mesh.vertex(mesh.triangles(t, 1));
    const Eigen::Vector3d c = mesh.vertex(mesh.triangles(t, 2));
    const double doubled_area = (b - a).cross(c - a).norm();
    sum += doubled_area * (a + b + c) / 3.0;
    area += doubled_area;
  }
  return area > 0.0 ? Eigen::Vector3d(sum / area) : mesh.vertices.colwise().mean().transpose();
}

}  // namespace

Eigen::Vector3d centroid(const TriangleMesh& mesh) {
  if (mesh.triangleCount() == 0) {
    throw std::invalid_argument("object model: the mesh has no triangles; give a surface mesh");
  }
  if (!mesh.vertices.allFinite()) {
    throw std::invalid_argument(
        "object model: a vertex of the mesh is not finite; repair the mesh");
  }
  // Signed tetrahedra from a point near the surface: a far origin would cancel digits.
  const Eigen::Vector3d origin = surfaceCentre(mesh);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double volume = 0.0;
  for (int t = 0; t < mesh.triangleCount(); ++t) {
    const Eigen::Vector3d a = mesh.vertex(mesh.triangles(t, 0)) - origin;
    const Eigen::Vector3d b = mesh.vertex(mesh.triangles(t, 1)) - origin;
    const Eigen::Vector3d c = mesh.vertex(mesh.triangles(t, 2)) - origin;
    const double v = a.dot(b.cross(c)) / 6.0;
    sum += v * (a + b + c) / 4.0;
    volume += v;
  }
  const double cube = std::pow(boundingDiagonal(mesh), 3);
  if (std::abs(volume) <= kLeastVolumeShare * cube) return origin;
  return origin + sum / volume;
}

}  // namespace calipso::flow
