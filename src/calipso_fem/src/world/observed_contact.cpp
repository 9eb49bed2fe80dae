#include <algorithm>

#include "world_impl.hpp"

// Contacts that the video has seen. A rigid body that bounces goes elsewhere for a millimetre at
// the corner that hits; the video shows what became of it. So while nothing about a body is edited
// but that it goes on by itself, and its state agrees with the observed one, the forces of its
// supports are those of the video:
//   x1 = x0 + (y1 - y0),   R1 = S1 S0' R0,   v1 = v0 + (u1 - u0)
//  x, R, v  simulated position, rotation and velocities at a frame's beginning (0) and end (1)
//  y, S, u  the same in the video
// In free flight it is simulated.
namespace calipso::fem {
namespace {

// of the size, between simulated and observed: now, and by the velocities a frame on
constexpr double kAgree = 0.05;
constexpr double kForced = 0.2;  // of its weight, that something else acts on it with in the video

double turn(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  return Eigen::AngleAxisd(a * b.transpose()).angle();
}

}  // namespace

// @param fresh  the objects that nothing had moved before the edit
void World::Impl::noteWhatContinues(const Edit& edit, const std::vector<bool>& fresh) {
  switch (edit.kind) {  // of which none is felt by what was there before
    case EditKind::kAppearance:
    case EditKind::kLight:
    case EditKind::kInsert:
    case EditKind::kDuplicate:
    case EditKind::kTimeScale:
    case EditKind::kSpeedScale:
    case EditKind::kReset:
      return;
    default:
      break;
  }
  const bool continues =
      edit.kind == EditKind::kVelocity && edit.mode == EditMode::kEstimated && edit.factor == 1.0;
  for (size_t i = 0; i < fresh.size(); ++i) {
    Actor& actor = actors[i];
    if (!edit.object.empty() && edit.object != actor.object.name) continue;
    actor.continues = continues && fresh[i] && !actor.altered && actor.kind == ObjectKind::kRigid;
    actor.altered |= !continues;
  }
}

bool World::Impl::agreesWithVideo(const Actor& actor) const {
  const ObservedMotion seen = actor.track.at(now);
  const BodyMotion is = motionOf(actor);
  const double size = boundingDiagonal(actor.object.mesh), radius = 0.5 * size;
  const Eigen::Vector3d centroid =
      is.world_from_object * (seen.world_from_object.inverse() * seen.centroid);
  const double apart =
      (centroid - seen.centroid).norm() +
      radius * turn(is.world_from_object.linear(), seen.world_from_object.linear());
  const Eigen::Vector3d velocity =
      is.linear + is.angular.cross(centroid - rigid.center(*actor.body));
  const double parting =
      (velocity - seen.linear).norm() + radius * (is.angular - seen.angular).norm();
  return apart < kAgree * size && parting * params.frame_period < kAgree * size;
}

std::vector<World::Impl::Continued> World::Impl::continued() const {
  std::vector<Continued> list;
  if (speed_scale != 1.0) return list;
  for (const Actor& actor : actors) {
    if (!actor.continues || actor.removed || actor.kind != ObjectKind::kRigid) continue;
    if (agreesWithVideo(actor))
      list.push_back({actor.id, motionOf(actor), rigid.center(*actor.body)});
  }
  return list;
}

// Sees to it that what touches something edited is left to itself from now on. @return it touches
// anything
bool World::Impl::touchesInStep(Actor& actor, double from) const {
  bool touches = false;
  const auto note = [&](const std::string& a, const std::string& b) {
    if (a != actor.object.name && b != actor.object.name) return;
    touches = true;
    const std::string& other = a == actor.object.name ? b : a;
    for (const Actor& partner : actors) {
      if (partner.object.name == other && !partner.followsVideo()) actor.continues = false;
    }
  };
  for (const ContactPoint& contact : rigid.contacts()) note(contact.a, contact.b);
  for (const TouchEvent& touch : rigid.touches()) note(touch.a, touch.b);
  for (const TouchEvent& touch : first_touches)  // in parts of the step before its last
    if (touch.time >= from) note(touch.a, touch.b);
  return touches;
}

void World::Impl::actAsObserved(const std::vector<Continued>& list, double from) {
  for (const Continued& before : list) {
    Actor& actor = actors[before.id];
    const bool touches = touchesInStep(actor, from);
    if (!actor.continues || !actor.track.reaches(now)) continue;
    const ObservedMotion y0 = actor.track.at(from), y1 = actor.track.at(now);
    const double h = now - from;
    const Eigen::Vector3d gained = y1.linear - y0.linear;
    const bool forced =
        (gained - h * actor.acceleration()).norm() > kForced * h * actor.acceleration().norm();
    if (!touches && !forced) continue;
    const Eigen::Isometry3d& x0 = before.motion.world_from_object;
    const Eigen::Vector3d middle = y0.world_from_object.inverse() * y0.centroid;  // object frame
    Eigen::Isometry3d x1 = Eigen::Isometry3d::Identity();
    x1.linear() =
        y1.world_from_object.linear() * y0.world_from_object.linear().transpose() * x0.linear();
    x1.translation() = x0 * middle + y1.centroid - y0.centroid - x1.linear() * middle;
    const Eigen::Vector3d angular = before.motion.angular + y1.angular - y0.angular;
    const Eigen::Vector3d at_middle =
        before.motion.linear + before.motion.angular.cross(x0 * middle - before.center) + gained;
    rigid.setPose(*actor.body, x1);
    rigid.setVelocity(*actor.body,
                      at_middle + angular.cross(rigid.center(*actor.body) - x1 * middle), angular);
    rigid.wake(*actor.body);
  }
}

}  // namespace calipso::fem
