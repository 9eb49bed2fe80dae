#include "step_motion.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

#include "contact_operator.hpp"
#include "soft_system.hpp"
#include "thread_team.hpp"

namespace calipso::fem {
namespace {

using Vertices = decltype(TriangleMesh::vertices);

void addForce(Vec& surface, const SurfacePoint& point, const Eigen::Vector3d& force) {
  for (int k = 0; k < 3; ++k)
    if (point.weights[k] != 0.0)
      surface.segment<3>(3 * point.vertices[k]) += point.weights[k] * force;
}

// Overlap that is undone: this share of it in a step, not faster than so many minimal distances a
// second. What is left of a few hundredths of these stays: to push it out again and again would
// lift what lies there.
constexpr double kOverlapShare = 0.2, kPushOutRate = 4.0, kOverlapLeft = 0.04;

constexpr double kUnmoved = 1e-7;  // of a body's size: no way

}  // namespace

double allowance(const Contact& c, double h) {
  const double depth = c.offset - c.start_gap;
  if (depth <= 0.0) return 0.0;
  const double excess = std::max(0.0, depth - kOverlapLeft * c.reach);
  return depth - std::min(kOverlapShare * excess, h * kPushOutRate * c.reach);
}

StepMotion::StepMotion(const std::vector<SoftEntry>& softs, const std::vector<Obstacle>& obstacles,
                       RigidWorld& rigid, double h)
    : rigid_(rigid), h_(h) {
  for (const SoftEntry& entry : softs) {
    Body b;
    b.soft = entry.soft;
    b.soft->beginStep(h);
    b.start = b.soft->vertices();
    b.size = (b.start.colwise().maxCoeff() - b.start.colwise().minCoeff()).norm();
    b.target = b.soft->body().trialPositions();
    b.forces.setZero(b.target.size());
    const Vec s = h * b.soft->body().surfaceVelocities();  // until there is a target
    b.moved = Eigen::Map<const Vertices>(s.data(), s.size() / 3, 3);
    b.moved.rowwise() += h * h * b.soft->gravity().transpose();
    bodies_.push_back(std::move(b));
  }
  for (const Obstacle& o : obstacles)
    if (o.rigid) rigids_[*o.rigid].acceleration = o.acceleration;
}

void StepMotion::measure(Body& body) {
  const Vec s = body.soft->body().embedding().apply(body.target);
  body.moved = Eigen::Map<const Vertices>(s.data(), s.size() / 3, 3) - body.start;
}

void StepMotion::forEachTouched(const std::function<void(Body&)>& work) {
  std::vector<Body*> touched;
  for (Body& b : bodies_)
    if (b.touched) touched.push_back(&b);
  eachOnAThread(static_cast<int>(touched.size()), [&](int k) { work(*touched[k]); });
}

void StepMotion::touch(const std::map<Contact::Key, Contact>& contacts) {
  for (const auto& [key, c] : contacts)
    for (const int soft : {c.soft_a, c.soft_b})
      if (soft >= 0) bodies_[soft].touched = true;
  std::vector<int> unserved;
  for (size_t i = 0; i < bodies_.size(); ++i) {
    Body& b = bodies_[i];
    if (!b.touched) continue;
    SoftSystem& system = b.soft->system();
    const std::vector<int> nodes = ContactOperator::nodesOf(static_cast<int>(i), contacts, *b.soft);
    const bool jumps = !b.soft->body().trialJump().isZero(0.0);
    if (jumps || !system.serves(nodes, h_))
      unserved.push_back(static_cast<int>(i));
    else
      system.turnTo(b.soft->rotation(), b.soft->hasFixedNodes());
  }
  renew(unserved, contacts);
}

void StepMotion::expect(const std::map<Contact::Key, Contact>& contacts) {
  for (size_t i = 0; i < bodies_.size(); ++i)
    bodies_[i].expected = ContactOperator::nodesOf(static_cast<int>(i), contacts, *bodies_[i].soft);
}

void StepMotion::renew(const std::vector<int>& softs,
                       const std::map<Contact::Key, Contact>& contacts) {
  eachOnAThread(static_cast<int>(softs.size()), [&](int k) {
    Body& b = bodies_[softs[k]];
    const std::vector<int> own = ContactOperator::nodesOf(softs[k], contacts, *b.soft);
    std::vector<int> nodes;
    std::set_union(own.begin(), own.end(), b.expected.begin(), b.expected.end(),
                   std::back_inserter(nodes));
    b.soft->system().renew(b.soft->body(), b.soft->rotation(), nodes, h_);
  });
}

void StepMotion::aim(const std::vector<int>& softs) {
  std::vector<Body*> touched;
  for (const int soft : softs)
    if (bodies_[soft].touched)
      touched.push_back(&bodies_[soft]);
    else
      aim(bodies_[soft]);
  eachOnAThread(static_cast<int>(touched.size()), [&](int k) { aim(*touched[k]); });
}

void StepMotion::aim(Body& body) {
  DeformableBody& fem = body.soft->body();
  if (!body.touched) {
    body.target = fem.trialPositions() + fem.trialDirection(body.forces);
    measure(body);
    return;
  }
  SoftSystem& system = body.soft->system();
  Vec b = fem.trialDescent();
  const Vec jump = fem.trialJump();
  if (!jump.isZero(0.0)) b += system.pull();
  body.free_way = system.reduce(b);
  const Vec so_far = fem.trialPositions() - fem.positions() + jump;
  for (int node = 0; node < fem.nodeCount(); ++node)
    if (const int k = system.indexOf(node); k >= 0)
      body.free_way.segment<3>(3 * k) += so_far.segment<3>(3 * node);
}

void StepMotion::setForces(const std::map<Contact::Key, Contact>& contacts) {
  std::vector<Vec> surface;
  for (const Body& b : bodies_) surface.push_back(Vec::Zero(3 * b.start.rows()));
  for (auto& [id, r] : rigids_) r.linear.setZero(), r.angular.setZero();
  for (const auto& [key, c] : contacts) {
    if (c.force.isZero(0.0)) continue;
    if (c.soft_a >= 0) addForce(surface[c.soft_a], c.point, c.force);
    if (c.soft_b >= 0) addForce(surface[c.soft_b], c.other, -c.force);
    for (const auto& [id, sign] : {std::make_pair(c.rigid_a, h_), std::make_pair(c.rigid_b, -h_)}) {
      if (!id) continue;
      Rigid& r = rigids_[*id];
      const auto [linear, angular] = rigid_.velocityChange(*id, sign * c.force, c.place);
      r.linear += linear;
      r.angular += angular;
    }
  }
  for (size_t i = 0; i < bodies_.size(); ++i)
    if (bodies_[i].touched)
      bodies_[i].forces = bodies_[i].soft->body().embedding().applyTransposed(surface[i]);
}

void StepMotion::follow(const std::map<Contact::Key, Contact>& contacts) {
  setForces(contacts);
  forEachTouched([&](Body& b) {
    DeformableBody& fem = b.soft->body();
    b.target = fem.trialPositions() + fem.trialJump() + b.soft->system().complete(b.forces);
    measure(b);
  });
}

void StepMotion::advanceFree() {
  for (Body& b : bodies_) {
    if (b.touched) continue;
    DeformableBody& fem = b.soft->body();
    const double t = fem.trialStepLength(b.target, b.forces);
    if (t != 1.0) b.target = (1.0 - t) * fem.trialPositions() + t * b.target;
    const double way = (b.target - fem.trialPositions()).lpNorm<Eigen::Infinity>();
    fem.moveTrial(b.target);
    if (t != 1.0) measure(b);
    b.residual_before = b.residual;
    b.residual = fem.trialResidual(b.forces);
    // Where hardly any force acts, rounding is all that is left of the residual.
    const bool halved = b.residual_before == 0.0 || b.residual <= 0.5 * b.residual_before;
    b.stuck = t == 0.0 || (!halved && way < kUnmoved * b.size);
  }
}

void StepMotion::advanceTouched() {
  forEachTouched([](Body& b) { b.share = b.soft->body().trialStepLength(b.target, b.forces); });
  double share = 1.0;
  for (const Body& b : bodies_)
    if (b.touched) share = std::min(share, b.share);
  forEachTouched([&](Body& b) {
    DeformableBody& fem = b.soft->body();
    if (share != 1.0) b.target = (1.0 - share) * fem.trialPositions() + share * b.target;
    fem.moveTrial(b.target);
    if (share != 1.0) measure(b);
    b.residual_before = b.residual;
    b.residual = fem.trialResidual(b.forces);
    b.stuck = share == 0.0;
  });
}

Vec StepMotion::positions() const {
  Vec all;
  for (const Body& b : bodies_) {
    if (!b.touched) continue;
    const Vec& x = b.soft->body().trialPositions();
    all.conservativeResize(all.size() + x.size());
    all.tail(x.size()) = x;
  }
  return all;
}

Vec StepMotion::targets() const {
  Vec all;
  for (const Body& b : bodies_) {
    if (!b.touched) continue;
    all.conservativeResize(all.size() + b.target.size());
    all.tail(b.target.size()) = b.target;
  }
  return all;
}

void StepMotion::setTargets(const Vec& targets) {
  Eigen::Index at = 0;
  for (Body& b : bodies_) {
    if (!b.touched) continue;
    b.target = targets.segment(at, b.target.size());
    at += b.target.size();
    measure(b);
  }
}

bool StepMotion::tryTargets(const Vec& targets, const std::map<Contact::Key, Contact>& contacts) {
  const Vec from = positions(), plain = this->targets();
  setForces(contacts);
  setTargets(targets);
  forEachTouched([](Body& b) {
    b.soft->body().moveTrial(b.target);
    b.residual_there = b.soft->body().trialResidual(b.forces);
  });
  double before = 0.0, after = 0.0;
  for (const Body& b : bodies_) {
    if (!b.touched) continue;
    before = std::max(before, b.residual);
    after = std::max(after, b.residual_there);
  }
  const bool better = after < before;
  if (!better) setTargets(from);
  for (Body& b : bodies_) {
    if (!b.touched) continue;
    if (!better) b.soft->body().moveTrial(b.target);
    if (better) b.residual_before = std::exchange(b.residual, b.residual_there);
  }
  if (!better) setTargets(plain);
  return better;
}

Eigen::Vector3d StepMotion::way(int soft, const SurfacePoint& point) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int k = 0; k < 3; ++k)
    if (point.weights[k] != 0.0)
      sum += point.weights[k] * bodies_[soft].moved.row(point.vertices[k]).transpose();
  return sum;
}

Eigen::Vector3d StepMotion::rigidWay(RigidWorld::Id id, const Eigen::Vector3d& place) const {
  const auto found = rigids_.find(id);
  const Rigid r = found == rigids_.end() ? Rigid{} : found->second;
  const Eigen::Vector3d spin = rigid_.angularVelocity(id) + r.angular;
  return h_ * (rigid_.linearVelocity(id) + h_ * r.acceleration + r.linear +
               spin.cross(place - rigid_.center(id)));
}

Eigen::Vector3d StepMotion::freeRigidWay(RigidWorld::Id id, const Eigen::Vector3d& place) const {
  const auto found = rigids_.find(id);
  const Eigen::Vector3d acceleration =
      found == rigids_.end() ? Eigen::Vector3d(0, 0, 0) : found->second.acceleration;
  return h_ * (rigid_.linearVelocity(id) + h_ * acceleration +
               rigid_.angularVelocity(id).cross(place - rigid_.center(id)));
}

Eigen::Vector3d StepMotion::slip(const Contact& c) const {
  Eigen::Vector3d s = -c.motion;
  if (c.soft_a >= 0) s += way(c.soft_a, c.point);
  if (c.rigid_a) s += rigidWay(*c.rigid_a, c.place);
  if (c.soft_b >= 0) s -= way(c.soft_b, c.other);
  if (c.rigid_b) s -= rigidWay(*c.rigid_b, c.place);
  return s;
}

// Bodies that a force from outside reaches through their contacts: their momentum is not theirs.
std::vector<bool> StepMotion::grounded(const std::map<Contact::Key, Contact>& contacts) const {
  std::vector<bool> bodies(bodies_.size(), false);
  std::map<RigidWorld::Id, bool> rigids;
  for (size_t i = 0; i < bodies_.size(); ++i) bodies[i] = bodies_[i].soft->hasFixedNodes();
  for (bool changed = true; changed;) {
    changed = false;
    for (const auto& [key, c] : contacts) {
      if (c.force.isZero(0.0)) continue;
      const bool free_a = c.soft_a >= 0 || c.rigid_a, free_b = c.soft_b >= 0 || c.rigid_b;
      bool held = !free_a || !free_b;
      if (c.soft_a >= 0) held = held || bodies[c.soft_a];
      if (c.soft_b >= 0) held = held || bodies[c.soft_b];
      if (c.rigid_a) held = held || rigids[*c.rigid_a];
      if (c.rigid_b) held = held || rigids[*c.rigid_b];
      if (!held) continue;
      for (const int s : {c.soft_a, c.soft_b})
        if (s >= 0 && !bodies[s]) changed = bodies[s] = true;
      for (const auto& r : {c.rigid_a, c.rigid_b})
        if (r && !rigids[*r]) changed = rigids[*r] = true;
    }
  }
  return bodies;
}

std::vector<StepReport> StepMotion::finish(const std::map<Contact::Key, Contact>& contacts) {
  // Each body's impulse and its moment about where the centre of mass was; both sides of a contact
  // use the same point, so that together they change nothing.
  std::vector<Momentum> gained(bodies_.size());
  const auto give = [&](int soft, const Eigen::Vector3d& impulse, const Eigen::Vector3d& at) {
    if (soft < 0) return;
    gained[soft].linear += impulse;
    gained[soft].angular += (at - bodies_[soft].soft->momentumBefore().center).cross(impulse);
  };
  const std::vector<bool> held = grounded(contacts);
  for (const auto& [key, c] : contacts) {
    if (c.force.isZero(0.0)) continue;
    const Eigen::Vector3d impulse = h_ * c.force;
    give(c.soft_a, impulse, c.place);
    give(c.soft_b, -impulse, c.place);
    // What rigid ones give each other under the push, too: without it Bullet would see them run into
    // what they rest on, and throw them back.
    if (c.rigid_a) rigid_.push(*c.rigid_a, impulse, c.place);
    if (c.rigid_b) rigid_.push(*c.rigid_b, -impulse, c.place);
  }
  std::vector<StepReport> reports;
  for (size_t i = 0; i < bodies_.size(); ++i) {
    Body& b = bodies_[i];
    reports.push_back(
        b.soft->endStep(b.forces, h_, held[i] ? std::nullopt : std::optional<Momentum>(gained[i])));
    reports.back().residual = b.residual;
    reports.back().converged =
        reports.back().converged && b.residual <= b.soft->body().options().newton_tolerance;
  }
  return reports;
}

}  // namespace calipso::fem
