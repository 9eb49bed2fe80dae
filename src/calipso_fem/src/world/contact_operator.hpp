#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

#include "step_motion.hpp"

namespace calipso::fem {

// The contacts of one direction as a linear problem: their slip without contact forces, and
// W = H A^-1 H^T in their frames (normal first), m/s per N s.
class ContactOperator {
 public:
  // Takes over the contacts, which may have become more since the last call, and the systems of the
  // bodies.
  void update(const std::map<Contact::Key, Contact>& contacts, const StepMotion& motion,
              const std::vector<SoftEntry>& softs, const RigidWorld& rigid);
  void forget() { parts_.clear(); }  // contacts have changed
  const Eigen::MatrixXd& W() const { return W_; }
  // d_a - d_b over the step under all forces but those of contacts, m.
  Eigen::Vector3d freeSlip(int contact, const StepMotion& motion) const;
  // Nodes that contacts of a body act on, ascending.
  static std::vector<int> nodesOf(int soft, const std::map<Contact::Key, Contact>& contacts,
                                  const SoftObject& body);

 private:
  // One of the bodies a contact acts on: sign +1 for a, -1 for b.
  struct Side {
    int soft = -1;
    std::optional<RigidWorld::Id> rigid;
    std::vector<std::pair<int, double>> nodes;  // of the body's contact nodes: index, weight
    Eigen::Vector3d place = Eigen::Vector3d::Zero();
    double sign = 1.0;
  };
  struct Entry {
    Side sides[2];
    Eigen::Matrix3d frame;
    Eigen::Vector3d motion;  // of b where nobody's force moves it
  };

  Side sideOf(int soft, const std::optional<RigidWorld::Id>& rigid, const SurfacePoint& point,
              const Eigen::Vector3d& place, double sign, const std::vector<SoftEntry>& softs) const;
  // What a body contributes to W among the contacts it has part in.
  struct Part {
    int version = -1;           // of its system
    std::vector<int> contacts;  // ascending; one may have both its sides here
    Eigen::MatrixXd W;
  };
  Part partOf(int soft, SoftSystem& system, double h) const;
  void addPart(const Part& part);
  void addRigid(const RigidWorld& rigid);

  std::vector<Entry> entries_;
  std::map<int, Part> parts_;  // by body
  Eigen::MatrixXd W_;
};

}  // namespace calipso::fem
