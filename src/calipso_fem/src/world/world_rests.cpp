#include <algorithm>

#include "obstacle_query.hpp"
#include "world_impl.hpp"

// What rests on an object in the video: it goes on resting there while that stays, and is let go
// once that moves away.
namespace calipso::fem {
namespace {

constexpr double kFollows = 0.01;  // of the size: by so much the place has to move

}  // namespace

bool isOnTheMove(const ObservedMotion& seen, double size, double frame_period) {
  return seen.moving &&
         (seen.linear.norm() + 0.5 * size * seen.angular.norm()) * frame_period > kFollows * size;
}

void World::Impl::noteWhatRestsOn(const Actor& carrier) {
  if (!carrier.followsVideo()) return;
  const auto isOwn = [&](int id) {
    return std::find(carrier.own_supports.begin(), carrier.own_supports.end(), id) !=
           carrier.own_supports.end();
  };
  const auto isKnown = [&](int id) {
    return std::any_of(rests.begin(), rests.end(), [&](const Rest& rest) {
      return rest.actor == id && rest.carrier == carrier.id;
    });
  };
  for (Actor& actor : actors) {
    if (&actor == &carrier || !actor.followsVideo() || isKnown(actor.id)) continue;
    if (!actor.object.attachments.empty()) continue;
    const double size = boundingDiagonal(actor.object.mesh);
    if (isOnTheMove(actor.track.at(now), size, params.frame_period)) continue;
    const TriangleMesh surface = placed(actor.object.mesh, poseOf(actor, now));
    bool carried_otherwise = false;
    std::optional<ObstacleHit> on;
    for (const Obstacle& obstacle : obstacles(now, now, &actor)) {
      if (isOwn(obstacle.id)) continue;
      const auto hit = carrying(obstacle, surface, scene.gravity, kSupportGap * size);
      if (obstacle.id == carrier.id)
        on = hit;
      else
        carried_otherwise |= hit.has_value();
    }
    if (!on || carried_otherwise) continue;
    const auto place =
        SurfaceTree(placed(carrier.object.mesh, poseOf(carrier, now))).nearest(on->place, size);
    if (!place) continue;
    rests.push_back({actor.id, carrier.id, place->triangle, place->barycentric, place->point});
    actor.holder = Holder::kSupport;
    setPressing(rests.back(), false);
  }
}

// Until an object is let go it does not press on what carries it: a fit is never so good that the two
// only just touch, and what cannot give way would push a deformable carrier out of itself.
void World::Impl::setPressing(const Rest& rest, bool presses) {
  PairRule rule = pairRule(actors[rest.actor].object.name, actors[rest.carrier].object.name);
  rule.contact = rule.contact && presses;
  contacts.setRule(rest.actor, rest.carrier, rule);
}

void World::Impl::letGoWhatLostItsRest() {
  const auto lost = [&](const Rest& rest) {
    const Actor& carrier = actors[rest.carrier];
    if (carrier.removed) return true;
    const auto vertices = verticesOf(carrier);
    Eigen::Vector3d place = Eigen::Vector3d::Zero();
    for (int i = 0; i < 3; ++i)
      place += rest.barycentric[i] *
               vertices.row(carrier.object.mesh.triangles(rest.triangle, i)).transpose();
    return (place - rest.place).norm() >
           kFollows * boundingDiagonal(actors[rest.actor].object.mesh);
  };
  for (size_t k = 0; k < rests.size();) {
    Actor& actor = actors[rests[k].actor];
    // A carrier that no edit has moved takes along what rests on it, as the video has it.
    const bool over = !actor.followsVideo() || actors[rests[k].carrier].followsVideo();
    const bool falls = !over && lost(rests[k]);
    if (!over && !falls) {
      ++k;
      continue;
    }
    const std::string& carrier = actors[rests[k].carrier].object.name;
    setPressing(rests[k], true);
    rests.erase(rests.begin() + k);
    if (!falls) continue;
    letGo(actor, carrier + ", on which it rests, moves");
    k = 0;  // the list has grown
  }
}

}  // namespace calipso::fem
