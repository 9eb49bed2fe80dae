#include <Eigen/Geometry>
#include <cmath>
#include <stdexcept>

#include "body_impl.hpp"

namespace calipso::fem {

using Eigen::Vector3d;

Vec DeformableBody::surfaceVertices() const { return impl_->embedding.apply(impl_->x); }
Vec DeformableBody::surfaceVelocities() const { return impl_->embedding.apply(impl_->v); }

// Cells to nodes by filled volume, nodes to vertices by J.
Eigen::VectorXd DeformableBody::surfaceVonMises() const {
  const VolumeMesh& mesh = impl_->model->mesh();
  const Eigen::VectorXd cell = impl_->model->cellVonMises(impl_->x);
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(nodeCount()), weight = sum;
  for (int c = 0; c < mesh.cellCount(); ++c)
    for (int k = 0; k < mesh.cells.cols(); ++k) {
      sum[mesh.cells(c, k)] += mesh.fraction[c] * cell[c];
      weight[mesh.cells(c, k)] += mesh.fraction[c];
    }
  const Eigen::VectorXd nodal = sum.cwiseQuotient(weight.cwiseMax(1e-300));
  return (impl_->embedding.weights * nodal).cwiseMax(0.0);
}

double DeformableBody::elasticEnergy() const { return impl_->elasticEnergy(impl_->x); }

double DeformableBody::kineticEnergy() const {
  return 0.5 * impl_->v.dot(impl_->applyMass(impl_->v));
}

double DeformableBody::gravityEnergy() const {
  const Eigen::VectorXd& m = impl_->model->lumpedMass();
  double energy = 0.0;
  for (int k = 0; k < m.size(); ++k)
    energy -= m[k] * impl_->gravity.dot(impl_->x.segment<3>(3 * k));
  return energy;
}

Momentum DeformableBody::Impl::momentum() const {
  const Eigen::VectorXd& m = model->lumpedMass();
  const double total = m.sum();
  const Vec Mv = applyMass(v);
  Momentum result;
  for (int k = 0; k < m.size(); ++k) {
    result.center += m[k] / total * x.segment<3>(3 * k);
    result.linear += Mv.segment<3>(3 * k);
  }
  for (int k = 0; k < m.size(); ++k)
    result.angular +=
        Vector3d(x.segment<3>(3 * k) - result.center).cross(Vector3d(Mv.segment<3>(3 * k)));
  return result;
}

Momentum DeformableBody::momentum() const { return impl_->momentum(); }

double DeformableBody::totalMass() const { return impl_->model->totalMass(); }

bool DeformableBody::isAtRest(double speed) const {
  for (int k = 0; k < nodeCount(); ++k)
    if (!(impl_->v.segment<3>(3 * k).squaredNorm() <= speed * speed)) return false;
  return true;
}

// A of body_system.cpp is the velocity system divided by h (backward Euler: inertia = rate / h).
Vec DeformableBody::Impl::velocityChange(Vec impulses, double h) {
  if (!(h > 0.0)) throw std::invalid_argument("compliance: h must be > 0 s");
  if (!system_valid) {
    if (damping() > 0.0) setViscosity(x);
    setSystem(x, integrator(h), Definiteness::kPositive, nullptr, nullptr);
    system_valid = true;
  }
  maskResidual(&impulses);
  Vec w = Vec::Zero(impulses.size());
  solveSystem(impulses, options.linear_tolerance, &w);
  return w / (h * h);
}

Vec DeformableBody::Impl::nodalImpulse(const SurfacePoint& point, const Vector3d& impulse) const {
  Vec b = Vec::Zero(x.size());
  const Eigen::SparseVector<double> weights = embedding.pointWeights(point);
  for (Eigen::SparseVector<double>::InnerIterator it(weights); it; ++it)
    b.segment<3>(3 * it.index()) += it.value() * impulse;
  return b;
}

Vec DeformableBody::complianceColumn(const SurfacePoint& point, const Vector3d& direction,
                                     double h) const {
  return impl_->velocityChange(impl_->nodalImpulse(point, direction), h);
}

Eigen::MatrixXd DeformableBody::compliance(const std::vector<SurfacePoint>& points,
                                           const std::vector<Vector3d>& directions,
                                           double h) const {
  if (points.size() != directions.size())
    throw std::invalid_argument("compliance: needs one direction per point");
  const int n = static_cast<int>(points.size());
  std::vector<Eigen::SparseVector<double>> weights;
  for (const SurfacePoint& p : points) weights.push_back(impl_->embedding.pointWeights(p));
  Eigen::MatrixXd W(n, n);
  for (int j = 0; j < n; ++j) {
    const Vec column = complianceColumn(points[j], directions[j], h);
    for (int i = 0; i < n; ++i) {
      W(i, j) = 0.0;
      for (Eigen::SparseVector<double>::InnerIterator it(weights[i]); it; ++it)
        W(i, j) += it.value() * directions[i].dot(column.segment<3>(3 * it.index()));
    }
  }
  return 0.5 * (W + W.transpose());
}

void DeformableBody::applyImpulses(const std::vector<SurfacePoint>& points,
                                   const std::vector<Vector3d>& impulses, double h) {
  if (points.size() != impulses.size())
    throw std::invalid_argument("applyImpulses: needs one impulse per point");
  Vec b = Vec::Zero(impl_->x.size());
  for (std::size_t k = 0; k < points.size(); ++k) {
    if (!impulses[k].allFinite())
      throw std::invalid_argument("applyImpulses: impulse " + std::to_string(k) + " is not finite");
    const Eigen::SparseVector<double> weights = impl_->embedding.pointWeights(points[k]);
    for (Eigen::SparseVector<double>::InnerIterator it(weights); it; ++it)
      b.segment<3>(3 * it.index()) += it.value() * impulses[k];
  }
  if (!b.isZero(0.0)) impl_->v += impl_->velocityChange(std::move(b), h);
}

// The grid follows its surface: rest nodes X + d with J d = new - old vertices in the least-squares
// sense, smoothed by the body's own stiffness.
void DeformableBody::setRestShape(const TriangleMesh& surface) {
  Impl& m = *impl_;
  if (surface.vertexCount() != m.embedding.vertexCount())
    throw std::invalid_argument("rest shape: has " + std::to_string(surface.vertexCount()) +
                                " vertices, the body's surface has " +
                                std::to_string(m.embedding.vertexCount()));
  BlockMatrix K;
  const Vec rest = restPositions(m.model->mesh());
  m.model->hessian(rest, Definiteness::kPositive, K);
  double stiffest = 0.0;
  for (int k : K.pattern->diagonal) stiffest = std::max(stiffest, K.block(k).trace());
  const Eigen::Map<const Vec> target(surface.vertices.data(), 3 * surface.vertexCount());
  const Vec miss = target - m.embedding.apply(rest);
  const double spring = 100.0 * stiffest;
  for (int v = 0; v < m.embedding.vertexCount(); ++v) {
    const auto w = m.embedding.pointWeights(SurfacePoint::vertex(v));
    for (Eigen::SparseVector<double>::InnerIterator p(w); p; ++p)
      for (Eigen::SparseVector<double>::InnerIterator q(w); q; ++q)
        K.block(K.pattern->find(p.index(), q.index())).diagonal().array() +=
            spring * p.value() * q.value();
  }
  const auto cholesky = makeCholesky();
  if (!cholesky->update(K))
    throw std::runtime_error("rest shape: the grid cannot be carried along; build the body anew");
  Vec d;
  cholesky->apply(spring * m.embedding.applyTransposed(miss), d);
  const Vec moved = rest + d;
  setRestNodes(Eigen::Map<const NodeMatrix>(moved.data(), nodeCount(), 3));
}

}  // namespace calipso::fem
