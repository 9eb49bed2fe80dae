#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <sstream>

#include "calipso_scene/attachment.hpp"
#include "obstacle_query.hpp"
#include "world_impl.hpp"

// What holds an object in the video, and how it becomes the equilibrium it is there.
namespace calipso::fem {
namespace {

// Surface up to this share of the diagonal above the lowest point is what the object stands on.
constexpr double kContactPatch = 0.01;
// A model's feet seldom end at one height: where it would tip over so, or nearly, the patch grows
// up to this, as long as that helps.
constexpr double kLargestContactPatch = 0.08, kTippingGap = 0.75 * M_PI, kGapGained = 0.2,
                 kOtherFoot = 0.1;
// Sag that changes nothing: of the object's diagonal, and in pixels.
constexpr double kSagOfSize = 1e-4, kSagPixels = 0.05;
// Sag of an object of default stiffness under its weight, of its diagonal.
constexpr double kLargestSag = 0.03;

// Smallest gap to any obstacle that pushes against gravity.
double supportGap(const TriangleMesh& surface, const std::vector<Obstacle>& obstacles,
                  const Eigen::Vector3d& gravity, double reach) {
  double smallest = reach;
  for (const Obstacle& obstacle : obstacles)
    if (const auto hit = carrying(obstacle, surface, gravity, reach))
      smallest = std::min(smallest, hit->gap);
  return smallest;
}

// Widest angle about the centre of mass, seen along `down`, in which none of the points lies: from
// pi on the object tips over. rad
double widestGap(const std::vector<std::pair<HoldPoint, int>>& points, const SoftObject& soft,
                 const Eigen::Vector3d& down) {
  const Eigen::Vector3d center = soft.body().momentum().center;
  const Eigen::Vector3d a = down.unitOrthogonal(), b = down.normalized().cross(a);
  std::vector<double> angles;
  for (const auto& [point, obstacle] : points) {
    const Eigen::Vector3d arm = soft.position(SurfacePoint::vertex(point.vertex)) - center;
    angles.push_back(std::atan2(arm.dot(b), arm.dot(a)));
  }
  if (angles.empty()) return 2.0 * M_PI;
  std::sort(angles.begin(), angles.end());
  double widest = angles.front() + 2.0 * M_PI - angles.back();
  for (size_t i = 1; i < angles.size(); ++i) widest = std::max(widest, angles[i] - angles[i - 1]);
  return widest;
}

// The lowest points, and, where the object would tip over on these or nearly, its other feet.
// @param within  what touches up to a share of the size above the lowest point
// @param apart   m, across `down`: from there on it is another foot
Touching standingPoints(const SoftObject& soft, const Eigen::Vector3d& down,
                        const std::function<Touching(double)>& within, double apart) {
  const Touching lowest = within(kContactPatch);
  Touching best = lowest;
  double widest = widestGap(best, soft, down);
  for (double patch = 2.0 * kContactPatch; widest > kTippingGap && patch <= kLargestContactPatch;
       patch *= 2.0) {
    Touching more = lowest;
    for (const auto& point : within(patch)) {
      const Eigen::Vector3d at = soft.position(SurfacePoint::vertex(point.first.vertex));
      const bool other = std::all_of(lowest.begin(), lowest.end(), [&](const auto& known) {
        const Eigen::Vector3d arm = at - soft.position(SurfacePoint::vertex(known.first.vertex));
        return arm.cross(down.normalized()).norm() > apart;
      });
      if (other) more.push_back(point);
    }
    const double left = widestGap(more, soft, down);
    if (left > widest - kGapGained) continue;
    widest = left;
    best = std::move(more);
  }
  return best;
}

// Points on which the object would stand.
std::vector<HoldPoint> lowestPoints(const SoftObject& soft, const Eigen::Vector3d& gravity) {
  const Eigen::VectorXd depth = soft.vertices() * gravity.normalized();
  const auto& x = soft.vertices();
  const double patch = kContactPatch * (x.colwise().maxCoeff() - x.colwise().minCoeff()).norm();
  std::map<int, int> lowest;  // by carrier node
  for (int v = 0; v < depth.size(); ++v) {
    if (depth[v] < depth.maxCoeff() - patch) continue;
    const auto [at, is_new] = lowest.emplace(soft.carrier(v), v);
    if (!is_new && depth[v] > depth[at->second]) at->second = v;
  }
  std::vector<HoldPoint> points;
  for (const auto& [carrier, v] : lowest) points.push_back({v, Eigen::Vector3d::Zero()});
  return points;
}

}  // namespace

bool isCloth(const TriangleMesh& surface, double volume) {
  constexpr double kThin = 0.01, kLarge = 0.1;  // of the size, and of its square
  const double size = boundingDiagonal(surface),
               area = (isClosed(surface) ? 0.5 : 1.0) * surfaceArea(surface);
  return volume < kThin * size * area && area > kLarge * size * size;
}

std::vector<HoldPoint> pointsOf(const Touching& touching) {
  std::vector<HoldPoint> points;
  for (const auto& [point, obstacle] : touching) points.push_back(point);
  return points;
}

// Of the model as the video has it: attachments do not grow with it.
std::vector<int> World::Impl::attachedOf(const Actor& actor) const {
  const WorldObject& observed = scene.objects[actor.id];
  return attachedVertices(observed.mesh, observed.world_from_object, observed.attachments);
}

// What holds the object in the video, and with what buoyancy.
void World::Impl::findHolder(Actor& actor) {
  if (actor.holder != Holder::kUnknown) return;
  actor.buoyancy.setZero();
  if (!attachedOf(actor).empty()) {
    actor.holder = Holder::kAttachment;
    return;
  }
  const TriangleMesh surface = placed(actor.object.mesh, poseOf(actor, now));
  const ObservedMotion seen = actor.track.at(now);
  const double size = boundingDiagonal(surface);
  const bool rests = !isOnTheMove(seen, size, params.frame_period);
  const double reach = (rests ? kRestingGap : kSupportGap) * size;
  if (supportGap(surface, obstacles(now, now, &actor), scene.gravity, reach) < reach) {
    actor.holder = Holder::kSupport;
    return;
  }
  const bool falls =
      seen.moving && seen.acceleration.dot(scene.gravity) > 0.5 * scene.gravity.squaredNorm();
  actor.holder = falls ? Holder::kNothing : Holder::kBuoyancy;
  if (!falls) actor.buoyancy = -scene.gravity;
}

// What the object stands on in the video: points of its surface, each with the index of the
// obstacle.
Touching World::Impl::supportPoints(const Actor& actor, const TriangleMesh& surface,
                                    const std::vector<Obstacle>& around) const {
  if (actor.holder != Holder::kSupport) return {};
  const double size = boundingDiagonal(surface);
  const SoftEntry entry{actor.id, actor.object.name, actor.settings.surface, actor.soft.get()};
  const double gap = supportGap(surface, around, scene.gravity, kRestingGap * size);
  return standingPoints(
      *actor.soft, scene.gravity,
      [&](double patch) {
        return contacts.touching(entry, around, std::max(0.0, gap) + patch * size);
      },
      kOtherFoot * size);
}

// A default stiffness is a guess by size alone. Slender objects would collapse under their weight
// with it: they get what keeps their sag at a few per cent, where they stand, hang or, put down,
// would stand.
void World::Impl::limitSag(Actor& actor, const TriangleMesh& surface, std::vector<HoldPoint> hold) {
  const DeformableBody& body = actor.soft->body();
  const double volume = body.totalMass() / body.model().cellMaterials().front().density;
  if (actor.settings.youngs_modulus || isCloth(surface, volume)) return;
  if (hold.empty() && !actor.soft->hasFixedNodes()) hold = lowestPoints(*actor.soft, scene.gravity);
  const auto sag = actor.soft->linearSag(scene.gravity, hold);
  const double factor = sag ? *sag / (kLargestSag * boundingDiagonal(surface)) : 1.0;
  if (!(factor > 1.0) || !std::isfinite(factor)) return;
  actor.observed_material.youngs_modulus *= factor;
  if (!actor.stiffness_given) actor.material.youngs_modulus *= factor;
  actor.soft->setMaterial(actor.observed_material);
  std::ostringstream text;
  text.precision(2);
  text << "slender: its default stiffness is " << factor
       << " times that of compact objects, or it would sag by " << *sag / boundingDiagonal(surface)
       << " of its size; give youngs_modulus for another; ";
  actor.note += text.str();
}

// Makes the observed shape the equilibrium under what held the object in the video. Buoyancy and
// free fall leave nothing to balance.
void World::Impl::settleAsObserved(Actor& actor, const TriangleMesh& surface,
                                   const std::vector<Obstacle>& around, const Touching& support) {
  const double size = boundingDiagonal(surface);
  std::vector<HoldPoint> hold = pointsOf(support);
  if (hold.empty() && actor.holder != Holder::kAttachment) return;
  const double px = pixelsPerMeter(scene.camera, surface.vertices.colwise().mean().transpose());
  const double tolerance =
      std::min(kSagOfSize * size, px > 0.0 ? kSagPixels / px : kSagOfSize * size);
  const SettleReport report = actor.soft->settle(scene.gravity + actor.buoyancy, hold, tolerance);
  if (!report.message.empty()) actor.note += report.message + "; ";
  const SoftEntry entry{actor.id, actor.object.name, actor.settings.surface, actor.soft.get()};
  for (size_t i = 0; i < hold.size(); ++i)
    contacts.hold(entry, around[support[i].second], hold[i],
                  (kRestingGap + kLargestContactPatch) * size);
}

}  // namespace calipso::fem
