#include "calipso_fem/world/region_selection.hpp"

#include <numeric>
#include <sstream>
#include <stdexcept>

namespace calipso::fem {
namespace {

// Moeller, Trumbore 1997: parameter of the hit along the ray.
std::optional<double> intersect(const Eigen::Vector3d& o, const Eigen::Vector3d& d,
                                const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                const Eigen::Vector3d& c) {
  const Eigen::Vector3d e1 = b - a, e2 = c - a, p = d.cross(e2);
  const double det = e1.dot(p);
  if (det == 0.0) return std::nullopt;
  const Eigen::Vector3d s = o - a, q = s.cross(e1);
  const double u = s.dot(p) / det, v = d.dot(q) / det, t = e2.dot(q) / det;
  if (u < 0.0 || v < 0.0 || u + v > 1.0 || t <= 0.0) return std::nullopt;
  return t;
}

std::vector<int> verticesIn(const WorldObject& object, const Eigen::AlignedBox3d& box) {
  std::vector<int> chosen;
  for (int i = 0; i < object.mesh.vertexCount(); ++i)
    if (box.contains(object.world_from_object * object.mesh.vertex(i))) chosen.push_back(i);
  return chosen;
}

std::vector<int> verticesNear(const WorldObject& object, const Eigen::Vector3d& point,
                              double radius) {
  std::vector<int> chosen;
  for (int i = 0; i < object.mesh.vertexCount(); ++i)
    if ((object.world_from_object * object.mesh.vertex(i) - point).norm() <= radius)
      chosen.push_back(i);
  return chosen;
}

std::vector<int> verticesUnderPixel(const WorldScene& scene, int index, const Region& region,
                                    double radius) {
  const WorldObject& object = scene.objects[index];
  const auto hit = castRay(scene, scene.camera.world_from_camera.translation(),
                           scene.camera.world_from_camera.linear() *
                               scene.camera.ray(region.pixel.x(), region.pixel.y()),
                           index);
  std::ostringstream where;
  where << "pixel (" << region.pixel.x() << ", " << region.pixel.y() << ")";
  if (!hit)
    throw std::invalid_argument(where.str() + " shows no object; choose one on " + object.name);
  if (hit->object != index)
    throw std::invalid_argument(where.str() + " shows " + scene.objects[hit->object].name +
                                "; choose one where " + object.name + " is visible");
  std::vector<int> chosen = verticesNear(object, hit->point, radius);
  if (chosen.empty())  // a mesh coarser than the radius: the triangle that was hit
    for (int k = 0; k < 3; ++k) chosen.push_back(object.mesh.triangles(hit->triangle, k));
  return chosen;
}

}  // namespace

std::optional<RayHit> castRay(const WorldScene& scene, const Eigen::Vector3d& origin,
                              const Eigen::Vector3d& direction, int besides) {
  std::optional<RayHit> nearest;
  for (size_t k = 0; k < scene.objects.size(); ++k) {
    if (!scene.objects[k].in_video && static_cast<int>(k) != besides) continue;
    const TriangleMesh& mesh = scene.objects[k].mesh;
    const Eigen::Isometry3d object_from_world = scene.objects[k].world_from_object.inverse();
    const Eigen::Vector3d o = object_from_world * origin,
                          d = object_from_world.linear() * direction;
    for (int f = 0; f < mesh.triangleCount(); ++f) {
      const auto t =
          intersect(o, d, mesh.vertex(mesh.triangles(f, 0)), mesh.vertex(mesh.triangles(f, 1)),
                    mesh.vertex(mesh.triangles(f, 2)));
      if (t && (!nearest || *t < nearest->depth))
        nearest = RayHit{static_cast<int>(k), f, *t, origin + *t * direction};
    }
  }
  return nearest;
}

std::vector<int> selectVertices(const WorldScene& scene, int index, const Region& region) {
  const WorldObject& object = scene.objects[index];
  const double radius = region.radius > 0.0 ? region.radius : 0.1 * boundingDiagonal(object.mesh);
  std::vector<int> chosen;
  switch (region.kind) {
    case RegionKind::kAll:
      chosen.resize(object.mesh.vertexCount());
      std::iota(chosen.begin(), chosen.end(), 0);
      break;
    case RegionKind::kPixel:
      chosen = verticesUnderPixel(scene, index, region, radius);
      break;
    case RegionKind::kSphere:
      chosen = verticesNear(object, region.point, radius);
      break;
    case RegionKind::kBox:
      chosen = verticesIn(object, {region.box_min, region.box_max});
      break;
  }
  if (chosen.empty()) {
    std::ostringstream message;
    message << "region '" << toString(region.kind) << "' (radius " << radius
            << " m) holds no surface vertex of " << object.name << "; move or enlarge it";
    throw std::invalid_argument(message.str());
  }
  return chosen;
}

}  // namespace calipso::fem
