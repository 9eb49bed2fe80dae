#include "bullet_body.hpp"

#include <Eigen/Eigenvalues>

#include "bullet_world.hpp"
#include "mesh_shape.hpp"

namespace calipso::fem {
namespace {

std::unique_ptr<btCollisionShape> hullShape(const TriangleMesh& hull,
                                            const Eigen::Isometry3d& body_from_object,
                                            double margin) {
  auto shape = std::make_unique<btConvexHullShape>();
  for (int i = 0; i < hull.vertexCount(); ++i)
    shape->addPoint(toBullet(Eigen::Vector3d(body_from_object * hull.vertex(i))), false);
  shape->setMargin(margin);
  shape->recalcLocalAabb();
  return shape;
}

std::unique_ptr<btTriangleMesh> triangleShape(const TriangleMesh& mesh) {
  auto triangles = std::make_unique<btTriangleMesh>();
  for (int f = 0; f < mesh.triangleCount(); ++f)
    triangles->addTriangle(toBullet(mesh.vertex(mesh.triangles(f, 0))),
                           toBullet(mesh.vertex(mesh.triangles(f, 1))),
                           toBullet(mesh.vertex(mesh.triangles(f, 2))));
  return triangles;
}

// Bullet's contact margin, in lengths of the body.
constexpr double kMargin = 5e-4;

}  // namespace

double span(const std::vector<TriangleMesh>& shapes) {
  Eigen::AlignedBox3d box;
  for (const TriangleMesh& shape : shapes)
    for (int i = 0; i < shape.vertexCount(); ++i) box.extend(shape.vertex(i));
  return box.diagonal().norm();
}

// Diagonal inertia and the rotation to its axes.
Eigen::Vector3d principal(const MassProperties& mass, Eigen::Isometry3d& object_from_body) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(mass.inertia);
  Eigen::Matrix3d axes = eigen.eigenvectors();
  if (axes.determinant() < 0.0) axes.col(2) *= -1.0;
  object_from_body.linear() = axes;
  object_from_body.translation() = mass.center;
  return eigen.eigenvalues();
}

void buildShape(BulletBody& body, const RigidBodySpec& spec) {
  const double margin = kMargin * span(spec.shapes);
  if (spec.motion == RigidMotion::kStatic) {
    body.triangles = triangleShape(spec.shapes.front());
    body.shapes.push_back(
        std::make_unique<MeshShape>(*body.triangles, spec.shapes.front(), margin));
    return;
  }
  const Eigen::Isometry3d body_from_object = body.object_from_body.inverse();
  for (const TriangleMesh& hull : spec.shapes)
    body.shapes.push_back(hullShape(hull, body_from_object, margin));
  if (body.shapes.size() == 1) return;
  auto compound = std::make_unique<btCompoundShape>();
  for (const auto& shape : body.shapes)
    compound->addChildShape(btTransform::getIdentity(), shape.get());
  body.shapes.push_back(std::move(compound));
}

void buildStrip(BulletBody& owner, const SupportPlane& plane) {
  constexpr double kHalfExtent = 1e3, kHalfThickness = 1.0;  // m
  const Eigen::Vector3d n = plane.normal;
  Eigen::Matrix3d axes;
  axes.col(0) = (Eigen::Vector3d::UnitX() - n.x() * n).normalized();
  axes.col(2) = n;
  axes.col(1) = n.cross(axes.col(0));
  const double half_x = 0.5 * (plane.x_range->y() - plane.x_range->x()) / axes(0, 0);
  Eigen::Vector3d center = plane.offset * n;
  center +=
      (0.5 * (plane.x_range->x() + plane.x_range->y()) - center.x()) / axes(0, 0) * axes.col(0);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = axes;
  pose.translation() = center - kHalfThickness * n;
  owner.shapes.push_back(
      std::make_unique<btBoxShape>(btVector3(half_x, kHalfExtent, kHalfThickness)));
  btRigidBody::btRigidBodyConstructionInfo info(0.0, nullptr, owner.shapes.back().get());
  info.m_startWorldTransform = toBullet(pose);
  owner.body = std::make_unique<btRigidBody>(info);
}

}  // namespace calipso::fem
