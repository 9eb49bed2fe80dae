#include <algorithm>
#include <chrono>
#include <cmath>

#include "obstacle_query.hpp"
#include "world_impl.hpp"

// What happens between two frames.
namespace calipso::fem {
namespace {

// Rest: slower than this share of the own size per second, for so many frames.
constexpr double kRestSpeed = 1e-3;
constexpr int kCalmFrames = 15;
constexpr int kGoodParts = 2;  // of a step; after so many in a row they are tried twice as long
constexpr double kSameInstant = 1e-9;  // s

double millisecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
      .count();
}

Eigen::AlignedBox3d boxOf(const Vertices& vertices) {
  return {vertices.colwise().minCoeff().transpose(), vertices.colwise().maxCoeff().transpose()};
}

Eigen::AlignedBox3d grown(const Eigen::AlignedBox3d& box, double by) {
  return {box.min().array() - by, box.max().array() + by};
}

}  // namespace

void World::Impl::addSupports(std::vector<Obstacle>& list) const {
  size_t support = 0;
  const auto add = [&](const std::string& name) -> Obstacle& {
    Obstacle o;
    o.id = supportId(support++);
    o.name = name;
    o.surface = params.support;
    return list.emplace_back(o);
  };
  for (const SupportPlane& plane : scene.planes) add(plane.name).plane = &plane;
  for (size_t k = 0; k < scene.support_meshes.size(); ++k)
    add(scene.support_meshes[k].name).tree = support_trees[k].get();
}

Obstacle World::Impl::obstacleOf(Actor& actor, double from, double to) {
  Obstacle o;
  o.id = actor.id;
  o.name = actor.object.name;
  o.surface = actor.settings.surface;
  if (actor.soft) {
    o.soft = actor.soft.get();
    o.tree = &actor.soft->tree();
    return o;
  }
  if (!actor.tree) actor.tree = std::make_unique<SurfaceTree>(actor.object.mesh);
  o.tree = actor.tree.get();
  o.previous_pose = poseOf(actor, from);
  o.pose = poseOf(actor, to);
  if (actor.kind != ObjectKind::kRigid) return o;
  o.rigid = actor.body;
  o.acceleration = rigid.sleeping(*actor.body) ? Eigen::Vector3d::Zero() : actor.acceleration();
  return o;
}

std::vector<Obstacle> World::Impl::obstacles(double from, double to, const Actor* except) {
  std::vector<Obstacle> list;
  addSupports(list);
  for (Actor& actor : actors)
    if (!actor.removed && &actor != except) list.push_back(obstacleOf(actor, from, to));
  if (!except) return list;
  const auto isOwn = [&](const Obstacle& o) {
    return std::find(except->own_supports.begin(), except->own_supports.end(), o.id) !=
           except->own_supports.end();
  };
  list.erase(std::remove_if(list.begin(), list.end(), isOwn), list.end());
  return list;
}

std::vector<SoftEntry> World::Impl::softEntries() {
  std::vector<SoftEntry> list;
  for (Actor& actor : actors)
    if (actor.soft && !actor.removed && !actor.asleep)
      list.push_back({actor.id, actor.object.name, actor.settings.surface, actor.soft.get()});
  return list;
}

// Sub-steps of the deformable objects: eight to a period of the slowest wave through the object,
// within what the user allows.
int World::Impl::substepsPerFrame() const {
  double wanted = 1.0;
  for (const Actor& actor : actors) {
    if (!actor.soft || actor.asleep || actor.removed) continue;
    const double speed = std::sqrt(actor.material.youngs_modulus / actor.material.density);
    const double frequency = speed / (2.0 * boundingDiagonal(actor.object.mesh));
    wanted = std::max(wanted, std::ceil(8.0 * frequency * params.frame_period));
  }
  return static_cast<int>(std::min<double>(wanted, params.max_substeps));
}

void World::Impl::stepFrame(double h) {
  for (Actor& actor : actors) actor.soft_ms = 0.0;
  letGoWhatLostItsRest();
  releaseWhatIsStruck(h);
  wakeDisturbed(h);
  const bool soft = std::any_of(actors.begin(), actors.end(),
                                [](const Actor& a) { return a.soft && !a.removed && !a.asleep; });
  const int parts = soft ? substepsPerFrame() : 1;
  const std::vector<Continued> continuing = continued();
  const double from = now;
  for (int k = 0; k < parts; ++k) {
    substep(now, h / parts);
    now += h / parts;
  }
  actAsObserved(continuing, from);
  updateSleep(h);
}

// From video time `from` on for `span` seconds; the bodies live through speed_scale times as many.
// Where deformable objects do not converge in so long a step, everything takes it in parts.
void World::Impl::substep(double from, double span) {
  const double to = from + span;
  endPulls(from);
  driveAsObserved(to, speed_scale * span);
  const std::vector<SoftEntry> softs = softEntries();
  for (double at = from; at < to - kSameInstant;) {
    const double rest = to - at;
    const double part = !softs.empty() && soft_part < 0.75 * rest ? soft_part : rest;
    applyLoads(at + part, speed_scale * part);
    if (!softs.empty() && !stepSofts(softs, at, part)) continue;
    substeps += std::max(stepRigids(at, part), softs.empty() ? 0 : 1);
    at += part;
  }
}

// @return whether they converge; otherwise nothing has changed, and the next part is half as long
bool World::Impl::stepSofts(const std::vector<SoftEntry>& softs, double at, double part) {
  const auto start = std::chrono::steady_clock::now();
  part_begin = at;
  const ContactReport report =
      contacts.step(softs, obstacles(at, at + part), rigid, speed_scale * part);
  double nodes = 0.0;
  for (const SoftEntry& entry : softs) nodes += entry.soft->body().nodeCount();
  for (const SoftEntry& entry : softs)  // solved together: each has its nodes' share of the time
    actors[entry.id].soft_ms += millisecondsSince(start) * entry.soft->body().nodeCount() / nodes;
  if (report.bodies.empty()) {
    soft_part = 0.5 * part, good_parts = 0;
    return false;
  }
  for (size_t i = 0; i < softs.size(); ++i)
    if (!report.bodies[i].message.empty()) actors[softs[i].id].note = report.bodies[i].message;
  if (++good_parts >= kGoodParts) soft_part *= 2.0, good_parts = 0;
  return true;
}

// @return Bullet's sub-steps
int World::Impl::stepRigids(double at, double part) {
  for (Actor& actor : actors)
    if (actor.body && !actor.simulated())
      rigid.moveKinematic(*actor.body, poseOf(actor, at + part));
  const int steps = rigid.step(speed_scale * part);
  for (TouchEvent touch : rigid.touches()) {
    touch.time = at + touch.time / speed_scale;
    noteTouch(touch);
  }
  return steps;
}

void World::Impl::endPulls(double at) {
  for (Actor& actor : actors) {
    for (const Pull& pull : actor.pulls) {
      if (!pull.over(at) || !actor.soft) continue;
      for (const int node : pull.nodes) actor.soft->body().releaseNode(node);
      for (const auto& region : actor.fixed) actor.soft->body().fixSurfaceVertices(region);
      actor.soft->forgetSystem();
    }
    const auto over = [&](const Pull& pull) { return pull.over(at); };
    actor.pulls.erase(std::remove_if(actor.pulls.begin(), actor.pulls.end(), over),
                      actor.pulls.end());
  }
}

// m, which no point of the object exceeds in the next h of the video.
double World::Impl::wayOf(const Actor& actor, double h) const {
  const double size = boundingDiagonal(actor.object.mesh);
  if (!actor.simulated()) {
    const ObservedMotion seen = actor.track.at(now);
    return h * (seen.linear.norm() + size * seen.angular.norm());
  }
  h *= speed_scale;
  const double gained = h * actor.acceleration().norm();
  if (actor.soft) return h * (actor.soft->fastest() + gained);
  return h * (rigid.linearVelocity(*actor.body).norm() + gained +
              size * rigid.angularVelocity(*actor.body).norm());
}

// Whether anything moves where it may touch a deformable object within the next h of the video.
bool World::Impl::isDisturbed(const Actor& actor, double h) const {
  const auto slow = [](const Actor& a) { return kRestSpeed * boundingDiagonal(a.object.mesh); };
  const auto moves = [&](const Actor& other) {
    // Two that come to rest beside each other do not keep each other awake.
    if (other.soft && !actor.asleep)
      return !other.asleep && !other.soft->body().isAtRest(slow(other));
    if (other.soft) return !other.asleep && other.calm_frames == 0;
    if (other.kind == ObjectKind::kRigid) return !rigid.sleeping(*other.body);
    return isOnTheMove(other.track.at(now), boundingDiagonal(other.object.mesh),
                       params.frame_period);
  };
  const Eigen::AlignedBox3d near = boxNear(actor);
  return std::any_of(actors.begin(), actors.end(), [&](const Actor& other) {
    return &other != &actor && !other.removed && moves(other) &&
           near.intersects(grown(boxOf(verticesOf(other)), wayOf(other, h)));
  });
}

// What sleeps beside an object that is about to be elsewhere may have rested on it, and others on
// that; what sleeps where it has been put is in its way.
void World::Impl::wakeAround(const Actor& actor) {
  if (actor.removed) return;
  const Eigen::AlignedBox3d box = boxOf(verticesOf(actor));
  for (Actor& other : actors) {
    if (&other == &actor || !sleeps(other) || !boxNear(other).intersects(box)) continue;
    wake(other);
    wakeAround(other);
  }
}

// Where it may touch others, or rest on them.
Eigen::AlignedBox3d World::Impl::boxNear(const Actor& actor) const {
  return grown(boxOf(verticesOf(actor)), kRestingGap * boundingDiagonal(actor.object.mesh));
}

// A deformable object wakes before something that moves reaches it, or it would be passed through,
void World::Impl::wakeDisturbed(double h) {
  for (Actor& actor : actors)
    if (actor.asleep && isDisturbed(actor, h)) wake(actor);
}

// and sleeps once it has been still.
void World::Impl::updateSleep(double h) {
  for (Actor& actor : actors) {
    if (!actor.soft || actor.removed || actor.asleep) continue;
    const double slow = kRestSpeed * boundingDiagonal(actor.object.mesh);
    const bool calm = actor.pulls.empty() && actor.air.empty() && !actor.drive &&
                      actor.soft->body().isAtRest(slow) && !isDisturbed(actor, h);
    actor.calm_frames = calm ? actor.calm_frames + 1 : 0;
    actor.asleep = actor.calm_frames >= kCalmFrames;
  }
}

}  // namespace calipso::fem
