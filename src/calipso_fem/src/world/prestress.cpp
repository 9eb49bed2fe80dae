#include "prestress.hpp"

#include <cmath>

#include "../preconditioner.hpp"

namespace calipso::fem {
namespace {

using Weights = Eigen::SparseVector<double>;

// A rigid motion that nothing holds is held by inertia: of the stiffness of a cube of the body's
// size.
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
      if (const int k =
              A->pattern->tryFind(static_cast<int>(p.index()), static_cast<int>(q.index()));
          k >= 0)
        A->block(k).diagonal().array() += stiffness * p.value() * q.value();
}

void addInertia(const DeformableBody& body, BlockMatrix* A) {
  const Material& material = body.model().cellMaterials().front();
  const NodeMatrix& nodes = body.model().mesh().nodes;
  const double size = (nodes.colwise().maxCoeff() - nodes.colwise().minCoeff()).norm();
  const double rate =
      kInertia * material.youngs_modulus / (material.density * size * size);  // 1/s^2
  const Eigen::VectorXd& mass = body.model().lumpedMass();
  for (int i = 0; i < mass.size(); ++i)
    A->block(A->pattern->diagonal[i]).diagonal().array() += rate * mass[i];
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

// Less the translation and the small rotation that are nearest to it, by mass.
Vec withoutRigidMotion(const Vec& u, const DeformableBody& body) {
  const Eigen::VectorXd& mass = body.model().lumpedMass();
  Eigen::Vector3d center = Eigen::Vector3d::Zero(), shift = center, moment = center;
  for (int i = 0; i < mass.size(); ++i) {
    center += mass[i] / mass.sum() * body.positions().segment<3>(3 * i);
    shift += mass[i] / mass.sum() * u.segment<3>(3 * i);
  }
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  for (int i = 0; i < mass.size(); ++i) {
    const Eigen::Vector3d r = body.positions().segment<3>(3 * i) - center;
    inertia += mass[i] * (r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose());
    moment += mass[i] * r.cross(u.segment<3>(3 * i));
  }
  const Eigen::Vector3d turn = inertia.ldlt().solve(moment);
  Vec bend = u;
  for (int i = 0; i < mass.size(); ++i)
    bend.segment<3>(3 * i) -= shift + turn.cross(body.positions().segment<3>(3 * i) - center);
  return bend;
}

}  // namespace

Sag::Sag(const Eigen::Vector3d& gravity, const DeformableBody& body, double stiffness,
         const std::vector<HoldPoint>& hold)
    : stiffness_(stiffness) {
  body.model().hessian(body.positions(), Definiteness::kExact, K_);
  BlockMatrix A = K_;
  for (const HoldPoint& h : hold) {
    points_.push_back(body.embedding().pointWeights(SurfacePoint::vertex(h.vertex)));
    addSpring(points_.back(), stiffness, &A);
  }
  addInertia(body, &A);
  holdFixed(body, &A);
  const auto factor = makeCholesky();
  displacement_.setZero(3 * body.nodeCount());
  known_ = factor->update(A);
  if (known_) factor->apply(weightOf(body, gravity), displacement_);
}

Vec Sag::prestress(std::vector<HoldPoint>* hold) const {
  if (!known_) return displacement_;
  for (size_t i = 0; i < hold->size(); ++i) {
    (*hold)[i].force.setZero();
    for (Weights::InnerIterator it(points_[i]); it; ++it)
      (*hold)[i].force -= stiffness_ * it.value() * displacement_.segment<3>(3 * it.index());
  }
  Vec inner;
  K_.multiply(displacement_, inner);
  return -inner;
}

std::optional<double> Sag::largest(const DeformableBody& body) const {
  constexpr double kTips = 100.0;  // of the bending: what moves as a whole by as much is not held
  const auto most = [](const Vec& u) {
    return Eigen::Map<const NodeMatrix>(u.data(), u.size() / 3, 3).rowwise().norm().maxCoeff();
  };
  const double all = most(displacement_), bend = most(withoutRigidMotion(displacement_, body));
  if (!known_ || !std::isfinite(all) || all > kTips * bend) return std::nullopt;
  return all;
}

}  // namespace calipso::fem
