#include "calipso_fem/world/soft_object.hpp"

#include <Eigen/SVD>
#include <algorithm>

namespace calipso::fem {
namespace {

using Vertices = decltype(TriangleMesh::vertices);

Vertices asRows(const Vec& v) { return Eigen::Map<const Vertices>(v.data(), v.size() / 3, 3); }

int largestWeight(const Embedding& embedding, int vertex) {
  int node = 0;
  double largest = -1.0;
  for (Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator it(embedding.weights, vertex);
       it; ++it)
    if (it.value() > largest) {
      largest = it.value();
      node = static_cast<int>(it.col());
    }
  return node;
}

int mainVertex(const SurfacePoint& point) {
  int k = 0;
  point.weights.maxCoeff(&k);
  return point.vertices[k];
}

}  // namespace

SoftObject::SoftObject(const TriangleMesh& surface, const Material& material,
                       const FemOptions& options)
    : body_(surface, material, options),
      forces_(Vec::Zero(3 * surface.vertexCount())),
      observed_(body_.positions()),
      surface_(surface) {
  for (int i = 0; i < surface.vertexCount(); ++i)
    carrier_.push_back(largestWeight(body_.embedding(), i));
  changed();
  previous_ = vertices_;
}

void SoftObject::changed() {
  vertices_ = asRows(body_.surfaceVertices());
  rotation_ = motion().linear();
  tree_stale_ = true;
}

void SoftObject::standStill() { previous_ = vertices_; }

const SurfaceTree& SoftObject::tree() {
  if (!tree_) {
    surface_.vertices = vertices_;
    tree_ = std::make_unique<SurfaceTree>(surface_);
  } else if (tree_stale_) {
    tree_->refit(vertices_);
  }
  tree_stale_ = false;
  return *tree_;
}

Eigen::Isometry3d SoftObject::motion() const {
  const Eigen::VectorXd& mass = body_.model().lumpedMass();
  const Vertices a = asRows(observed_), b = asRows(body_.positions());
  const Eigen::Vector3d ca = a.transpose() * mass / mass.sum(),
                        cb = b.transpose() * mass / mass.sum();
  const Eigen::Matrix3d S = (b.rowwise() - cb.transpose()).transpose() * mass.asDiagonal() *
                            (a.rowwise() - ca.transpose());
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(S, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d U = svd.matrixU();
  if ((U * svd.matrixV().transpose()).determinant() < 0.0) U.col(2) *= -1.0;
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.linear() = U * svd.matrixV().transpose();
  motion.translation() = cb - motion.linear() * ca;
  return motion;
}

bool SoftObject::hasFixedNodes() const {
  for (int i = 0; i < body_.nodeCount(); ++i)
    if (body_.isFixed(i)) return true;
  return false;
}

SettleReport SoftObject::settle(const Eigen::Vector3d& gravity, std::vector<HoldPoint>& hold,
                                double tolerance) {
  constexpr int kMaxIterations = 8;
  SettleReport report;
  const Vec goal = body_.positions();
  Vec rest = restPositions(body_.model().mesh());
  // A contact gives way by a hundredth of what the whole body would; the rest shape absorbs it.
  const Material& material = body_.model().cellMaterials().front();
  const double stiffness = 100.0 * material.youngs_modulus * boundingDiagonal(surface_) /
                           std::max<size_t>(1, hold.size());
  std::vector<SoftConstraint> constraints;
  for (const HoldPoint& h : hold) {
    SoftConstraint c;
    c.point = SurfacePoint::vertex(h.vertex);
    c.target = position(c.point);
    c.stiffness = stiffness;
    constraints.push_back(c);
  }
  body_.setGravity(gravity);
  body_.setSoftConstraints(constraints);
  while (report.iterations < kMaxIterations) {
    const StepReport equilibrium = body_.solveStatic();
    if (!equilibrium.converged) {
      report.message = "no equilibrium found for the observed shape: " + equilibrium.message;
      break;
    }
    for (size_t i = 0; i < hold.size(); ++i)
      hold[i].force = body_.softConstraintForce(static_cast<int>(i));
    const Vec error = body_.positions() - goal;
    const double sag =
        Eigen::Map<const NodeMatrix>(error.data(), error.size() / 3, 3).rowwise().norm().maxCoeff();
    if (report.iterations == 0) report.sag = sag;
    report.converged = sag <= tolerance;
    if (report.converged) break;
    rest -= error;
    body_.setRestNodes(Eigen::Map<const NodeMatrix>(rest.data(), rest.size() / 3, 3));
    ++report.iterations;
  }
  body_.setSoftConstraints({});
  body_.setState(goal, Vec::Zero(goal.size()));
  body_.setGravity(gravity_);
  changed();
  return report;
}

void SoftObject::setGravity(const Eigen::Vector3d& gravity) {
  gravity_ = gravity;
  body_.setGravity(gravity);
}

void SoftObject::addForce(const SurfacePoint& point, const Eigen::Vector3d& force) {
  for (int k = 0; k < 3; ++k) forces_.segment<3>(3 * point.vertices[k]) += point.weights[k] * force;
  forced_ = true;
}

StepReport SoftObject::step(double h) {
  const Momentum before = body_.momentum();
  const bool flying = !forced_ && !hasFixedNodes();
  body_.setSurfaceForces(forces_);
  const StepReport report = body_.step(h);
  if (flying) keepFlightExact(before, h);
  forces_.setZero();
  forced_ = false;
  previous_ = vertices_;
  changed();
  return report;
}

// NOTE: backward Euler leads the parabola by h^2 g / 2 and loses spin; both errors are rigid
// motions, so mending them does not touch the deformation.
void SoftObject::keepFlightExact(const Momentum& before, double h) {
  const Eigen::Vector3d lead = 0.5 * h * h * gravity_;
  body_.setState(body_.positions() - lead.replicate(body_.nodeCount(), 1), Vec(body_.velocities()));
  restoreAngularMomentum(before.angular);
}

void SoftObject::restoreAngularMomentum(const Eigen::Vector3d& target) {
  const Momentum now = body_.momentum();
  const Eigen::VectorXd& mass = body_.model().lumpedMass();
  const Vec& x = body_.positions();
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  for (int i = 0; i < body_.nodeCount(); ++i) {
    const Eigen::Vector3d r = x.segment<3>(3 * i) - now.center;
    inertia += mass[i] * (r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose());
  }
  const Eigen::Vector3d spin = inertia.ldlt().solve(target - now.angular);
  Vec v = body_.velocities();
  for (int i = 0; i < body_.nodeCount(); ++i)
    v.segment<3>(3 * i) += spin.cross(x.segment<3>(3 * i) - now.center);
  body_.setState(Vec(x), v);
}

void SoftObject::applyImpulses(const std::vector<SurfacePoint>& points,
                               const std::vector<Eigen::Vector3d>& impulses, double h) {
  const bool free = !hasFixedNodes();
  Momentum target = body_.momentum();
  if (free)
    for (size_t i = 0; i < points.size(); ++i)
      target.angular += (position(points[i]) - target.center).cross(impulses[i]);
  const Vec before = body_.velocities();
  body_.applyImpulses(points, impulses, h);
  const Vec after = body_.velocities();
  body_.setState(body_.positions() + h * (after - before), after);
  if (free) restoreAngularMomentum(target.angular);
  changed();
}

const SoftObject::Column& SoftObject::columnOf(int vertex, double h) {
  if (h != column_step_) {
    columns_.clear();
    column_step_ = h;
  }
  const auto found = columns_.find(carrier_[vertex]);
  if (found != columns_.end()) return found->second;
  Column column;
  column.rotation = rotation_;
  for (int k = 0; k < 3; ++k) {
    const Vec w = body_.complianceColumn(SurfacePoint::vertex(vertex), Eigen::Vector3d::Unit(k), h);
    column.c[k] = Eigen::Map<const NodeMatrix>(w.data(), w.size() / 3, 3);
  }
  return columns_.emplace(carrier_[vertex], std::move(column)).first->second;
}

Eigen::Matrix3d SoftObject::compliance(const SurfacePoint& at, const SurfacePoint& from, double h) {
  const Column& column = columnOf(mainVertex(from), h);
  const Eigen::SparseVector<double> weights = body_.embedding().pointWeights(at);
  Eigen::Matrix3d C = Eigen::Matrix3d::Zero();
  for (Eigen::SparseVector<double>::InnerIterator it(weights); it; ++it)
    for (int k = 0; k < 3; ++k) C.col(k) += it.value() * column.c[k].row(it.index()).transpose();
  const Eigen::Matrix3d turn = rotation_ * column.rotation.transpose();
  return turn * C * turn.transpose();
}

Eigen::Vector3d SoftObject::gather(const Vec& nodal, const SurfacePoint& point) const {
  const Eigen::SparseVector<double> weights = body_.embedding().pointWeights(point);
  Eigen::Vector3d value = Eigen::Vector3d::Zero();
  for (Eigen::SparseVector<double>::InnerIterator it(weights); it; ++it)
    value += it.value() * nodal.segment<3>(3 * it.index());
  return value;
}

Eigen::Vector3d SoftObject::position(const SurfacePoint& point) const {
  return gather(body_.positions(), point);
}

Eigen::Vector3d SoftObject::velocity(const SurfacePoint& point) const {
  return gather(body_.velocities(), point);
}

}  // namespace calipso::fem
