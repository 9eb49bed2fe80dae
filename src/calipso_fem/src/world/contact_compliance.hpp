#pragma once

#include <Eigen/Core>
#include <map>
#include <utility>
#include <vector>

#include "calipso_fem/world/soft_contacts.hpp"

namespace calipso::fem {

// W = H A^-1 H^T of all contacts of a step, in their frames (normal first). Blocks of contacts that
// stay are kept from step to step: they are good enough to iterate with, since what the forces do
// to the bodies is computed exactly.
class ContactCompliance {
 public:
  const Eigen::MatrixXd& of(const std::map<Contact::Key, Contact>& contacts,
                            const std::vector<SoftEntry>& softs, const RigidWorld& rigid, double h);
  void forget() { known_.clear(); }  // the bodies' own columns have changed

 private:
  struct Known {
    int index = 0;
    Eigen::Vector3d normal;
    SurfacePoint point, other;
    Eigen::Vector3d place;
  };
  bool same(const Known& known, const Contact& contact) const;

  Eigen::MatrixXd W_;
  std::map<Contact::Key, Known> known_;
  double h_ = 0.0;
};

}  // namespace calipso::fem
