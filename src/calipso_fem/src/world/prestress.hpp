#pragma once

#include <optional>
#include <vector>

#include "calipso_fem/world/soft_object.hpp"

namespace calipso::fem {

// How a body that is relaxed where it is would sag under gravity by linear elasticity, held by its
// fixed nodes and springs of `stiffness` (N/m) at the points of `hold`.
class Sag {
 public:
  Sag(const Eigen::Vector3d& gravity, const DeformableBody& body, double stiffness,
      const std::vector<HoldPoint>& hold);

  // Inner forces (3n, N) that keep it from sagging: -K u. Their sum and moment are zero: where the
  // body is not held, it falls. Sets the points' forces; `hold` is that of the constructor.
  Vec prestress(std::vector<HoldPoint>* hold) const;
  // Of all nodes, m; nothing where what holds it lets it tip over.
  std::optional<double> largest(const DeformableBody& body) const;

 private:
  double stiffness_;
  BlockMatrix K_;
  std::vector<Eigen::SparseVector<double>> points_;
  Vec displacement_;
  bool known_ = false;
};

}  // namespace calipso::fem
