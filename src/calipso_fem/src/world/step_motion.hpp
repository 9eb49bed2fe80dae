#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <map>
#include <vector>

#include "calipso_fem/world/soft_contacts.hpp"

namespace calipso::fem {

// Violation at the start that may be left at the end, m: overlap from before the step is undone by
// a share of it per step, without a kick, but for a rest that stays.
double allowance(const Contact& c, double h);

// Where everything goes in the step that is being solved: the target of each deformable body, and
// what contact forces do to rigid ones. Private to the contacts.
class StepMotion {
 public:
  struct Body {
    SoftObject* soft = nullptr;
    Vec target;    // 3n, m
    Vec forces;    // of contacts, 3n, N
    Vec free_way;  // of the contact nodes without contact forces, m
    decltype(TriangleMesh::vertices) start, moved;  // surface at the start; its way to the target
    std::vector<int> expected;                      // nodes that may get contacts, ascending
    bool touched = false;                           // has contacts
    double residual = 0.0, residual_before = 0.0;
    double residual_there = 0.0;  // at targets that are tried
    double share = 1.0;           // of the way to the target that its potential falls
    bool stuck = false;           // the potential falls no more, or the residual is rounding
    double size = 0.0;            // diagonal of its bounding box, m
  };

  StepMotion(const std::vector<SoftEntry>& softs, const std::vector<Obstacle>& obstacles,
             RigidWorld& rigid, double h);

  std::vector<Body>& bodies() { return bodies_; }
  const std::vector<Body>& bodies() const { return bodies_; }
  double h() const { return h_; }

  // Contacts that may come: their nodes are taken along when a system is made.
  void expect(const std::map<Contact::Key, Contact>& contacts);
  // Bodies that contacts act on get a system whose contact nodes are among those it is condensed
  // to.
  void touch(const std::map<Contact::Key, Contact>& contacts);
  // Without contacts, Newton's direction becomes the target; with them, its part without their
  // forces.
  void aim(const std::vector<int>& softs);
  // The forces of the contacts act from now on, and touched bodies get their targets.
  void follow(const std::map<Contact::Key, Contact>& contacts);
  // Moves towards the targets as far as the potentials fall: bodies without contacts each by
  // itself,
  void advanceFree();
  // those with contacts all alike.
  void advanceTouched();
  // Positions and targets of the bodies with contacts, one after the other, m.
  Vec positions() const;
  Vec targets() const;
  // Moves them to `targets` under the contacts' forces if that makes the largest residual smaller.
  bool tryTargets(const Vec& targets, const std::map<Contact::Key, Contact>& contacts);
  // The bodies' systems become those of where they are now.
  void renew(const std::vector<int>& softs, const std::map<Contact::Key, Contact>& contacts);

  Eigen::Vector3d way(int soft, const SurfacePoint& point) const;  // m, to the target
  Eigen::Vector3d rigidWay(RigidWorld::Id id, const Eigen::Vector3d& place) const;  // m
  Eigen::Vector3d freeRigidWay(RigidWorld::Id id, const Eigen::Vector3d& place) const;
  Eigen::Vector3d slip(const Contact& c) const;  // d_a - d_b, m
  double gap(const Contact& c) const { return c.start_gap + c.slack + c.normal.dot(slip(c)); }
  // What must not become negative.
  double clearance(const Contact& c) const { return gap(c) - c.offset + allowance(c, h_); }

  // The targets become the states; rigid bodies get their impulses.
  std::vector<StepReport> finish(const std::map<Contact::Key, Contact>& contacts);

 private:
  struct Rigid {
    Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();
    Eigen::Vector3d linear = Eigen::Vector3d::Zero(), angular = Eigen::Vector3d::Zero();  // gained
  };
  std::vector<bool> grounded(const std::map<Contact::Key, Contact>& contacts) const;
  void aim(Body& body);
  void measure(Body& body);
  // Each touched body by itself, on as many threads as there are.
  void forEachTouched(const std::function<void(Body&)>& work);
  void setTargets(const Vec& targets);
  void setForces(const std::map<Contact::Key, Contact>& contacts);

  RigidWorld& rigid_;
  double h_;
  std::vector<Body> bodies_;
  std::map<RigidWorld::Id, Rigid> rigids_;
};

}  // namespace calipso::fem
