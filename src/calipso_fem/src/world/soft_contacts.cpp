#include "calipso_fem/world/soft_contacts.hpp"

#include <algorithm>
#include <cmath>

#include "obstacle_query.hpp"

namespace calipso::fem {
namespace {

constexpr double kSameDirection = 0.999;  // cosine below which a normal has turned

// One of the bodies a contact acts on: sign +1 for the deformable object, -1 for what it meets.
struct Side {
  SoftObject* soft = nullptr;
  std::optional<RigidWorld::Id> rigid;
  SurfacePoint point;
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
  double sign = 1.0;
};

Eigen::Matrix3d coupling(const Side& at, const Side& from, const RigidWorld& rigid, double h) {
  if (at.soft && at.soft == from.soft)
    return at.sign * from.sign * at.soft->compliance(at.point, from.point, h);
  if (at.rigid && at.rigid == from.rigid)
    return at.sign * from.sign * rigid.compliance(*at.rigid, at.place, from.place);
  return Eigen::Matrix3d::Zero();
}

}  // namespace

void SoftContacts::pushOn(const std::vector<SoftEntry>& softs,
                          const std::vector<Obstacle>& obstacles, RigidWorld& rigid, double h) {
  for (const auto& [key, m] : memory_) {
    if (m.force.isZero(0.0)) continue;
    for (const SoftEntry& entry : softs)
      if (entry.id == std::get<0>(key)) entry.soft->addForce(m.point, m.force);
    for (const Obstacle& obstacle : obstacles) {
      if (obstacle.id != std::get<1>(key)) continue;
      if (obstacle.soft) obstacle.soft->addForce(m.other, -m.force);
      if (obstacle.rigid) rigid.applyImpulse(*obstacle.rigid, -h * m.force, m.place);
    }
  }
}

ContactRow SoftContacts::rowOf(const Touch& touch, const SoftEntry& entry, const Obstacle& obstacle,
                               const RigidWorld& rigid, double h) const {
  // Depth of an earlier step is undone at this speed at most, so that it gives no kick.
  const double push_out = 10.0 * params_.proximity;
  ContactRow row;
  row.friction = frictionOf(entry, obstacle);
  const Eigen::Matrix3d frame = contactFrame(touch.normal);
  const Eigen::Vector3d own = entry.soft->velocity(touch.point);
  const Eigen::Vector3d others = obstacleVelocity(obstacle, touch.other, touch.place, rigid, h);
  row.free_velocity = frame * (own - others);
  double gap = touch.gap;
  const auto remembered = memory_.find(touch.key);
  if (remembered != memory_.end()) {
    const Memory& m = remembered->second;
    gap -= m.offset;
    row.start_impulse = row.impulse = h * (frame * m.force);
    row.held_normal = h * m.held_normal;
    row.held_tangential = h * m.held_tangential;
  }
  // Rigid bodies have not moved yet in this step; everything else has.
  const double gap_before =
      gap - h * touch.normal.dot(obstacle.rigid ? own : Eigen::Vector3d(own - others));
  row.free_velocity[0] += std::max(gap_before / h, -push_out);
  return row;
}

const Eigen::MatrixXd& SoftContacts::complianceOf(const Touches& touches,
                                                  const std::vector<SoftEntry>& softs,
                                                  const std::vector<Obstacle>& obstacles,
                                                  const RigidWorld& rigid, double h) {
  const bool same =
      W_step_ == h && W_of_.size() == touches.size() &&
      std::equal(touches.begin(), touches.end(), W_of_.begin(), [](const auto& t, const auto& w) {
        return t.first == w.first && t.second.normal.dot(w.second) > kSameDirection;
      });
  if (same) return W_;
  W_step_ = h;
  W_of_.clear();
  std::vector<std::array<Side, 2>> sides;
  std::vector<Eigen::Matrix3d> frames;
  for (const auto& [key, t] : touches) {
    const Obstacle& obstacle = obstacles[t.obstacle];
    sides.push_back({Side{softs[t.soft].soft, std::nullopt, t.point, t.place, 1.0},
                     Side{obstacle.soft, obstacle.rigid, t.other, t.place, -1.0}});
    frames.push_back(contactFrame(t.normal));
    W_of_.emplace_back(key, t.normal);
  }
  const int n = static_cast<int>(sides.size());
  W_.setZero(3 * n, 3 * n);
  for (int i = 0; i < n; ++i)
    for (int j = i; j < n; ++j) {
      Eigen::Matrix3d C = Eigen::Matrix3d::Zero();
      for (const Side& at : sides[i])
        for (const Side& from : sides[j]) C += coupling(at, from, rigid, h);
      const Eigen::Matrix3d block = frames[i] * C * frames[j].transpose();
      W_.block<3, 3>(3 * i, 3 * j) = block;
      W_.block<3, 3>(3 * j, 3 * i) = block.transpose();
    }
  return W_;
}

void SoftContacts::correct(const Touches& touches, const std::vector<Eigen::Vector3d>& impulses,
                           const std::vector<SoftEntry>& softs,
                           const std::vector<Obstacle>& obstacles, RigidWorld& rigid, double h) {
  std::map<int, std::pair<std::vector<SurfacePoint>, std::vector<Eigen::Vector3d>>>
      per_soft;  // by id
  std::map<int, SoftObject*> bodies;
  size_t i = 0;
  for (const auto& [key, t] : touches) {
    const Eigen::Vector3d& p = impulses[i++];
    if (p.isZero(0.0)) continue;
    const Obstacle& obstacle = obstacles[t.obstacle];
    bodies[softs[t.soft].id] = softs[t.soft].soft;
    per_soft[softs[t.soft].id].first.push_back(t.point);
    per_soft[softs[t.soft].id].second.push_back(p);
    if (obstacle.soft) {
      bodies[obstacle.id] = obstacle.soft;
      per_soft[obstacle.id].first.push_back(t.other);
      per_soft[obstacle.id].second.push_back(-p);
    }
    if (obstacle.rigid) rigid.applyImpulse(*obstacle.rigid, -p, t.place);
  }
  for (const auto& [id, work] : per_soft) bodies[id]->applyImpulses(work.first, work.second, h);
}

// Contacts that pushed in the last step and are gone: their impulse has to be taken back.
SoftContacts::Touches SoftContacts::releaseLost(const Touches& touches,
                                                const std::vector<SoftEntry>& softs,
                                                const std::vector<Obstacle>& obstacles) const {
  Touches lost;
  for (const auto& [key, m] : memory_) {
    if (touches.count(key)) continue;
    Touch t;
    t.key = key;
    t.point = m.point;
    t.other = m.other;
    t.place = m.place;
    const auto soft = std::find_if(softs.begin(), softs.end(),
                                   [&](const SoftEntry& e) { return e.id == std::get<0>(key); });
    const auto obstacle = std::find_if(obstacles.begin(), obstacles.end(),
                                       [&](const Obstacle& o) { return o.id == std::get<1>(key); });
    if (soft == softs.end() || obstacle == obstacles.end())
      continue;  // asleep, or not in this step
    t.soft = static_cast<int>(soft - softs.begin());
    t.obstacle = static_cast<int>(obstacle - obstacles.begin());
    lost.emplace(key, t);
  }
  return lost;
}

ContactReport SoftContacts::solve(const std::vector<SoftEntry>& softs,
                                  const std::vector<Obstacle>& obstacles, RigidWorld& rigid,
                                  double h) {
  ContactReport report;
  Touches touches = collect(softs, obstacles, params_.proximity);
  const Touches lost = releaseLost(touches, softs, obstacles);
  std::vector<Eigen::Vector3d> back;
  for (const auto& [key, t] : lost) back.push_back(-h * memory_.at(key).force);
  correct(lost, back, softs, obstacles, rigid, h);
  for (const auto& entry : lost) memory_.erase(entry.first);

  while (!touches.empty() && report.passes < params_.passes) {
    std::vector<ContactRow> rows;
    report.deepest = 0.0;
    for (const auto& [key, t] : touches) {
      rows.push_back(rowOf(t, softs[t.soft], obstacles[t.obstacle], rigid, h));
      report.deepest = std::max(report.deepest, -h * rows.back().free_velocity[0]);
    }
    if (report.passes > 0 && report.deepest <= params_.allowed_depth) break;
    const Eigen::MatrixXd& W = complianceOf(touches, softs, obstacles, rigid, h);
    report.iterations += solveContacts(W, rows, params_.iterations, params_.tolerance).iterations;
    std::vector<Eigen::Vector3d> change;
    size_t i = 0;
    for (const auto& [key, t] : touches) {
      const Eigen::Matrix3d frame = contactFrame(t.normal);
      const ContactRow& row = rows[i++];
      change.push_back(frame.transpose() * (row.impulse - row.start_impulse));
      Memory& m = memory_[key];
      if (t.gap - m.offset > 0.2 * params_.proximity)  // apart: what held it holds no more
        m.held_normal = m.held_tangential = 0.0;
      m.point = t.point;
      m.other = t.other;
      m.place = t.place;
      m.force = frame.transpose() * row.impulse / h;
    }
    correct(touches, change, softs, obstacles, rigid, h);
    ++report.passes;
    touches = collect(softs, obstacles, params_.proximity);
  }
  report.contacts = static_cast<int>(touches.size());
  publish(touches, softs, obstacles);
  return report;
}

void SoftContacts::publish(const Touches& touches, const std::vector<SoftEntry>& softs,
                           const std::vector<Obstacle>& obstacles) {
  contacts_.clear();
  for (const auto& [key, t] : touches) {
    const auto remembered = memory_.find(key);
    if (remembered == memory_.end() || remembered->second.force.isZero(0.0)) continue;
    ContactPoint c;
    c.a = softs[t.soft].name;
    c.b = obstacles[t.obstacle].name;
    c.position = t.place;
    c.normal = t.normal;
    c.force = remembered->second.force;
    c.depth = remembered->second.offset - t.gap;
    contacts_.push_back(c);
  }
}

}  // namespace calipso::fem
