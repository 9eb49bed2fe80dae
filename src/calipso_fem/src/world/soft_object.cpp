#include "calipso_fem/world/soft_object.hpp"

#include <Eigen/SVD>
#include <algorithm>
#include <stdexcept>

#include "calipso_fem/world/mass_properties.hpp"
#include "prestress.hpp"
#include "self_proximity.hpp"
#include "soft_system.hpp"

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

}  // namespace

SoftObject::SoftObject(const TriangleMesh& surface, const Material& material,
                       const FemOptions& options)
    : body_(surface, material, options),
      forces_(Vec::Zero(3 * surface.vertexCount())),
      observed_(body_.positions()),
      surface_(surface),
      system_(std::make_unique<SoftSystem>()) {
  for (int i = 0; i < surface.vertexCount(); ++i)
    carrier_.push_back(largestWeight(body_.embedding(), i));
  changed();
}

SoftObject::~SoftObject() = default;

void SoftObject::changed() {
  vertices_ = asRows(body_.surfaceVertices());
  fastest_ = asRows(body_.surfaceVelocities()).rowwise().norm().maxCoeff();
  rotation_ = motion().linear();
  tree_stale_ = true;
}

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

void SoftObject::setSelfContact(bool on) {
  if (on == (self_ != nullptr)) return;
  self_.reset();
  if (!on) return;
  TriangleMesh rest = surface_;
  rest.vertices = asRows(body_.embedding().apply(restPositions(body_.model().mesh())));
  if (!isClosed(rest) || signedVolume(rest) <= 0.0)
    throw std::invalid_argument(
        "a surface that is open or faces inwards cannot meet itself; give a closed one "
        "whose faces look outwards");
  self_ = std::make_unique<SelfProximity>(rest, body_.embedding());
}

Vec SoftObject::nodalField(const Vec& surface) const {
  const auto& weights = body_.embedding().weights;
  const Vec carried = weights.transpose() * Vec::Ones(weights.rows());
  Vec nodal = body_.embedding().applyTransposed(surface);
  for (int n = 0; n < carried.size(); ++n) {
    const bool still = carried[n] <= 0.0 || body_.isFixed(n);
    nodal.segment<3>(3 * n) *= still ? 0.0 : 1.0 / carried[n];
  }
  return nodal;
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

bool SoftObject::isHeld(const SurfacePoint& point) const {
  const auto& weights = body_.embedding().weights;
  for (int k = 0; k < 3; ++k) {
    if (point.weights[k] == 0.0) continue;
    for (Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator it(weights, point.vertices[k]);
         it; ++it)
      if (!body_.isFixed(static_cast<int>(it.col()))) return false;
  }
  return true;
}

// A contact gives way by a hundredth of what the whole body would; the rest shape absorbs it.
double SoftObject::holdStiffness(size_t points) const {
  const Material& material = body_.model().cellMaterials().front();
  return 100.0 * material.youngs_modulus * boundingDiagonal(surface_) / std::max<size_t>(1, points);
}

std::optional<double> SoftObject::linearSag(const Eigen::Vector3d& gravity,
                                            const std::vector<HoldPoint>& hold) const {
  return Sag(gravity, body_, holdStiffness(hold.size()), hold).largest(body_);
}

SettleReport SoftObject::settle(const Eigen::Vector3d& gravity, std::vector<HoldPoint>& hold,
                                double tolerance) {
  const Vec goal = body_.positions();
  const NodeMatrix relaxed = body_.model().mesh().nodes;
  const Material& material = body_.model().cellMaterials().front();
  const double stiffness = holdStiffness(hold.size());
  body_.setGravity(gravity);
  SettleReport report = findRestShape(goal, stiffness, hold, tolerance);
  body_.setSoftConstraints({});
  body_.setState(goal, Vec::Zero(goal.size()));
  body_.setGravity(gravity_);
  if (!report.converged) {
    body_.setRestNodes(relaxed);
    prestress_ = Sag(gravity, body_, stiffness, hold).prestress(&hold);
    prestress_modulus_ = material.youngs_modulus;
    report.message =
        "no rest shape found that gravity would bend into the observed one: it is relaxed as "
        "observed, "
        "and inner forces carry its weight there; they fade as it is made softer";
  }
  changed();
  return report;
}

SettleReport SoftObject::findRestShape(const Vec& goal, double stiffness,
                                       std::vector<HoldPoint>& hold, double tolerance) {
  constexpr int kMaxIterations = 8;
  SettleReport report;
  Vec rest = restPositions(body_.model().mesh());
  std::vector<SoftConstraint> constraints;
  for (const HoldPoint& h : hold) {
    SoftConstraint c;
    c.point = SurfacePoint::vertex(h.vertex);
    c.target = position(c.point);
    c.stiffness = stiffness;
    constraints.push_back(c);
  }
  body_.setSoftConstraints(constraints);
  while (report.iterations < kMaxIterations) {
    const StepReport equilibrium = body_.solveStatic();
    if (!equilibrium.converged) break;
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
  return report;
}

void SoftObject::setMaterial(const Material& material) {
  body_.setMaterial(material);
  forgetSystem();
}

void SoftObject::copyPrestress(const SoftObject& other) {
  prestress_ = other.prestress_;
  prestress_modulus_ = other.prestress_modulus_;
}

// The inner forces of a prestress are stresses of the body's material: they turn with it, and fall
// as it is made softer. A stiffer one needs no more than what carries the weight.
void SoftObject::applyNodalForces() {
  if (drive_.size() == 0 && prestress_.size() == 0) return;
  Vec forces = drive_.size() > 0 ? drive_ : Vec(Vec::Zero(observed_.size()));
  if (prestress_.size() > 0) {
    const double share =
        std::min(1.0, body_.model().cellMaterials().front().youngs_modulus / prestress_modulus_);
    const Eigen::Map<const Eigen::Matrix3Xd> inner(prestress_.data(), 3, prestress_.size() / 3);
    Eigen::Map<Eigen::Matrix3Xd>(forces.data(), 3, inner.cols()) += rotation_ * (share * inner);
  }
  body_.setNodalForces(forces);
}

void SoftObject::setGravity(const Eigen::Vector3d& gravity) {
  gravity_ = gravity;
  body_.setGravity(gravity);
}

void SoftObject::addForce(const SurfacePoint& point, const Eigen::Vector3d& force) {
  for (int k = 0; k < 3; ++k) forces_.segment<3>(3 * point.vertices[k]) += point.weights[k] * force;
  forced_ = true;
}

void SoftObject::clearForces() {
  forces_.setZero();
  forced_ = false;
}

StepReport SoftObject::step(double h) {
  applyNodalForces();
  const StepReport report = body_.step(h);
  changed();
  return report;
}

void SoftObject::beginStep(double h) {
  before_ = body_.momentum();
  body_.setSurfaceForces(forces_);
  applyNodalForces();
  body_.beginStep(h);
}

// NOTE: backward Euler leads the parabola by h^2 g / 2 and loses spin, Newton's tolerance leaves a
// remainder; both errors are rigid motions, so mending them does not touch the deformation.
StepReport SoftObject::endStep(const Vec& contact_forces, double h,
                               const std::optional<Momentum>& gained) {
  const StepReport report = body_.endStep(contact_forces);
  if (gained && !forced_ && drive_.size() == 0 && !hasFixedNodes()) {
    const double mass = body_.totalMass();
    Momentum target;
    target.linear = before_.linear + h * mass * gravity_ + gained->linear;
    target.angular = before_.angular + gained->angular;
    // Impulses act over the step like the scheme says; weight alone gives the exact parabola.
    target.center = before_.center + h / mass * target.linear - 0.5 * h * h * gravity_;
    setMomentum(target);
  }
  changed();
  return report;
}

void SoftObject::setMomentum(const Momentum& target) {
  const Momentum now = body_.momentum();
  const Eigen::VectorXd& mass = body_.model().lumpedMass();
  Vec x = body_.positions(), v = body_.velocities();
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  for (int i = 0; i < body_.nodeCount(); ++i) {
    const Eigen::Vector3d r = x.segment<3>(3 * i) - now.center;
    inertia += mass[i] * (r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose());
  }
  const Eigen::Vector3d spin = inertia.ldlt().solve(target.angular - now.angular);
  const Eigen::Vector3d linear = (target.linear - now.linear) / mass.sum();
  for (int i = 0; i < body_.nodeCount(); ++i) {
    v.segment<3>(3 * i) += linear + spin.cross(x.segment<3>(3 * i) - now.center);
    x.segment<3>(3 * i) += target.center - now.center;
  }
  body_.setState(x, v);
}

void SoftObject::forgetSystem() { system_->forget(); }

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
