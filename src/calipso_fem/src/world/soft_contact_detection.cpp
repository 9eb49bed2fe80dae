#include <algorithm>
#include <cmath>

#include "calipso_fem/world/soft_contacts.hpp"
#include "obstacle_query.hpp"

namespace calipso::fem {
namespace {

Eigen::AlignedBox3d sweptBounds(const SoftObject& soft, double margin) {
  Eigen::AlignedBox3d box;
  for (const auto* vertices : {&soft.vertices(), &soft.previousVertices()}) {
    box.extend(vertices->colwise().minCoeff().transpose());
    box.extend(vertices->colwise().maxCoeff().transpose());
  }
  return {box.min().array() - margin, box.max().array() + margin};
}

double sizeOf(const SoftObject& soft) {
  return (soft.vertices().colwise().maxCoeff() - soft.vertices().colwise().minCoeff()).norm();
}

int mainVertex(const SurfacePoint& point) {
  int k = 0;
  point.weights.maxCoeff(&k);
  return point.vertices[k];
}

}  // namespace

bool SoftContacts::meets(int a, int b) const {
  const auto rule = rules_.find(std::minmax({a, b}));
  return a != b && (rule == rules_.end() || rule->second.contact);
}

void SoftContacts::setRule(int a, int b, const PairRule& rule) {
  rules_[std::minmax({a, b})] = rule;
  if (rule.contact) return;
  for (auto it = memory_.begin(); it != memory_.end();) {
    const auto pair = std::minmax({std::get<0>(it->first), std::get<1>(it->first)});
    it = pair == std::minmax({a, b}) ? memory_.erase(it) : std::next(it);
  }
}

double SoftContacts::frictionOf(const SoftEntry& entry, const Obstacle& obstacle) const {
  const auto rule = rules_.find(std::minmax({entry.id, obstacle.id}));
  if (rule != rules_.end() && rule->second.friction) return *rule->second.friction;
  return std::sqrt(entry.surface.friction * obstacle.surface.friction);
}

void SoftContacts::forget(int id) {
  for (auto it = memory_.begin(); it != memory_.end();)
    it = std::get<0>(it->first) == id || std::get<1>(it->first) == id ? memory_.erase(it)
                                                                      : std::next(it);
}

// Keeps the deepest touch of a key; the vertex of the last step has a small advantage, so that
// contacts do not flicker between neighbours.
void SoftContacts::offer(const Touch& touch, double reach, Touches& touches) const {
  const auto remembered = memory_.find(touch.key);
  const double offset = remembered == memory_.end() ? 0.0 : remembered->second.offset;
  if (touch.gap - offset > reach) return;
  const auto advantage = [&](const Touch& t) {
    return remembered != memory_.end() &&
                   mainVertex(remembered->second.point) == mainVertex(t.point)
               ? 1e-3 * params_.proximity
               : 0.0;
  };
  const auto [at, is_new] = touches.emplace(touch.key, touch);
  if (!is_new && touch.gap - advantage(touch) < at->second.gap - advantage(at->second))
    at->second = touch;
}

void SoftContacts::addVertices(const SoftEntry& entry, int soft, const Obstacle& obstacle,
                               int index, double reach, Touches& touches) const {
  const auto& now = entry.soft->vertices();
  const auto& before = entry.soft->previousVertices();
  const double size = sizeOf(*entry.soft);
  Eigen::AlignedBox3d bounds = obstacleBounds(obstacle);
  const bool everywhere = bounds.isEmpty();
  bounds = {bounds.min().array() - reach, bounds.max().array() + reach};
  // Observed gaps may be larger than the reach; their offsets are subtracted in offer().
  double farthest = reach;
  for (auto it = memory_.lower_bound({entry.id, obstacle.id, 0, false});
       it != memory_.end() && std::get<0>(it->first) == entry.id &&
       std::get<1>(it->first) == obstacle.id;
       ++it)
    farthest = std::max(farthest, reach + it->second.offset);
  for (int v = 0; v < now.rows(); ++v) {
    const Eigen::Vector3d x = now.row(v).transpose(), x0 = before.row(v).transpose();
    if (!everywhere && !bounds.intersects({x.cwiseMin(x0), x.cwiseMax(x0)})) continue;
    const auto hit = queryObstacle(obstacle, x0, x, farthest, size);
    if (!hit) continue;
    const Key key{entry.id, obstacle.id, entry.soft->carrier(v), false};
    offer(
        {key, soft, index, SurfacePoint::vertex(v), hit->other, hit->place, hit->normal, hit->gap},
        reach, touches);
  }
}

void SoftContacts::addObstacleVertices(const SoftEntry& entry, int soft, const Obstacle& obstacle,
                                       int index, double reach, Touches& touches) const {
  Obstacle self;  // the deformable object as an obstacle for the other's vertices
  self.tree = &entry.soft->tree();
  self.soft = entry.soft;
  const Eigen::AlignedBox3d bounds = sweptBounds(*entry.soft, reach);
  const double size = sizeOf(*entry.soft);
  const auto& vertices = obstacle.tree->mesh().vertices;
  for (int v = 0; v < vertices.rows(); ++v) {
    const Eigen::Vector3d x = obstacle.pose * Eigen::Vector3d(vertices.row(v).transpose());
    if (!bounds.contains(x)) continue;
    const Eigen::Vector3d x0 =
        obstacle.soft ? Eigen::Vector3d(obstacle.soft->previousVertices().row(v).transpose())
                      : obstacle.previous_pose * Eigen::Vector3d(vertices.row(v).transpose());
    const auto hit = queryObstacle(self, x0, x, reach, size);
    if (!hit) continue;
    const Key key{entry.id, obstacle.id, entry.soft->carrier(mainVertex(hit->other)), true};
    offer({key, soft, index, hit->other, SurfacePoint::vertex(v), x, -hit->normal, hit->gap}, reach,
          touches);
  }
}

SoftContacts::Touches SoftContacts::collect(const std::vector<SoftEntry>& softs,
                                            const std::vector<Obstacle>& obstacles,
                                            double reach) const {
  Touches touches;
  for (size_t s = 0; s < softs.size(); ++s)
    for (size_t o = 0; o < obstacles.size(); ++o) {
      const SoftEntry& entry = softs[s];
      const Obstacle& obstacle = obstacles[o];
      // Each pair of deformable objects is looked at once.
      if (!meets(entry.id, obstacle.id) || (obstacle.soft && obstacle.id < entry.id)) continue;
      const Eigen::AlignedBox3d box = obstacleBounds(obstacle);
      if (!box.isEmpty() && !box.intersects(sweptBounds(*entry.soft, reach))) continue;
      addVertices(entry, static_cast<int>(s), obstacle, static_cast<int>(o), reach, touches);
      if (!obstacle.plane)
        addObstacleVertices(entry, static_cast<int>(s), obstacle, static_cast<int>(o), reach,
                            touches);
    }
  return touches;
}

std::vector<std::pair<HoldPoint, int>> SoftContacts::touching(
    const SoftEntry& entry, const std::vector<Obstacle>& obstacles, double reach) const {
  std::vector<std::pair<HoldPoint, int>> points;
  for (size_t o = 0; o < obstacles.size(); ++o) {
    if (!meets(entry.id, obstacles[o].id)) continue;
    Touches touches;
    addVertices(entry, 0, obstacles[o], static_cast<int>(o), reach, touches);
    for (const auto& [key, touch] : touches)
      points.push_back({{mainVertex(touch.point), Eigen::Vector3d::Zero()}, static_cast<int>(o)});
  }
  return points;
}

void SoftContacts::hold(const SoftEntry& entry, const Obstacle& obstacle, const HoldPoint& point,
                        double reach) {
  const Eigen::Vector3d x = entry.soft->position(SurfacePoint::vertex(point.vertex));
  const auto hit = queryObstacle(obstacle, x, x, reach, sizeOf(*entry.soft));
  if (!hit) return;
  Memory m;
  m.point = SurfacePoint::vertex(point.vertex);
  m.other = hit->other;
  m.place = hit->place;
  m.force = point.force;
  m.offset = hit->gap;
  const double normal = hit->normal.dot(point.force);
  const double friction = frictionOf(entry, obstacle);
  m.held_normal = std::max(0.0, -normal);
  m.held_tangential = std::max(
      0.0, (point.force - normal * hit->normal).norm() - friction * (normal + m.held_normal));
  memory_[{entry.id, obstacle.id, entry.soft->carrier(point.vertex), false}] = m;
}

}  // namespace calipso::fem
