#include <algorithm>
#include <cmath>
#include <set>

#include "calipso_fem/world/soft_contacts.hpp"
#include "obstacle_query.hpp"
#include "step_motion.hpp"

namespace calipso::fem {
namespace {

double sizeOf(const SoftObject& soft) {
  return (soft.vertices().colwise().maxCoeff() - soft.vertices().colwise().minCoeff()).norm();
}

Eigen::AlignedBox3d boxOf(const SoftObject& soft, double margin) {
  const Eigen::Vector3d low = soft.vertices().colwise().minCoeff().transpose(),
                        high = soft.vertices().colwise().maxCoeff().transpose();
  return {low.array() - margin, high.array() + margin};
}

int mainVertex(const SurfacePoint& point) {
  int k = 0;
  point.weights.maxCoeff(&k);
  return point.vertices[k];
}

int indexOf(const std::vector<SoftEntry>& softs, const SoftObject* soft) {
  for (size_t i = 0; i < softs.size(); ++i)
    if (softs[i].soft == soft) return static_cast<int>(i);
  return -1;
}

// The contact of a deformable's surface point with an obstacle that was found at `hit`.
Contact contactAt(const Contact::Key& key, int soft, int index, const Obstacle& obstacle,
                  int soft_b, const SurfacePoint& point, const ObstacleHit& hit) {
  Contact c;
  c.key = key;
  c.soft_a = soft;
  c.soft_b = soft_b;
  c.obstacle = index;
  c.rigid_b = obstacle.rigid;
  c.point = point;
  c.other = hit.other;
  c.place = hit.place;
  c.normal = hit.normal;
  c.start_gap = hit.gap;
  if (!obstacle.rigid && obstacle.tree)
    c.motion = obstacle.pose * (obstacle.previous_pose.inverse() * hit.place) - hit.place;
  return c;
}

ObstacleHit toWorld(const SurfaceHit& hit, const SurfaceTree& tree, const Eigen::Isometry3d& pose) {
  ObstacleHit h{hit.distance, pose.linear() * hit.normal, pose * hit.point, {}};
  h.other = SurfacePoint::onTriangle(tree.mesh().triangles.row(hit.triangle).transpose(),
                                     hit.barycentric);
  return h;
}

// Where a deformable surface is folded or inside out, points outside may seem to be deep inside.
bool misjudged(const ObstacleHit& hit, const SurfaceTree& tree, const Eigen::Vector3d& x,
               double reach) {
  constexpr double kShallow = 0.1;  // minimal distances
  return hit.gap < -kShallow * reach && !encloses(tree.mesh(), x);
}

// Fastest approach of the two in this step, m: bounds how far away a contact can come from.
double travelOf(const SoftObject& soft, const Obstacle& obstacle, const RigidWorld& rigid,
                double h) {
  double way = h * soft.fastest() + h * h * soft.gravity().norm();
  if (obstacle.soft) {
    way += h * obstacle.soft->fastest() + h * h * obstacle.soft->gravity().norm();
  } else if (obstacle.rigid) {
    const double radius = obstacle.tree->bounds().diagonal().norm();
    way += h * (rigid.linearVelocity(*obstacle.rigid).norm() + h * obstacle.acceleration.norm() +
                radius * rigid.angularVelocity(*obstacle.rigid).norm());
  } else if (obstacle.tree) {
    for (int c = 0; c < 8; ++c) {
      const Eigen::Vector3d corner =
          obstacle.tree->bounds().corner(static_cast<Eigen::AlignedBox3d::CornerType>(c));
      way = std::max(way, h * soft.fastest() +
                              (obstacle.pose * corner - obstacle.previous_pose * corner).norm());
    }
  }
  return way;
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

double SoftContacts::reachOf(const SoftEntry& entry, const Obstacle& obstacle) const {
  const auto rule = rules_.find(std::minmax({entry.id, obstacle.id}));
  if (rule != rules_.end() && rule->second.proximity) return *rule->second.proximity;
  const double own = std::max(entry.surface.proximity, obstacle.surface.proximity);
  return own > 0.0 ? own : params_.proximity;
}

void SoftContacts::forget(int id) {
  for (auto it = memory_.begin(); it != memory_.end();)
    it = std::get<0>(it->first) == id || std::get<1>(it->first) == id ? memory_.erase(it)
                                                                      : std::next(it);
}

Contact SoftContacts::completed(Contact contact) const {
  const auto known = memory_.find(contact.key);
  if (known == memory_.end()) return contact;
  const Memory& m = known->second;
  contact.offset = m.offset;
  contact.held_normal = m.held_normal;
  contact.held_tangential = m.held_tangential;
  contact.force = m.force;
  return contact;
}

std::vector<SoftContacts::Candidate> SoftContacts::candidates(
    const std::vector<SoftEntry>& softs, const std::vector<Obstacle>& obstacles,
    const RigidWorld& rigid, double h) const {
  std::vector<Candidate> list;
  for (size_t s = 0; s < softs.size(); ++s) {
    for (size_t o = 0; o < obstacles.size(); ++o) {
      // Each pair of moving deformable objects is looked at once.
      const bool twin = obstacles[o].soft && obstacles[o].id < softs[s].id &&
                        indexOf(softs, obstacles[o].soft) >= 0;
      if (meets(softs[s].id, obstacles[o].id) && !twin)
        watchPair(softs, static_cast<int>(s), obstacles, static_cast<int>(o), rigid, h, list);
    }
    if (softs[s].soft->selfProximity()) watchSelf(softs, static_cast<int>(s), obstacles, h, list);
  }
  return list;
}

double SoftContacts::watchOf(const SoftEntry& entry, const Obstacle& obstacle,
                             const RigidWorld& rigid, double h) const {
  const double reach = reachOf(entry, obstacle);
  double watch = reach + travelOf(*entry.soft, obstacle, rigid, h);
  // Observed gaps may be larger than the reach.
  for (auto it = memory_.lower_bound({entry.id, obstacle.id, 0, 0});
       it != memory_.end() && std::get<0>(it->first) == entry.id &&
       std::get<1>(it->first) == obstacle.id;
       ++it)
    watch = std::max(watch, reach + it->second.offset);
  return watch;
}

// A deformable object and what it may meet, as they are at the start of a step.
struct SoftContacts::WatchedPair {
  const SoftEntry& entry;
  const Obstacle& obstacle;
  int soft, soft_b, index;  // places in the lists; soft_b -1 where the obstacle is not deformable
  double reach, watch, friction, size;
  Eigen::AlignedBox3d own, others;  // both grown by `watch`; others empty for a plane
};

void SoftContacts::watchPair(const std::vector<SoftEntry>& softs, int soft,
                             const std::vector<Obstacle>& obstacles, int index,
                             const RigidWorld& rigid, double h,
                             std::vector<Candidate>& list) const {
  const SoftEntry& entry = softs[soft];
  const Obstacle& obstacle = obstacles[index];
  const double watch = watchOf(entry, obstacle, rigid, h);
  const Eigen::AlignedBox3d own = boxOf(*entry.soft, watch);
  Eigen::AlignedBox3d others = obstacleBounds(obstacle);
  if (!others.isEmpty() && !others.intersects(own)) return;
  if (!others.isEmpty()) others = {others.min().array() - watch, others.max().array() + watch};
  const int soft_b = obstacle.soft ? indexOf(softs, obstacle.soft) : -1;
  const WatchedPair pair{entry,
                         obstacle,
                         soft,
                         soft_b,
                         index,
                         reachOf(entry, obstacle),
                         watch,
                         frictionOf(entry, obstacle),
                         sizeOf(*entry.soft),
                         own,
                         others};
  watchOwnVertices(pair, softs, list);
  if (!obstacle.plane) watchTheirVertices(pair, softs, list);
}

void SoftContacts::watchVertex(const WatchedPair& pair, const std::vector<SoftEntry>& softs,
                               Contact contact, bool reversed, int vertex,
                               std::vector<Candidate>& list) const {
  // Between what is held and what does not move no force would change anything.
  const bool other_held = pair.soft_b < 0 || softs[pair.soft_b].soft->isHeld(contact.other);
  if (!contact.rigid_b && other_held && pair.entry.soft->isHeld(contact.point)) return;
  contact.reach = pair.reach;
  contact.friction = pair.friction;
  contact = completed(contact);
  const bool near = pair.obstacle.plane || contact.start_gap - contact.offset <= pair.reach;
  contact.force.setZero();
  list.push_back({contact, reversed, vertex, near});
}

void SoftContacts::watchOwnVertices(const WatchedPair& pair, const std::vector<SoftEntry>& softs,
                                    std::vector<Candidate>& list) const {
  const Obstacle& obstacle = pair.obstacle;
  const auto& vertices = pair.entry.soft->vertices();
  for (int v = 0; v < vertices.rows(); ++v) {
    const Eigen::Vector3d x = vertices.row(v).transpose();
    if (!pair.others.isEmpty() && !pair.others.contains(x)) continue;
    const auto hit = queryObstacle(obstacle, x, pair.watch, pair.size);
    if (!hit || (obstacle.soft && misjudged(*hit, *obstacle.tree, x, pair.reach))) continue;
    const Contact::Key key{pair.entry.id, obstacle.id, v, Contact::kNearest};
    watchVertex(
        pair, softs,
        contactAt(key, pair.soft, pair.index, obstacle, pair.soft_b, SurfacePoint::vertex(v), *hit),
        false, v, list);
  }
}

void SoftContacts::watchTheirVertices(const WatchedPair& pair, const std::vector<SoftEntry>& softs,
                                      std::vector<Candidate>& list) const {
  const Obstacle& obstacle = pair.obstacle;
  Obstacle self;  // the deformable object as an obstacle for the other's vertices
  self.tree = &pair.entry.soft->tree();
  const auto& vertices = obstacle.tree->mesh().vertices;
  for (int v = 0; v < vertices.rows(); ++v) {
    const Eigen::Vector3d x = obstacle.previous_pose * Eigen::Vector3d(vertices.row(v).transpose());
    if (!pair.own.contains(x)) continue;
    const auto hit = queryObstacle(self, x, pair.watch, pair.size);
    if (!hit || misjudged(*hit, *self.tree, x, pair.reach)) continue;
    const ObstacleHit turned{hit->gap, -hit->normal, x, SurfacePoint::vertex(v)};
    const Contact::Key key{pair.entry.id, obstacle.id, v, Contact::kNearestReversed};
    watchVertex(pair, softs,
                contactAt(key, pair.soft, pair.index, obstacle, pair.soft_b, hit->other, turned),
                true, v, list);
  }
}

// The way of the vertex relative to the other surface, followed where that surface was at the
// start.
std::optional<Contact> SoftContacts::crossing(const Candidate& c,
                                              const std::vector<Obstacle>& obstacles,
                                              const std::vector<SoftEntry>& softs,
                                              const StepMotion& motion) const {
  const Obstacle& obstacle = obstacles[c.contact.obstacle];
  if (obstacle.plane) return std::nullopt;
  if (c.contact.ofOneBody()) return crossingItself(c, softs, motion);
  const SoftEntry& entry = softs[c.contact.soft_a];
  Contact::Key key = c.contact.key;
  const Eigen::Vector3d slip = motion.slip(c.contact);
  Contact found;
  if (c.reversed) {
    const auto hit = entry.soft->tree().firstEntry(c.contact.place, c.contact.place - slip);
    if (!hit) return std::nullopt;
    std::get<3>(key) = Contact::kCrossingReversed;
    const ObstacleHit at = toWorld(*hit, entry.soft->tree(), Eigen::Isometry3d::Identity());
    const double gap = at.normal.dot(c.contact.place - at.place);
    found = contactAt(key, c.contact.soft_a, c.contact.obstacle, obstacle, c.contact.soft_b,
                      at.other, {gap, -at.normal, c.contact.place, c.contact.other});
  } else {
    const Eigen::Vector3d x = entry.soft->vertices().row(c.vertex).transpose();
    const Eigen::Isometry3d to_tree = obstacle.previous_pose.inverse();
    const auto hit = obstacle.tree->firstEntry(to_tree * x, to_tree * Eigen::Vector3d(x + slip));
    if (!hit) return std::nullopt;
    std::get<3>(key) = Contact::kCrossing;
    ObstacleHit at = toWorld(*hit, *obstacle.tree, obstacle.previous_pose);
    at.gap = at.normal.dot(x - at.place);
    found = contactAt(key, c.contact.soft_a, c.contact.obstacle, obstacle, c.contact.soft_b,
                      SurfacePoint::vertex(c.vertex), at);
  }
  found.reach = c.contact.reach;
  found.friction = c.contact.friction;
  return found;
}

// Which nodes a contact is between: those that carry most of it on either side.
SoftContacts::Neighbourhood SoftContacts::neighbourhoodOf(
    const Contact& c, const std::vector<SoftEntry>& softs) const {
  const int a = c.soft_a >= 0 ? softs[c.soft_a].soft->carrier(mainVertex(c.point)) : -1;
  const int b = c.soft_b >= 0 ? softs[c.soft_b].soft->carrier(mainVertex(c.other)) : -1;
  return {c.soft_a, c.obstacle, a, b};
}

int SoftContacts::grow(const std::vector<Candidate>& list, const std::vector<Obstacle>& obstacles,
                       const std::vector<SoftEntry>& softs, const StepMotion& motion,
                       Contacts& contacts) const {
  // A neighbourhood gets its deepest contact first, others only when that does not hold them out.
  constexpr double kHeldOut = 0.04;  // of the minimal distance
  std::set<Neighbourhood> served;
  for (const auto& [key, c] : contacts) served.insert(neighbourhoodOf(c, softs));
  std::map<Neighbourhood, std::pair<double, Contact>> deepest;
  for (const Candidate& c : list) {
    // A point that was near is kept on its side; one from afar only if its way crosses a surface.
    Contact contact = c.contact;
    double depth = -motion.clearance(contact);
    if (!c.near || motion.slip(c.contact).norm() > c.contact.reach) {
      if (const auto crossed = crossing(c, obstacles, softs, motion)) {
        const bool other_side = crossed->normal.dot(contact.normal) < 0.9;
        if (!c.near || (other_side && contacts.count(contact.key))) {
          contact = *crossed;
          depth = -motion.clearance(contact);
        }
      } else if (!c.near) {
        continue;
      }
    }
    if (depth <= 0.1 * params_.allowed_depth || contacts.count(contact.key)) continue;
    const Neighbourhood place = neighbourhoodOf(contact, softs);
    if (served.count(place) && depth <= kHeldOut * contact.reach) continue;
    const auto [at, is_new] = deepest.emplace(place, std::make_pair(depth, contact));
    if (!is_new && depth > at->second.first) at->second = {depth, contact};
  }
  for (const auto& [place, found] : deepest) contacts.emplace(found.second.key, found.second);
  return static_cast<int>(deepest.size());
}

std::vector<std::pair<HoldPoint, int>> SoftContacts::touching(
    const SoftEntry& entry, const std::vector<Obstacle>& obstacles, double reach) const {
  std::vector<std::pair<HoldPoint, int>> points;
  const double size = sizeOf(*entry.soft);
  const auto& vertices = entry.soft->vertices();
  for (size_t o = 0; o < obstacles.size(); ++o) {
    if (!meets(entry.id, obstacles[o].id)) continue;
    std::map<int, std::pair<double, int>> lowest;  // by carrier node
    for (int v = 0; v < vertices.rows(); ++v) {
      const auto hit = queryObstacle(obstacles[o], vertices.row(v).transpose(), reach, size);
      if (!hit) continue;
      const auto [at, is_new] = lowest.emplace(entry.soft->carrier(v), std::make_pair(hit->gap, v));
      if (!is_new) at->second = std::min(at->second, std::make_pair(hit->gap, v));
    }
    for (const auto& [carrier, found] : lowest)
      points.push_back({{found.second, Eigen::Vector3d::Zero()}, static_cast<int>(o)});
  }
  return points;
}

void SoftContacts::hold(const SoftEntry& entry, const Obstacle& obstacle, const HoldPoint& point,
                        double reach) {
  const double size = sizeOf(*entry.soft);
  const auto& vertices = entry.soft->vertices();
  const auto known = memory_.lower_bound({entry.id, obstacle.id, 0, 0});
  const bool first = known == memory_.end() || std::get<0>(known->first) != entry.id ||
                     std::get<1>(known->first) != obstacle.id;
  // What else is inside is forgiven, as far as it is.
  for (int v = 0; first && v < vertices.rows(); ++v) {
    const auto hit = queryObstacle(obstacle, vertices.row(v).transpose(), 0.0, size);
    if (hit && hit->gap < 0.0)
      memory_[{entry.id, obstacle.id, v, Contact::kNearest}].offset = hit->gap;
  }
  const auto hit = queryObstacle(obstacle, entry.soft->position(SurfacePoint::vertex(point.vertex)),
                                 reach, size);
  if (!hit) return;
  Memory m;
  m.holds = true;
  m.force = point.force;
  m.offset = hit->gap;
  const double normal = hit->normal.dot(point.force);
  const double friction = frictionOf(entry, obstacle);
  m.held_normal = std::max(0.0, -normal);
  m.held_tangential = std::max(
      0.0, (point.force - normal * hit->normal).norm() - friction * (normal + m.held_normal));
  memory_[{entry.id, obstacle.id, point.vertex, Contact::kNearest}] = m;
}

}  // namespace calipso::fem
