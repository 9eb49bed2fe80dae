#include "calipso_scene/attachment.hpp"

#include <algorithm>
#include <set>

namespace calipso {
namespace {

// Of the diagonal: how far a box may grow, and how much farther than to the nearest vertex, which
// alone would be a matter of chance.
constexpr double kMostReach = 0.15, kBeyond = 0.01;

// How far a box must grow on all sides to hold a point, m; 0: it does.
double growthTo(const AttachmentBox& box, const Eigen::Vector3d& p) {
  return std::max(0.0, (box.min - p).cwiseMax(p - box.max).maxCoeff());
}

}  // namespace

std::vector<int> attachedVertices(const TriangleMesh& mesh,
                                  const Eigen::Isometry3d& world_from_mesh,
                                  const std::vector<AttachmentBox>& boxes) {
  const double diagonal = boundingDiagonal(mesh);
  std::set<int> held;
  for (const AttachmentBox& box : boxes) {
    std::vector<double> growth(mesh.vertexCount());
    for (int i = 0; i < mesh.vertexCount(); ++i)
      growth[i] = growthTo(box, world_from_mesh * mesh.vertex(i));
    if (growth.empty()) continue;
    const double least = *std::min_element(growth.begin(), growth.end());
    if (least > kMostReach * diagonal) continue;
    const double reach = least > 0.0 ? least + kBeyond * diagonal : 0.0;
    for (int i = 0; i < mesh.vertexCount(); ++i)
      if (growth[i] <= reach) held.insert(i);
  }
  return {held.begin(), held.end()};
}

}  // namespace calipso
