#include <cmath>
#include <map>

#include "calipso_fem/world/soft_contacts.hpp"
#include "obstacle_query.hpp"
#include "self_proximity.hpp"
#include "step_motion.hpp"

// Gaps are linear in the motion from the start of a step on. Where surfaces turn and bend on their
// way, that is not how they end: here contacts get the gaps that they have at the targets.
namespace calipso::fem {
namespace {

class SurfacesAtTargets {
 public:
  SurfacesAtTargets(const std::vector<SoftEntry>& softs, const StepMotion& motion)
      : softs_(softs), motion_(motion) {}

  // Surface of a deformable object where it goes.
  const SurfaceTree& of(int soft) {
    const auto [at, is_new] = trees_.emplace(soft, softs_[soft].soft->tree());
    const StepMotion::Body& b = motion_.bodies()[soft];
    if (is_new) at->second.refit(b.start + b.moved);
    return at->second;
  }
  std::optional<SurfaceHit> nearestOfItself(const Contact& c, const Eigen::Vector3d& x,
                                            double reach) {
    const double depth = std::max(0.0, -motion_.gap(c));
    return softs_[c.soft_a].soft->selfProximity()->nearest(of(c.soft_a), std::get<2>(c.key), x,
                                                           reach, c.reach, depth);
  }
  Eigen::Vector3d position(int soft, const SurfacePoint& point) const {
    Eigen::Vector3d sum = motion_.way(soft, point);
    for (int k = 0; k < 3; ++k)
      sum += point.weights[k] * motion_.bodies()[soft].start.row(point.vertices[k]).transpose();
    return sum;
  }

 private:
  const std::vector<SoftEntry>& softs_;
  const StepMotion& motion_;
  std::map<int, SurfaceTree> trees_;
};

// Gap at the targets along the contact's normal; nothing where its surface is out of reach or has
// turned away.
std::optional<double> gapAtTargets(const Contact& c, const Obstacle& obstacle,
                                   SurfacesAtTargets& surfaces, const StepMotion& motion) {
  constexpr double kSameSide = 0.7;  // cosine
  const bool reversed = std::get<3>(c.key) & 1;
  const double reach = 2.0 * c.reach + std::abs(motion.gap(c));
  const bool bends = reversed || c.soft_b >= 0;  // the surface is that of a deformable object
  const SurfaceTree& tree = reversed ? surfaces.of(c.soft_a)
                            : bends  ? surfaces.of(c.soft_b)
                                     : *obstacle.tree;
  const Eigen::Isometry3d pose = bends ? Eigen::Isometry3d::Identity() : obstacle.pose;
  const Eigen::Vector3d x = !reversed       ? surfaces.position(c.soft_a, c.point)
                            : c.soft_b >= 0 ? surfaces.position(c.soft_b, c.other)
                                            : Eigen::Vector3d(c.place + c.motion);
  const auto hit = c.ofOneBody() ? surfaces.nearestOfItself(c, x, reach)
                                 : tree.nearest(pose.inverse() * x, reach);
  if (!hit) return std::nullopt;
  const double same = (reversed ? -1.0 : 1.0) * c.normal.dot(pose.linear() * hit->normal);
  if (same < kSameSide ||
      (bends && !c.ofOneBody() && hit->distance < -0.1 * c.reach && !encloses(tree.mesh(), x)))
    return std::nullopt;
  return hit->distance / same;
}

}  // namespace

int SoftContacts::straighten(const std::vector<Candidate>& watched,
                             const std::vector<Obstacle>& obstacles,
                             const std::vector<SoftEntry>& softs, const StepMotion& motion,
                             Contacts& contacts) const {
  // Minimal distances that a linear gap may be too large by, and too small by.
  constexpr double kOff = 0.02, kTooFar = 0.1;
  SurfacesAtTargets surfaces(softs, motion);
  int changed = 0;
  for (const Candidate& candidate : watched) {
    const Obstacle& obstacle = obstacles[candidate.contact.obstacle];
    if (obstacle.plane || obstacle.rigid) continue;
    const auto known = contacts.find(candidate.contact.key);
    const bool is_new = known == contacts.end();
    // What crosses a surface of its own body turns with it on the way.
    if (!candidate.near && (is_new || !candidate.contact.ofOneBody())) continue;
    const Contact& c = is_new ? candidate.contact : known->second;
    const double clearance = motion.clearance(c);
    if (clearance > c.reach || (!is_new && c.force.isZero(0.0) && clearance > kOff * c.reach))
      continue;
    const auto gap = gapAtTargets(c, obstacle, surfaces, motion);
    if (!gap) continue;
    const double off = *gap - motion.gap(c);
    if (is_new ? clearance + off > -kOff * c.reach
               : off > -kOff * c.reach && off < kTooFar * c.reach)
      continue;
    Contact turned = c;
    turned.slack += off;
    contacts[c.key] = turned;
    ++changed;
  }
  return changed;
}

}  // namespace calipso::fem
