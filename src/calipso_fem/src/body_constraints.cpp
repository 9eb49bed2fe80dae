#include <Eigen/Geometry>
#include <set>
#include <stdexcept>

#include "body_impl.hpp"

namespace calipso::fem {

using Eigen::Vector3d;

namespace {

void requireNode(int node, int count) {
  if (node < 0 || node >= count)
    throw std::invalid_argument("node " + std::to_string(node) + " does not exist, nodes are 0.." +
                                std::to_string(count - 1));
}

}  // namespace

void DeformableBody::fixNode(int node) {
  requireNode(node, nodeCount());
  for (int axis = 0; axis < 3; ++axis) {
    const int dof = 3 * node + axis;
    const double u = impl_->x[dof] - impl_->model->mesh().nodes(node, axis);
    impl_->prescribed[dof] = {[u](double) { return u; }};
  }
  impl_->invalidateSystem();
}

std::vector<int> DeformableBody::nodesOfSurfaceVertices(const std::vector<int>& vertices) const {
  std::set<int> nodes;
  for (int v : vertices) {
    const auto weights = impl_->embedding.pointWeights(SurfacePoint::vertex(v));
    for (Eigen::SparseVector<double>::InnerIterator it(weights); it; ++it)
      nodes.insert(static_cast<int>(it.index()));
  }
  return {nodes.begin(), nodes.end()};
}

void DeformableBody::fixSurfaceVertices(const std::vector<int>& vertices) {
  for (int node : nodesOfSurfaceVertices(vertices)) fixNode(node);
}

void DeformableBody::prescribe(int node, int axis, DisplacementOverTime displacement) {
  requireNode(node, nodeCount());
  if (axis < 0 || axis > 2)
    throw std::invalid_argument("axis is " + std::to_string(axis) + ", allowed is 0, 1, 2");
  if (!displacement) throw std::invalid_argument("prescribe: no displacement function given");
  impl_->prescribed[3 * node + axis] = {std::move(displacement)};
  impl_->invalidateSystem();
}

void DeformableBody::twist(const std::vector<int>& nodes, const Vector3d& center,
                           const Vector3d& axis, std::function<double(double)> angle) {
  if (!(axis.norm() > 0.0)) throw std::invalid_argument("twist: the axis has no direction");
  const Vector3d n = axis.normalized();
  for (int node : nodes) {
    requireNode(node, nodeCount());
    const Vector3d arm = impl_->model->mesh().node(node) - center;
    for (int c = 0; c < 3; ++c)
      prescribe(node, c, [arm, n, c, angle](double t) {
        return (Eigen::AngleAxisd(angle(t), n) * arm - arm)[c];
      });
  }
}

void DeformableBody::releaseNode(int node) {
  requireNode(node, nodeCount());
  for (int axis = 0; axis < 3; ++axis) impl_->prescribed.erase(3 * node + axis);
  impl_->invalidateSystem();
}

void DeformableBody::releaseSurfaceVertices(const std::vector<int>& vertices) {
  for (int node : nodesOfSurfaceVertices(vertices)) releaseNode(node);
}

void DeformableBody::releaseAll() {
  impl_->prescribed.clear();
  impl_->invalidateSystem();
}

bool DeformableBody::isPrescribed(int node, int axis) const {
  return impl_->prescribed.count(3 * node + axis) > 0;
}

bool DeformableBody::isFixed(int node) const {
  requireNode(node, nodeCount());
  for (int axis = 0; axis < 3; ++axis)
    if (impl_->prescribed.count(3 * node + axis) == 0) return false;
  return true;
}

Vector3d DeformableBody::reaction(int node) const {
  requireNode(node, nodeCount());
  return impl_->reactions.segment<3>(3 * node);
}

Vector3d DeformableBody::totalReaction() const {
  Vector3d sum = Vector3d::Zero();
  for (int node = 0; node < nodeCount(); ++node) sum += impl_->reactions.segment<3>(3 * node);
  return sum;
}

}  // namespace calipso::fem
