#include <algorithm>
#include <cmath>

#include "calipso_fem/world/mass_properties.hpp"
#include "world_impl.hpp"

// What pulls and winds do to the bodies in a step.
namespace calipso::fem {
namespace {

// rad/s, a quarter of a second to follow a target
constexpr double kPullFrequency = 2.0 * M_PI * 4.0;

// A critically damped spring over a step h that ends where the force is asked for (implicit Euler):
// stable however long that is. Acceleration for a distance to go and a velocity.
Eigen::Vector3d springTo(const Eigen::Vector3d& to_go, const Eigen::Vector3d& velocity, double h) {
  const double w = kPullFrequency;
  return (w * w * to_go - (2.0 * w + w * w * h) * velocity) / (1.0 + 2.0 * w * h + w * w * h * h);
}

constexpr double kFramesAhead = 2.5;  // for which a deforming object's motion is foreseen

}  // namespace

// Leads the twin on for h (s) of its own time. After the last frame known the amplitudes go on as
// they last did; longer nothing is known of them.
Vec World::Impl::driveTo(Actor& actor, double to, double h) {
  ObservedMotion seen = actor.track.at(to);
  const double beyond = std::max(0.0, to - seen.time);
  if (beyond > kFramesAhead * params.frame_period)
    seen.mode_velocities.setZero();
  else
    seen.mode_amplitudes += beyond * seen.mode_velocities;
  return actor.drive->advance(actor.key_nodes + nodalModes(actor, seen.mode_amplitudes),
                              nodalModes(actor, seen.mode_velocities) / speed_scale, h);
}

void World::Impl::driveAsObserved(double to, double h) {
  for (Actor& actor : actors) {
    if (!actor.drive) continue;
    const Vec load = driveTo(actor, to, h);
    if (actor.drive->holds()) {
      actor.soft->setDrive(load);
    } else {
      endDrive(actor);
      noteNoDrive(actor);
    }
  }
}

void World::Impl::endDrive(Actor& actor) {
  if (!actor.drive) return;
  actor.soft->setDrive(Vec::Zero(3 * actor.soft->body().nodeCount()));
  actor.drive.reset();
}

void World::Impl::noteNoDrive(Actor& actor) {
  actor.note +=
      "what drives it in the video is not told: its material cannot follow the motion that was "
      "seen; ";
  plan_changed = true;
}

// In place of those of the step before, or of a longer one that was given up.
void World::Impl::applyLoads(double at, double h) {
  for (Actor& actor : actors) {
    if (actor.removed) continue;
    if (actor.soft) {
      actor.soft->clearForces();
      for (const Pull& pull : actor.pulls) pullSoft(actor, pull, at);
      if (!actor.air.empty()) blowSoft(actor, at, h);
    }
    if (actor.kind == ObjectKind::kRigid && actor.body) loadRigid(actor, at, h);
  }
}

// Nodes led to a target are prescribed when the pull begins; forces are renewed every step.
void World::Impl::pullSoft(Actor& actor, const Pull& pull, double at) {
  if (pull.to_target) return;
  if (pull.twists) return twistSoft(actor, pull, at);
  const Eigen::Vector3d force =
      pull.share(at) * pull.vector / static_cast<double>(pull.vertices.size());
  for (const int v : pull.vertices) actor.soft->addForce(SurfacePoint::vertex(v), force);
}

// A torque T about the axis a: forces f = T (a x r) / sum |a x r|^2 about the region's middle,
// which add up to no force along the axis and to T about it.
void World::Impl::twistSoft(Actor& actor, const Pull& pull, double at) {
  const double torque = pull.share(at) * pull.vector.norm();
  if (torque == 0.0) return;
  const Eigen::Vector3d axis = pull.vector.normalized();
  const auto& vertices = actor.soft->vertices();
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const int v : pull.vertices) middle += vertices.row(v).transpose();
  middle /= static_cast<double>(pull.vertices.size());
  double inertia = 0.0;
  for (const int v : pull.vertices)
    inertia += axis.cross(vertices.row(v).transpose() - middle).squaredNorm();
  if (inertia == 0.0) return;
  for (const int v : pull.vertices)
    actor.soft->addForce(SurfacePoint::vertex(v),
                         torque / inertia * axis.cross(vertices.row(v).transpose() - middle));
}

// Torque on a rigid body; towards a target angle by a spring.
Eigen::Vector3d World::Impl::twistOf(const Actor& actor, const Pull& pull, double at,
                                     double h) const {
  const Eigen::Vector3d wanted = pull.share(at) * pull.vector;
  if (!pull.to_target) return wanted;
  const Eigen::AngleAxisd turned(rigid.pose(*actor.body).linear() *
                                 pull.start_rotation.transpose());
  // Of all angles that look alike the one nearest to what is wanted.
  const double turns = std::round((wanted.dot(turned.axis()) - turned.angle()) / (2.0 * M_PI));
  const Eigen::Vector3d error = wanted - (turned.angle() + 2.0 * M_PI * turns) * turned.axis();
  return rigid.inertia(*actor.body) * springTo(error, rigid.angularVelocity(*actor.body), h);
}

// On a rigid body a pull acts at its region's centre; a target draws it by a spring, and bears its
// weight.
void World::Impl::loadRigid(Actor& actor, double at, double h) {
  Eigen::Vector3d force = Eigen::Vector3d::Zero(), torque = Eigen::Vector3d::Zero();
  const Eigen::Vector3d center = rigid.center(*actor.body);
  for (const Pull& pull : actor.pulls) {
    if (pull.twists) {
      torque += twistOf(actor, pull, at, h);
      continue;
    }
    const Eigen::Vector3d arm = rigid.pose(*actor.body) * pull.anchor - center;
    Eigen::Vector3d f = pull.share(at) * pull.vector;
    if (pull.to_target) {
      const Eigen::Vector3d velocity =
          rigid.linearVelocity(*actor.body) + rigid.angularVelocity(*actor.body).cross(arm);
      const Eigen::Matrix3d mass =
          rigid.compliance(*actor.body, center + arm, center + arm).inverse();
      f = mass * (springTo(pull.start + f - center - arm, velocity, h) - actor.acceleration());
    }
    force += f;
    torque += arm.cross(f);
  }
  if (!actor.air.empty()) {
    const Eigen::Isometry3d pose = rigid.pose(*actor.body);
    const Vertices x = placed(actor.object.mesh, pose).vertices;
    Vertices u(x.rows(), 3);
    const Eigen::Vector3d linear = rigid.linearVelocity(*actor.body);
    const Eigen::Vector3d angular = rigid.angularVelocity(*actor.body);
    for (Eigen::Index i = 0; i < x.rows(); ++i)
      u.row(i) = (linear + angular.cross(x.row(i).transpose() - center)).transpose();
    const Vertices forces = airOn(actor, x, u, at, h);
    for (Eigen::Index i = 0; i < x.rows(); ++i) {
      force += forces.row(i).transpose();
      torque += (x.row(i).transpose() - center).cross(forces.row(i).transpose());
    }
  }
  rigid.setForce(*actor.body, force, torque);
}

Vertices World::Impl::airOn(Actor& actor, const Vertices& x, const Vertices& u, double at,
                            double h) {
  if (!actor.sheet) {
    const TriangleMesh& mesh = actor.object.mesh;
    Actor::Sheet sheet;
    sheet.closed = isClosed(mesh);
    const double area = (sheet.closed ? 0.5 : 1.0) * surfaceArea(mesh);
    sheet.areal_density = massOf(actor) / std::max(area, 1e-12);
    actor.sheet = sheet;
  }
  const Air air{actor.air.at(at), (actor.sheet->closed ? 0.5 : 1.0) * kAirDrag};
  return windForces(x, u, actor.object.mesh.triangles, air, actor.sheet->areal_density, h);
}

void World::Impl::blowSoft(Actor& actor, double at, double h) {
  const Vec velocities = actor.soft->body().surfaceVelocities();
  const Vertices u = Eigen::Map<const Vertices>(velocities.data(), velocities.size() / 3, 3);
  const Vertices forces = airOn(actor, actor.soft->vertices(), u, at, h);
  for (Eigen::Index v = 0; v < forces.rows(); ++v)
    actor.soft->addForce(SurfacePoint::vertex(static_cast<int>(v)), forces.row(v).transpose());
}

}  // namespace calipso::fem
