#pragma once

#include <string>

#include "calipso_fem/world/world.hpp"

// Small scenes for the tests of the world.
namespace calipso::fem::test {

// Axis-aligned box around `center`, each side cut into n x n quads of two triangles.
TriangleMesh boxSurface(const Eigen::Vector3d& size, int n);

TriangleMesh boxSurface(const Eigen::Vector3d& size,
                        const Eigen::Vector3i& n);  // quads along x, y, z

// A slab of two arms of `length` and half a ring of `radius` (of its middle) between them: open
// towards -z.
TriangleMesh horseshoe(double length, double radius, double thickness, double width,
                       const Eigen::Vector3i& n);

// A sphere by latitude and longitude.
TriangleMesh sphereSurface(double radius, int rings, int segments);

// A cup without its handle: open above, 9 cm high, 8 cm wide, centred at its middle.
TriangleMesh beaker();

// Bent rod of the size of a banana, lying in the xy plane, ends up to `size` apart.
TriangleMesh bentRod(double size, double thickness);

// Scene with one object at `position` and, unless told otherwise, a table at z = 0; the camera
// looks along +y from 1 m away.
WorldScene sceneWith(const TriangleMesh& mesh, const Eigen::Vector3d& position, bool table = true);

// Simulated on few nodes: quick.
inline WorldParams coarse() {
  WorldParams params;
  params.max_nodes = 150;
  return params;
}

Edit editOf(EditKind kind, EditMode mode = EditMode::kAbsolute, double time = 0.0);

// What becomes of an edit that is made now.
EditOutcome outcomeOf(World& world, Edit edit);

// Lets `seconds` of video pass at 30 frames per second.
void play(World& world, double seconds);

Eigen::Vector3d centerOf(const WorldState& state, int object = 0);

// Afloat before: with twice the gravity it falls with 1 g.
inline Edit letGo(const std::string& object) {
  Edit edit = editOf(EditKind::kGravity, EditMode::kFactor);
  edit.object = object;
  edit.factor = 2.0;
  return edit;
}

}  // namespace calipso::fem::test
