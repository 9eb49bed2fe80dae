#include "prestress.hpp"

#include "../preconditioner.hpp"

namespace calipso::fem {
namespace {

using Weights = Eigen::SparseVector<double>;

// A rigid motion that nothing holds is held by inertia: of the stiffness of a cube of the body's size.
constexpr double kInertia = 1e-9;

// Work of gravity in the unit motion of each component, zero where the component is fixed.
Vec weightOf(const DeformableBody& body, const Eigen::Vector3d& gravity) {
  const Eigen::VectorXd& mass = body.model().lumpedMass();
  Vec weight(3 * mass.size());
  for (int i = 0; i < mass.size(); ++i)
    for (int axis = 0; axis < 3; ++axis)
      weight[3 * i + axis] = body.isPrescribed(i, axis) ? 0.0 : mass[i] * gravity[axis];
  return weight;
}

void addSpring(const Weights& weights, double stiffness, BlockMatrix* A) {
  for (Weights::InnerIterator p(weights); p; ++p)
    for (Weights::InnerIterator q(weights); q; ++q)
      if (const int k = A->pattern->tryFind(static_cast<int>(p.index()), static_cast<int>(q.index())); k >= 0)
        A->block(k).diagonal().array() += stiffness * p.value() * q.value();
}

void addInertia(const DeformableBody& body, BlockMatrix* A) {
  const Material& material = body.model().cellMaterials().front();
  const NodeMatrix& nodes = body.model().mesh().nodes;
  const double size = (nodes.colwise().maxCoeff() - nodes.colwise().minCoeff()).norm();
  const double rate = kInertia * material.youngs_modulus / (material.density * size * size);  // 1/s^2
  const Eigen::VectorXd& mass = body.model().lumpedMass();
  for (int i = 0; i < mass.size(); ++i) A->block(A->pattern->diagonal[i]).diagonal().array() += rate * mass[i];
}

// Fixed components do not move: their rows and columns become those of a diagonal matrix.
void holdFixed(const DeformableBody& body, BlockMatrix* A) {
  const BlockPattern& pattern = *A->pattern;
  for (int i = 0; i < pattern.rows(); ++i)
    for (int k = pattern.row_start[i]; k < pattern.row_start[i + 1]; ++k)
      for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b) {
          const bool diagonal = pattern.column[k] == i && a == b;
          if (!diagonal && (body.isPrescribed(i, a) || body.isPrescribed(pattern.column[k], b)))
            A->block(k)(a, b) = 0.0;
        }
}

}  // namespace

Vec prestressAgainst(const Eigen::Vector3d& gravity, const DeformableBody& body, double stiffness,
                     std::vector<HoldPoint>* hold) {
  BlockMatrix K;
  body.model().hessian(body.positions(), Definiteness::kExact, K);
  BlockMatrix A = K;
  std::vector<Weights> points;
  for (const HoldPoint& h : *hold) {
    points.push_back(body.embedding().pointWeights(SurfacePoint::vertex(h.vertex)));
    addSpring(points.back(), stiffness, &A);
  }
  addInertia(body, &A);
  holdFixed(body, &A);
  const auto factor = makeCholesky();
  Vec sag;
  if (!factor->update(A)) return Vec::Zero(3 * body.nodeCount());
  factor->apply(weightOf(body, gravity), sag);
  for (size_t i = 0; i < hold->size(); ++i) {
    (*hold)[i].force.setZero();
    for (Weights::InnerIterator it(points[i]); it; ++it)
      (*hold)[i].force -= stiffness * it.value() * sag.segment<3>(3 * it.index());
  }
  Vec inner;
  K.multiply(sag, inner);
  return -inner;
}

}  // namespace calipso::fem
