#pragma once

#include <btBulletDynamicsCommon.h>

#include <array>
#include <vector>

#include "calipso_scene/triangle_mesh.hpp"

// Private to the rigid world.
namespace calipso::fem {

// Triangles of a body that stays, which know how they meet. To Bullet each triangle stands alone, so
// that what slides over a surface strikes the edges within it. Contacts at an edge push no further
// from the triangle's normal than the surface bends there.
class MeshShape : public btBvhTriangleMeshShape {
 public:
  // @param triangles of `mesh`, in its order; outlive this
  MeshShape(btTriangleMesh& triangles, const TriangleMesh& mesh, double margin);

  // Has Bullet adjust the contacts of a body with this shape. Bullet has one function for that for
  // all worlds of a process; it needs nothing but the contact, and passes over other shapes.
  static void adjustContactsOf(btRigidBody& body);

  // Turns a contact's normal. @param other the convex shape on triangle `index`
  void adjust(btManifoldPoint& point, const btCollisionObjectWrapper& triangle, int index,
              const btCollisionObjectWrapper& other) const;

 private:
  // Per triangle and edge, from its corner k to the next: by how much the surface bends there, rad;
  // positive where it is convex, NaN where no other triangle, or several, meet this one.
  std::vector<std::array<double, 3>> bends_;
};

}  // namespace calipso::fem
