#pragma once

#include <Eigen/Geometry>
#include <utility>
#include <vector>

#include "calipso_fem/world/surface_tree.hpp"

namespace calipso::fem {

// A flat sheet in a hierarchy of patches, both sides together, and how its material turns in each
// of them. Where all faces of a patch look within 60 degrees of one direction or its opposite it is
// a graph over the plane across and does not meet itself (normal cones, Volino and
// Magnenat-Thalmann 1994); neither do two patches where that holds of them and all between them.
class SheetPatches {
 public:
  // side: by face, +1 and -1 for the sheet's two sides, 0 for its rim
  SheetPatches(const TriangleMesh& rest, std::vector<signed char> side);

  // The sheet as it is now; asked once a step, as what turns may go on turning.
  void turn(const SurfaceTree& surface);
  // The whole sheet is no more folded than that, until the next step ends.
  bool isUnfolded() const { return patches_.front().cone.isUnfolded(); }
  // Vertices of patches that may come within `margin` (m) of each other, or of themselves, as long
  // as no vertex goes further than its `ways` (m); ascending.
  std::vector<int> mayMeet(const SurfaceTree& surface, const Eigen::VectorXd& ways, double margin);

 private:
  struct Cone {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero(), axis = Eigen::Vector3d::Zero();
    double angle = 0.0;    // rad, between the axis and the face that looks away most
    double lean = 0.0;     // rad, of the axis against that of the whole sheet
    double turning = 0.0;  // rad, what the two have changed by since the last step
    bool isUnfolded() const;
  };
  struct Patch {
    Eigen::AlignedBox3d rest, box;  // m
    int left = -1, right = -1;      // children, which follow; leaves: -1
    int first = 0, count = 0;       // range in order_
    Cone cone;
    double way = 0.0;  // m, of its fastest vertex
  };

  int build(const TriangleMesh& rest, int first, int count);
  void refit(const SurfaceTree& surface, const Eigen::VectorXd& ways);
  bool isUnfoldedAround(const Patch& a, const Patch& b) const;
  void divide(int patch, std::vector<std::pair<int, int>>& pairs) const;

  std::vector<signed char> side_;
  std::vector<int> order_;  // faces, grouped by leaf
  std::vector<Patch> patches_;
};

}  // namespace calipso::fem
