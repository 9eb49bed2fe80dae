#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "calipso_scene/scene.hpp"
#include "calipso_scene/triangle_mesh.hpp"

namespace calipso {

// Vertices of a placed mesh that the boxes hold, ascending. A box that holds none, as a small one
// of a peg or a hinge does where the model's shape or depth is some per cent off, grows until it
// is met; one that is more than 15 % of the mesh's diagonal away from it holds nothing.
std::vector<int> attachedVertices(const TriangleMesh& mesh,
                                  const Eigen::Isometry3d& world_from_mesh,
                                  const std::vector<AttachmentBox>& boxes);

}  // namespace calipso
