#pragma once

#include <btBulletDynamicsCommon.h>

#include <Eigen/Geometry>
#include <memory>
#include <string>
#include <vector>

#include "calipso_fem/world/rigid_world.hpp"

// A body in Bullet with everything it owns. Private to the rigid world.
namespace calipso::fem {

struct BulletBody {
  std::string name;
  RigidMotion motion = RigidMotion::kStatic;
  Eigen::Isometry3d object_from_body = Eigen::Isometry3d::Identity();  // body: principal axes
  std::unique_ptr<btTriangleMesh> triangles;
  std::vector<std::unique_ptr<btCollisionShape>> shapes;  // the last one is the body's own
  std::unique_ptr<btRigidBody> body;
  // world_from_object over the next step
  Eigen::Isometry3d kinematic_start = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d kinematic_target = Eigen::Isometry3d::Identity();
  bool moves = false;
  bool pushed = false;  // by an impulse that acts over the next step
  Eigen::Vector3d force = Eigen::Vector3d::Zero(), torque = Eigen::Vector3d::Zero();
};

// Length of the shapes' common bounding diagonal, m.
double span(const std::vector<TriangleMesh>& shapes);

// Diagonal of the inertia; sets the pose of its axes at the centre of mass.
Eigen::Vector3d principal(const MassProperties& mass, Eigen::Isometry3d& object_from_body);

// Convex hulls (compound if several) in the body's frame; for static bodies the triangles
// themselves.
void buildShape(BulletBody& body, const RigidBodySpec& spec);

// Box whose upper face is the plane's strip between the two world x of its range.
void buildStrip(BulletBody& body, const SupportPlane& plane);

}  // namespace calipso::fem
