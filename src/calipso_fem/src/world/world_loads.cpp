#include <algorithm>
#include <stdexcept>
#include <string>

#include "calipso_fem/world/region_selection.hpp"
#include "describe.hpp"
#include "world_impl.hpp"

// Edits that hold, draw or press an object. Each function returns what was done, or throws what is
// wrong.
namespace calipso::fem {
namespace {

// Sets of vertices, ascending.
std::vector<int> without(const std::vector<int>& all, const std::vector<int>& some) {
  std::vector<int> rest;
  std::set_difference(all.begin(), all.end(), some.begin(), some.end(), std::back_inserter(rest));
  return rest;
}

bool intersects(const std::vector<int>& a, const std::vector<int>& b) {
  std::vector<int> common;
  std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(common));
  return !common.empty();
}

Eigen::Vector3d meanOf(const decltype(TriangleMesh::vertices)& vertices,
                       const std::vector<int>& chosen) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const int v : chosen) sum += vertices.row(v).transpose();
  return sum / static_cast<double>(chosen.size());
}

}  // namespace

std::string World::Impl::pull(Actor& actor, const Edit& edit) {
  Pull pull;
  pull.vertices = selectVertices(scene, actor.id, edit.region);
  pull.to_target = edit.mode == EditMode::kTarget;
  pull.twists = edit.kind == EditKind::kTwist;
  pull.vector = edit.vector;
  pull.begin = now;
  pull.ramp = edit.ramp;
  pull.duration = edit.duration;
  touch(actor, edit);
  if (!actor.simulated())
    throw std::invalid_argument(actor.object.name + " is " + toString(actor.kind) +
                                " and cannot be pulled; make it rigid or deformable (edit 'kind')");
  pull.anchor = meanOf(actor.object.mesh.vertices, pull.vertices);
  pull.start = meanOf(verticesOf(actor), pull.vertices);
  pull.start_rotation = poseOf(actor, now).linear();
  if (actor.soft && pull.to_target) {
    lead(actor, pull, 0.0);
    if (pull.nodes.empty())
      throw std::invalid_argument("the region to pull on " + actor.object.name +
                                  " is held fixed; release it first or choose another");
  }
  actor.pulls.push_back(pull);
  const char* unit =
      pull.twists ? (pull.to_target ? " rad" : " N m") : (pull.to_target ? " m" : " N");
  return actor.object.name + " (" + toString(actor.kind) + ") is " +
         (pull.twists ? "turned" : "pulled") + " by " + describe(edit.vector) + unit + " at " +
         std::to_string(pull.vertices.size()) + " vertices";
}

// Nodes that carry the region, and are not fixed, follow a given path; they are let go when the pull
// is over.
// @param gone the share of the way that lies behind them
void World::Impl::lead(Actor& actor, Pull& pull, double gone) {
  DeformableBody& body = actor.soft->body();
  pull.nodes.clear();
  for (const int node : body.nodesOfSurfaceVertices(pull.vertices))
    if (!body.isFixed(node)) pull.nodes.push_back(node);
  // The body's clock counts simulated seconds, the pull's those of the video.
  const auto share = [this, pull, body = &body](double t) {
    return pull.share(part_begin + (t - body->time()) / speed_scale);
  };
  for (const int node : pull.nodes) {
    const Eigen::Vector3d at = body.positions().segment<3>(3 * node);
    const Eigen::Vector3d arm = pull.armOf(at, gone);
    const Eigen::Vector3d from = at - pull.way(gone, arm) - body.model().mesh().node(node);
    for (int axis = 0; axis < 3; ++axis)
      body.prescribe(node, axis, [share, pull, from, arm, axis](double t) {
        return from[axis] + pull.way(share(t), arm)[axis];
      });
  }
  actor.soft->forgetSystem();
}

// What is held goes on being held where it is now.
void World::Impl::holdAnew(Actor& actor) {
  for (const auto& region : actor.fixed) actor.soft->body().fixSurfaceVertices(region);
  for (Pull& pull : actor.pulls) {
    if (!pull.to_target) continue;
    for (const int node : pull.nodes) actor.soft->body().releaseNode(node);
    for (const auto& region : actor.fixed) actor.soft->body().fixSurfaceVertices(region);
    lead(actor, pull, pull.share(now));
  }
  actor.soft->forgetSystem();
}

std::string World::Impl::fix(Actor& actor, const Edit& edit) {
  const std::vector<int> vertices = selectVertices(scene, actor.id, edit.region);
  touch(actor, edit);
  if (!actor.soft)
    throw std::invalid_argument(actor.object.name + " is " + toString(actor.kind) +
                                "; only a deformable object has regions to fix (edit 'kind')");
  actor.soft->body().fixSurfaceVertices(vertices);
  actor.soft->forgetSystem();
  actor.fixed.push_back(vertices);
  return actor.object.name + " is held at " + std::to_string(vertices.size()) + " vertices";
}

std::string World::Impl::release(Actor& actor, const Edit& edit) {
  const std::vector<int> vertices = selectVertices(scene, actor.id, edit.region);
  touch(actor, edit);
  const std::vector<int> attached = attachedOf(actor);
  size_t released = 0;
  const auto is_over = [&](std::vector<int>& region) {
    if (!intersects(region, vertices)) return false;
    if (actor.soft) actor.soft->body().releaseSurfaceVertices(region);
    ++released;
    if (!without(region, attached).empty()) return true;
    // Attachments hold what of them the region leaves: a towel's other pegs. The load that drives
    // it was found while all of it was held: what the attachments bore of it would now throw the
    // object off, or keep it up.
    endDrive(actor);
    region = without(region, vertices);
    if (region.empty()) actor.holder = Holder::kNothing;
    return region.empty();
  };
  for (auto region = actor.fixed.begin(); region != actor.fixed.end();)
    region = is_over(*region) ? actor.fixed.erase(region) : region + 1;
  const auto lets_go = [&](const Pull& pull) {
    if (!intersects(pull.vertices, vertices)) return false;
    if (actor.soft)
      for (const int node : pull.nodes) actor.soft->body().releaseNode(node);
    ++released;
    return true;
  };
  actor.pulls.erase(std::remove_if(actor.pulls.begin(), actor.pulls.end(), lets_go),
                    actor.pulls.end());
  if (released == 0)
    throw std::invalid_argument("nothing is fixed or pulled in that region of " +
                                actor.object.name);
  if (actor.soft) {
    for (const auto& region : actor.fixed) actor.soft->body().fixSurfaceVertices(region);
    actor.soft->forgetSystem();
  }
  return std::to_string(released) + " region(s) of " + actor.object.name + " are let go";
}

std::string World::Impl::press(Actor& actor, const Edit& edit) {
  touch(actor, edit);
  if (!actor.soft)
    throw std::invalid_argument(actor.object.name + " is " + toString(actor.kind) +
                                "; only a deformable object gives way to pressure (edit 'kind')");
  actor.pressure = edit.pressure;
  actor.soft->body().setPressure(actor.pressure);
  return actor.object.name + " is under " + std::to_string(edit.pressure) + " Pa";
}

// Wind is the scene's: cloth that shows none of its own, and what the video does not have, take the
// surest.
const WindTrack& World::Impl::windFor(const Actor& actor) const {
  const WindTrack* surest = actor.wind.empty() ? nullptr : &actor.wind;
  for (const Actor& other : actors) {
    if (!actor.wind.empty() || other.wind.empty()) continue;
    if (!surest || other.wind.variance() < surest->variance()) surest = &other.wind;
  }
  if (!surest)
    throw std::invalid_argument(
        "the wind of the video is not known: no cloth shows one, or it was not asked for when the "
        "clip was analysed (estimate_wind:=true); give one by mode absolute and a vector");
  return *surest;
}

std::string World::Impl::blow(Actor& actor, const Edit& edit) {
  const bool estimated = edit.mode == EditMode::kEstimated;
  WindTrack air;
  if (estimated)
    air = windFor(actor).times(edit.factor);
  else
    air.add({now, edit.vector, Eigen::Matrix3d::Zero()});
  const std::string stays = touchIfPossible(actor, edit);
  if (!stays.empty()) return actor.object.name + " stays: " + stays;
  if (!actor.simulated()) {
    const std::string held = actor.object.name + " is " + toString(actor.kind);
    if (edit.object.empty()) return held + " and stays";  // the others are blown at all the same
    throw std::invalid_argument(held +
                                " and no wind moves it; make it rigid or deformable (edit 'kind')");
  }
  actor.air = air;
  endDrive(actor);  // another wind drives it now
  return "wind of " + describe(air.at(now)) + " m/s moves " + actor.object.name +
         (estimated ? ", changing as in the video" : "");
}

}  // namespace calipso::fem
