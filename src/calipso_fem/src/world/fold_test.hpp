#pragma once

#include <vector>

#include "calipso_fem/world/surface_tree.hpp"

namespace calipso::fem {

// Tells of a sheet - flat at rest, its outline without deep bays - that it is not folded: as long
// as all its faces look within 60 degrees of one direction or its opposite, it is a graph over the
// plane across, and does not meet itself (normal cone, Volino and Magnenat-Thalmann 1994).
class FoldTest {
 public:
  explicit FoldTest(const TriangleMesh& rest);
  bool appliesTo() const { return !side_.empty(); }
  // Of the sheet as it is. @return false where it may be folded before the next step ends, and for
  // what is no sheet
  bool isUnfolded(const SurfaceTree& surface);

 private:
  std::vector<signed char> side_;  // by face: +1, -1, 0 at the rim; empty: no sheet
  double angle_ = 0.0;             // rad, of the face that looks away most, when last asked
};

// Whether a closed surface is thin enough to fold onto itself: one piece whose thickness is under a
// fortieth of its extent, as cloth, a flag or a rope.
bool isThin(const TriangleMesh& mesh);

}  // namespace calipso::fem
