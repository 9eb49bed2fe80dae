#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "calipso_fem/world/soft_contacts.hpp"
#include "self_proximity.hpp"
#include "step_motion.hpp"

// Where the surface of a deformable object may meet itself in a step. Both sides of such a contact
// are points of one body: for the rest it is a contact like any other.
namespace calipso::fem {
namespace {

using Vertices = decltype(TriangleMesh::vertices);

// Speeds of the vertices against the body's motion as a rigid one, m/s; of their own speed so much
// is added as a part of the body may lose at once.
Eigen::VectorXd speedsOf(const SoftObject& soft, double stopped) {
  const Vec v = soft.body().surfaceVelocities();
  const Vertices& x = soft.vertices();
  const Eigen::Map<const Vertices> velocities(v.data(), x.rows(), 3);
  const Eigen::RowVector3d center = x.colwise().mean(), mean = velocities.colwise().mean();
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  for (int i = 0; i < x.rows(); ++i) {
    const Eigen::Vector3d r = (x.row(i) - center).transpose();
    inertia += r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose();
    moment += r.cross((velocities.row(i) - mean).transpose());
  }
  const Eigen::Vector3d spin = inertia.ldlt().solve(moment);
  Eigen::VectorXd speeds(x.rows());
  for (int i = 0; i < x.rows(); ++i) {
    const Eigen::Vector3d r = (x.row(i) - center).transpose();
    speeds[i] = ((velocities.row(i) - mean).transpose() - spin.cross(r)).norm() +
                std::min(stopped, velocities.row(i).norm());
  }
  return speeds;
}

double fastestCorner(const Eigen::VectorXd& speeds, const TriangleMesh& mesh, int f) {
  return std::max(
      {speeds[mesh.triangles(f, 0)], speeds[mesh.triangles(f, 1)], speeds[mesh.triangles(f, 2)]});
}

int indexOf(const std::vector<Obstacle>& obstacles, const SoftObject* soft) {
  const auto found = std::find_if(obstacles.begin(), obstacles.end(),
                                  [&](const auto& o) { return o.soft == soft; });
  return found == obstacles.end() ? -1 : static_cast<int>(found - obstacles.begin());
}

Contact contactOf(const SurfaceHit& hit, const SurfaceTree& tree, int id, int soft, int index,
                  int vertex) {
  Contact c;
  c.key = {id, id, vertex, Contact::kNearest};
  c.soft_a = c.soft_b = soft;
  c.obstacle = index;
  c.point = SurfacePoint::vertex(vertex);
  c.other = SurfacePoint::onTriangle(tree.mesh().triangles.row(hit.triangle).transpose(),
                                     hit.barycentric);
  c.place = hit.point;
  c.normal = hit.normal;
  c.start_gap = hit.distance;
  return c;
}

// A triangle on its way.
struct MovingTriangle {
  Eigen::Matrix3d start, end;  // corners as columns, m
  Eigen::Matrix3d at(double t) const { return (1.0 - t) * start + t * end; }
};

Eigen::Vector3d normalOf(const Eigen::Matrix3d& corners) {
  return (corners.col(1) - corners.col(0)).cross(corners.col(2) - corners.col(0)).normalized();
}

// Where a point that goes from x0 to x1 enters the triangle. @return barycentric coordinates, and
// the normal there
std::optional<std::pair<Eigen::Vector3d, Eigen::Vector3d>> entry(const Eigen::Vector3d& x0,
                                                                 const Eigen::Vector3d& x1,
                                                                 const MovingTriangle& triangle) {
  constexpr double kBeside = 1e-2;  // of a side
  const double before = normalOf(triangle.start).dot(x0 - triangle.start.col(0)),
               after = normalOf(triangle.end).dot(x1 - triangle.end.col(0));
  if (!(before >= 0.0 && after < 0.0)) return std::nullopt;
  const double t = before / (before - after);
  const Eigen::Matrix3d corners = triangle.at(t);
  const Eigen::Vector3d x = (1.0 - t) * x0 + t * x1, n = normalOf(corners);
  const Eigen::Vector3d foot = x - n.dot(x - corners.col(0)) * n;
  const Eigen::Vector3d w =
      closestBarycentric(foot, corners.col(0), corners.col(1), corners.col(2));
  if ((corners * w - foot).norm() > kBeside * (corners.col(1) - corners.col(0)).norm())
    return std::nullopt;
  return std::make_pair(w, n);
}

}  // namespace

void SoftContacts::watchSelf(const std::vector<SoftEntry>& softs, int soft,
                             const std::vector<Obstacle>& obstacles, double h,
                             std::vector<Candidate>& list) const {
  const SoftEntry& entry = softs[soft];
  const int index = indexOf(obstacles, entry.soft), id = entry.id;
  if (index < 0) return;
  SelfProximity& self = *entry.soft->selfProximity();
  const SurfaceTree& tree = entry.soft->tree();
  if (self.isUnfolded(tree)) return;
  const double reach = reachOf(entry, obstacles[index]),
               friction = frictionOf(entry, obstacles[index]);
  // What meets something else may be stopped by it while the rest goes on.
  const bool free = std::none_of(list.begin(), list.end(), [&](const Candidate& c) {
    return c.contact.soft_a == soft || c.contact.soft_b == soft;
  });
  constexpr double kStopped = 1.0;  // minimal distances in a step
  const Eigen::VectorXd speeds = speedsOf(*entry.soft, free ? 0.0 : kStopped * reach / h);
  const double most = speeds.maxCoeff();
  const Eigen::Isometry3d motion = entry.soft->motion();
  if (self.staysFar(tree, motion, 2.0 * h * most)) return;

  const auto watch = [&](const SurfaceHit& hit, int vertex, int found) {
    Contact contact = contactOf(hit, tree, id, soft, index, vertex);
    std::get<3>(contact.key) = found;
    if (entry.soft->isHeld(contact.point) && entry.soft->isHeld(contact.other)) return;
    contact.reach = reach;
    contact.friction = friction;
    if (found == Contact::kNearest) contact = completed(contact);
    const bool near = found == Contact::kNearest && contact.start_gap - contact.offset <= reach;
    contact.force.setZero();
    list.push_back({contact, false, vertex, near});
  };
  bool far = true;
  const std::vector<int> vertices = self.mayMeet(tree, h * speeds, reach + self.spare());
  for (const int v : vertices) {
    const auto known = memory_.find({id, id, v, Contact::kNearest});
    const double depth = known == memory_.end() ? 0.0 : -known->second.offset;
    const double around = reach + h * (speeds[v] + most);
    const auto nearest =
        self.nearest(tree, v, tree.mesh().vertex(v), around + self.spare(), reach, depth);
    if (!nearest) continue;
    far = false;
    if (nearest->distance <= reach + depth) watch(*nearest, v, Contact::kNearest);
    if (nearest->distance > around) continue;
    for (const SurfaceHit& hit : self.ahead(tree, v, around, reach))
      if (hit.distance < h * (speeds[v] + fastestCorner(speeds, tree.mesh(), hit.triangle)))
        watch(hit, v, Contact::kCrossing + 4 * hit.triangle);
  }
  self.searched(tree, motion, vertices.size(), far);
}

std::optional<Contact> SoftContacts::crossingItself(const Candidate& c,
                                                    const std::vector<SoftEntry>& softs,
                                                    const StepMotion& motion) const {
  const int soft = c.contact.soft_a;
  const SurfaceTree& tree = softs[soft].soft->tree();
  const Eigen::Vector3i corners = c.contact.other.vertices;
  MovingTriangle triangle;
  for (int k = 0; k < 3; ++k) {
    triangle.start.col(k) = tree.mesh().vertex(corners[k]);
    triangle.end.col(k) =
        triangle.start.col(k) + motion.way(soft, SurfacePoint::vertex(corners[k]));
  }
  const Eigen::Vector3d x = tree.mesh().vertex(c.vertex);
  const auto found = entry(x, x + motion.way(soft, c.contact.point), triangle);
  if (!found) return std::nullopt;
  Contact contact = c.contact;
  contact.other = SurfacePoint::onTriangle(corners, found->first);
  contact.place = triangle.start * found->first;
  contact.normal = found->second;
  contact.start_gap = contact.normal.dot(x - contact.place);
  return contact;
}

}  // namespace calipso::fem
