#include "soft_system.hpp"

#include <algorithm>
#include <stdexcept>

namespace calipso::fem {
namespace {

constexpr double kPivotError = 1e-3;  // relative: the iteration corrects what its matrix is off by

void turnNodes(const Eigen::Matrix3d& R, Vec& v) {
  Eigen::Map<Eigen::Matrix3Xd> columns(v.data(), 3, v.size() / 3);
  columns = (R * columns).eval();
}

Eigen::Vector3d sumOfNodes(const Vec& v) {
  return Eigen::Map<const Eigen::Matrix3Xd>(v.data(), 3, v.size() / 3).rowwise().sum();
}

bool holdsSomething(const DeformableBody& body) {
  for (int node = 0; node < body.nodeCount(); ++node)
    for (int axis = 0; axis < 3; ++axis)
      if (body.isPrescribed(node, axis)) return true;
  return false;
}

// A times a shift of all nodes along each axis.
Eigen::MatrixX3d shiftedBy(const BlockMatrix& A) {
  Eigen::MatrixX3d result(3 * A.pattern->rows(), 3);
  for (int axis = 0; axis < 3; ++axis) {
    Vec y;
    A.multiply(Eigen::Vector3d::Unit(axis).replicate(A.pattern->rows(), 1), y);
    result.col(axis) = y;
  }
  return result;
}

}  // namespace

bool SoftSystem::serves(const std::vector<int>& nodes, double h) const {
  return valid_ && h == h_ && std::all_of(nodes.begin(), nodes.end(), [&](int node) {
           return factor_.indexOf(node) >= 0;
         });
}

void SoftSystem::renew(DeformableBody& body, const Eigen::Matrix3d& rotation,
                       const std::vector<int>& nodes, double h) {
  // Nodes of before stay as long as they are not most of the work: contacts come and go.
  std::vector<int> all = nodes;
  const std::vector<int>& before = factor_.nodes();
  const bool contained = std::includes(before.begin(), before.end(), nodes.begin(), nodes.end());
  if (before.size() <= 2 * nodes.size()) {
    all.clear();
    std::set_union(before.begin(), before.end(), nodes.begin(), nodes.end(),
                   std::back_inserter(all));
    if (contained) all = before;
  }
  // An indefinite tangent is found out by the factor's failing: for a while it is expected to stay
  // so.
  constexpr int kExpectedIndefinite = 4;
  valid_ = false;
  if (indefinite_ == 0) {
    body.trialSystem(Definiteness::kExact, &A_, &pull_);
    valid_ = factor_.update(A_, all, kPivotError);
    if (!valid_) indefinite_ = kExpectedIndefinite;
  } else {
    --indefinite_;
  }
  if (!valid_) {
    body.trialSystem(Definiteness::kPositive, &A_, &pull_);
    valid_ = factor_.update(A_, all, kPivotError);
  }
  if (!valid_) throw std::runtime_error("contact: the body's system is not positive definite");
  held_.clear();
  compliance_.resize(0, 0);
  for (size_t k = 0; k < all.size(); ++k)
    for (int axis = 0; axis < 3; ++axis)
      if (body.isPrescribed(all[k], axis)) held_.push_back(3 * static_cast<int>(k) + axis);
  shifted_ = holdsSomething(body) ? Eigen::MatrixX3d() : shiftedBy(A_);
  frozen_ = rotation;
  turn_.setIdentity();
  h_ = h;
  ++version_;
}

// Components are prescribed along the world's axes: a body that has some does not turn far.
void SoftSystem::turnTo(const Eigen::Matrix3d& rotation, bool held) {
  turn_ = held ? Eigen::Matrix3d(Eigen::Matrix3d::Identity()) : rotation * frozen_.transpose();
}

const Eigen::MatrixXd& SoftSystem::compliance() {
  if (held_.empty()) return factor_.compliance();
  if (compliance_.size() > 0) return compliance_;
  compliance_ = factor_.compliance();
  for (const int dof : held_) {
    compliance_.row(dof).setZero();
    compliance_.col(dof).setZero();
  }
  return compliance_;
}

Vec SoftSystem::reduce(const Vec& forces) {
  Vec b = forces;
  turnNodes(turn_.transpose(), b);
  push_ = sumOfNodes(b);
  Vec way = factor_.reduce(b);
  turnNodes(turn_, way);
  return way;
}

Vec SoftSystem::complete(const Vec& contact_forces) {
  const std::vector<int>& nodes = factor_.nodes();
  Vec f(3 * nodes.size());
  for (size_t k = 0; k < nodes.size(); ++k)
    f.segment<3>(3 * k) = turn_.transpose() * contact_forces.segment<3>(3 * nodes[k]);
  for (const int dof : held_) f[dof] = 0.0;
  Vec d = factor_.complete(f);
  if (shifted_.size() > 0) {
    const Eigen::Vector3d lacking = push_ + sumOfNodes(f) - shifted_.transpose() * d;
    Eigen::Matrix3d inertia;
    for (int axis = 0; axis < 3; ++axis) inertia.col(axis) = sumOfNodes(shifted_.col(axis));
    d += inertia.ldlt().solve(lacking).replicate(d.size() / 3, 1);
  }
  turnNodes(turn_, d);
  return d;
}

}  // namespace calipso::fem
