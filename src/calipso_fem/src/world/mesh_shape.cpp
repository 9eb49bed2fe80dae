#include "mesh_shape.hpp"

#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>
#include <BulletCollision/CollisionShapes/btTriangleShape.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace calipso::fem {
namespace {

using Corner = std::array<double, 3>;  // position, m: parts of a mesh may repeat it
struct Side {
  std::pair<Corner, Corner> edge;  // smaller first
  int triangle, k;                 // from its corner k to the next
};

Eigen::Vector3d cornerOf(const TriangleMesh& mesh, int f, int k) {
  return mesh.vertex(mesh.triangles(f, k % 3));
}

// The triangles' sides, those of one edge behind each other.
std::vector<Side> sortedSides(const TriangleMesh& mesh) {
  std::vector<Side> sides;
  sides.reserve(3 * mesh.triangleCount());
  for (int f = 0; f < mesh.triangleCount(); ++f)
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d a = cornerOf(mesh, f, k), b = cornerOf(mesh, f, k + 1);
      sides.push_back(
          {std::minmax(Corner{a.x(), a.y(), a.z()}, Corner{b.x(), b.y(), b.z()}), f, k});
    }
  std::sort(sides.begin(), sides.end(),
            [](const Side& a, const Side& b) { return a.edge < b.edge; });
  return sides;
}

// By how much the surface bends from triangle f, over its edge k, to a corner of the next one, rad.
double bendTo(const TriangleMesh& mesh, int f, int k, const Eigen::Vector3d& next) {
  const Eigen::Vector3d start = cornerOf(mesh, f, k), edge = cornerOf(mesh, f, k + 1) - start,
                        normal = edge.cross(cornerOf(mesh, f, k + 2) - start).normalized(),
                        ahead = edge.cross(normal).normalized();
  return std::atan2(-normal.dot(next - start), ahead.dot(next - start));
}

btScalar distanceToEdge(const btVector3& point, const btVector3& a, const btVector3& b) {
  const btVector3 edge = b - a;
  const btScalar along = std::clamp(edge.dot(point - a) / edge.length2(), 0.0, 1.0);
  return (point - a - along * edge).length();
}

// On which side of a plane most of a convex shape is: 1 or -1.
double sideOf(const btCollisionObjectWrapper& convex, const btVector3& on_plane,
              const btVector3& normal) {
  btVector3 center;
  btScalar radius;
  convex.getCollisionShape()->getBoundingSphere(center, radius);
  return normal.dot(convex.getWorldTransform() * center - on_plane) < 0.0 ? -1.0 : 1.0;
}

bool adjustContact(btManifoldPoint& point, const btCollisionObjectWrapper* a, int, int,
                   const btCollisionObjectWrapper* b, int, int index) {
  const auto* mesh = dynamic_cast<const MeshShape*>(b->getCollisionObject()->getCollisionShape());
  if (mesh && b->getCollisionShape()->getShapeType() == TRIANGLE_SHAPE_PROXYTYPE)
    mesh->adjust(point, *b, index, *a);
  return true;
}

}  // namespace

MeshShape::MeshShape(btTriangleMesh& triangles, const TriangleMesh& mesh, double margin)
    : btBvhTriangleMeshShape(&triangles, true), bends_(mesh.triangleCount()) {
  setMargin(margin);
  for (auto& bends : bends_) bends.fill(std::numeric_limits<double>::quiet_NaN());
  const std::vector<Side> sides = sortedSides(mesh);
  for (auto it = sides.begin(); it != sides.end();) {
    const auto end =
        std::find_if(it, sides.end(), [&](const Side& s) { return s.edge != it->edge; });
    if (end - it == 2)
      for (const auto& [side, other] : {std::pair(it[0], it[1]), std::pair(it[1], it[0])})
        bends_[side.triangle][side.k] =
            bendTo(mesh, side.triangle, side.k, cornerOf(mesh, other.triangle, other.k + 2));
    it = end;
  }
}

void MeshShape::adjust(btManifoldPoint& point, const btCollisionObjectWrapper& triangle, int index,
                       const btCollisionObjectWrapper& other) const {
  const auto& shape = *static_cast<const btTriangleShape*>(triangle.getCollisionShape());
  const btTransform& pose = triangle.getWorldTransform();
  btVector3 normal;
  shape.calcNormal(normal);
  normal = pose.getBasis() * normal;
  const double side = sideOf(other, pose * shape.getVertexPtr(0), normal);
  // Contacts at an edge are as far from it as the margin puts them.
  const double reach = 2.0 * getMargin();
  double most = -1.0;
  for (int k = 0; k < 3; ++k) {
    const btVector3 &a = shape.getVertexPtr(k), &b = shape.getVertexPtr((k + 1) % 3);
    if (distanceToEdge(point.m_localPointB, a, b) > reach) continue;
    if (std::isnan(bends_[index][k])) return;
    most = std::max({most, 0.0, side * bends_[index][k]});
  }
  if (most < 0.0) return;
  const btVector3 up = side * normal,
                  across = point.m_normalWorldOnB - up.dot(point.m_normalWorldOnB) * up;
  const double angle = std::atan2(across.length(), up.dot(point.m_normalWorldOnB));
  if (!(angle > most)) return;  // nor where the triangle has no normal
  const btVector3 turned = most == 0.0 || across.fuzzyZero()
                               ? up
                               : std::cos(most) * up + std::sin(most) * across.normalized();
  point.m_distance1 *= turned.dot(point.m_normalWorldOnB);
  point.m_normalWorldOnB = turned;
  point.m_positionWorldOnB = point.m_positionWorldOnA - point.m_distance1 * turned;
  point.m_localPointB = pose.invXform(point.m_positionWorldOnB);
}

void MeshShape::adjustContactsOf(btRigidBody& body) {
  [[maybe_unused]] static const auto before = std::exchange(gContactAddedCallback, adjustContact);
  body.setCollisionFlags(body.getCollisionFlags() | btCollisionObject::CF_CUSTOM_MATERIAL_CALLBACK);
}

}  // namespace calipso::fem
