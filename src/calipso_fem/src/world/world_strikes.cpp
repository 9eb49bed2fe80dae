#include <algorithm>
#include <cmath>
#include <limits>

#include "obstacle_query.hpp"
#include "world_impl.hpp"

// What something edited is about to strike, or strikes in the video, where it may be elsewhere now:
// it leaves its place in the video, with the velocity it has there. A blow counts that sends it
// further than can be overlooked,
//   v m_a / (m_a + m_b) > sqrt(2 mu g s)
//  v         m/s, at which the surfaces close
//  m_a, m_b  kg, of what strikes and what is struck
//  mu, g, s  friction, m/s^2, and the way (m) it would slide
namespace calipso::fem {
namespace {

constexpr double kOverlooked = 0.01;  // of its size, of the way it would slide

// Velocity of a body's points.
struct VelocityField {
  Eigen::Vector3d center, linear, angular;
  Eigen::Vector3d at(const Eigen::Vector3d& x) const { return linear + angular.cross(x - center); }
};

Eigen::AlignedBox3d boxAround(const Vertices& points, double reach) {
  return {points.colwise().minCoeff().transpose().array() - reach,
          points.colwise().maxCoeff().transpose().array() + reach};
}

// The vertices of a surface and the middles of its triangles' sides: edges may meet, too.
Vertices samplesOf(const Vertices& vertices, const TriangleMesh& mesh) {
  const int n = static_cast<int>(vertices.rows());
  Vertices samples(n + 3 * mesh.triangleCount(), 3);
  samples.topRows(n) = vertices;
  for (int t = 0; t < mesh.triangleCount(); ++t)
    for (int i = 0; i < 3; ++i)
      samples.row(n + 3 * t + i) =
          0.5 * (vertices.row(mesh.triangles(t, i)) + vertices.row(mesh.triangles(t, (i + 1) % 3)));
  return samples;
}

// How fast the points close with an obstacle that they reach within h, m/s; 0: none does.
double closingSpeed(const Vertices& points, const VelocityField& own, const Obstacle& obstacle,
                    const VelocityField& other, double h, double size) {
  double fastest = 0.0;
  const double furthest =
      h * ((own.linear - other.linear).norm() + size * (own.angular - other.angular).norm());
  Eigen::AlignedBox3d near = obstacleBounds(obstacle);
  near = {near.min().array() - furthest, near.max().array() + furthest};
  for (int k = 0; k < points.rows(); ++k) {
    const Eigen::Vector3d x = points.row(k).transpose();
    if (!near.contains(x)) continue;
    const auto hit = queryObstacle(obstacle, x, furthest, size);
    if (!hit) continue;
    const double closing = -(own.at(x) - other.at(x)).dot(hit->normal);
    if (hit->gap <= closing * h) fastest = std::max(fastest, closing);
  }
  return fastest;
}

}  // namespace

// As the user wants it, or else the simplest kind that moves.
ObjectKind World::Impl::kindWhenFree(const Actor& actor) const {
  return actor.forced_kind.value_or(actor.settings.kind.value_or(ObjectKind::kRigid));
}

bool World::Impl::canBeStruck(const Actor& actor) const {
  const ObjectKind kind = kindWhenFree(actor);
  return actor.followsVideo() && !actor.immovable && !actor.flat &&
         actor.object.attachments.empty() && actor.modes.cols() == 0 &&
         (kind == ObjectKind::kRigid || kind == ObjectKind::kDeformable);
}

// m/s, within the next h of the video; 0: they do not meet.
double World::Impl::closingSpeedOf(const Actor& striker, const Actor& struck, double h) {
  if (!meet(striker.id, struck.id)) return 0.0;
  const auto fieldOf = [&](const Actor& actor) {
    const BodyMotion m = motionOf(actor);
    const double pace = actor.simulated() ? 1.0 : 1.0 / speed_scale;  // in simulated seconds
    return VelocityField{m.world_from_object * centerOfMass(actor), pace * m.linear,
                         pace * m.angular};
  };
  h *= speed_scale;
  const VelocityField a = fieldOf(striker), b = fieldOf(struck);
  const double size =
      std::max(boundingDiagonal(striker.object.mesh), boundingDiagonal(struck.object.mesh));
  const double reach = h * ((a.linear - b.linear).norm() + size * (a.angular - b.angular).norm());
  const Vertices on_a = verticesOf(striker), on_b = verticesOf(struck);
  if (!boxAround(on_a, reach).intersects(boxAround(on_b, 0.0))) return 0.0;
  double fastest = 0.0;
  for (const Obstacle& obstacle : obstacles(now, now)) {
    if (obstacle.id == struck.id)
      fastest = std::max(
          fastest, closingSpeed(samplesOf(on_a, striker.object.mesh), a, obstacle, b, h, size));
    if (obstacle.id == striker.id)
      fastest = std::max(
          fastest, closingSpeed(samplesOf(on_b, struck.object.mesh), b, obstacle, a, h, size));
  }
  return fastest;
}

// Whether the one sets the other in motion in the video, shortly after now: both collide at once,
// and close to each other.
bool World::Impl::strikesInVideo(const Actor& striker, const Actor& struck, double h) const {
  constexpr double kAtOnce = 1.5;  // frames; each instant is found to half a frame or so
  constexpr double kNear = 0.05;   // of the size
  const double period = params.frame_period;
  const double near = kNear * boundingDiagonal(struck.object.mesh);
  const auto boxAt = [](const Actor& actor, double time, double reach) {
    const Eigen::Isometry3d pose = actor.track.at(time).world_from_object;
    return boxAround(placed(actor.object.mesh, pose).vertices, reach);
  };
  for (const double t : struck.collisions) {
    if (t <= now || t - period > now + h) continue;
    const bool at_once =
        std::any_of(striker.collisions.begin(), striker.collisions.end(),
                    [&](double other) { return std::abs(other - t) <= kAtOnce * period; });
    if (at_once && boxAt(striker, t, near).intersects(boxAt(struck, t, 0.0))) return true;
  }
  return false;
}

// What no body can be made of stays where the video has it.
void World::Impl::letGo(Actor& actor, const std::string& why) {
  noteWhatRestsOn(actor);
  try {
    become(actor, kindWhenFree(actor), why);
    wake(actor);
  } catch (const std::invalid_argument& error) {
    actor.reason = why + ", but it stays: " + error.what();
    plan_changed = true;
  }
}

bool World::Impl::isStruckHard(const Actor& actor, const Actor& striker, double h) {
  const double way = kOverlooked * boundingDiagonal(actor.object.mesh);
  const double least =
      std::sqrt(2.0 * actor.settings.surface.friction * scene.gravity.norm() * way);
  const double share =
      striker.simulated() ? massOf(striker) / (massOf(striker) + massOf(actor)) : 1.0;
  return share * closingSpeedOf(striker, actor, h) > least;
}

void World::Impl::releaseWhatIsStruck(double h) {
  for (Actor& actor : actors) {
    if (!canBeStruck(actor)) continue;
    for (const Actor& striker : actors) {
      if (&striker == &actor || striker.continues || striker.followsVideo()) continue;
      if (strikesInVideo(striker, actor, h)) {
        letGo(actor, "what strikes it in the video, " + striker.object.name + ", is edited");
        break;
      }
      if (striker.removed || striker.asleep || !isStruckHard(actor, striker, h)) continue;
      letGo(actor, striker.object.name + " strikes it");
      actor.continues = actor.kind == ObjectKind::kRigid && striker.kind != ObjectKind::kDeformable;
      break;
    }
  }
}

}  // namespace calipso::fem
