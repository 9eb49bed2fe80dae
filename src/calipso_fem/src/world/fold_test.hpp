#pragma once

#include <optional>
#include <vector>

#include "calipso_fem/world/surface_tree.hpp"
#include "sheet_patches.hpp"

namespace calipso::fem {

// Tells where a sheet - flat at rest, its outline without deep bays - is not folded, and therefore
// does not meet itself.
class FoldTest {
 public:
  explicit FoldTest(const TriangleMesh& rest);
  bool appliesTo() const { return patches_.has_value(); }
  // Of the sheet as it is. @return false where it may be folded before the next step ends, and for
  // what is no sheet
  bool isUnfolded(const SurfaceTree& surface);
  // Vertices that may meet the surface in a step in which none goes further than its `ways`, with
  // `margin` (m) between; all of what is no sheet. Asked after isUnfolded().
  std::vector<int> mayMeet(const SurfaceTree& surface, const Eigen::VectorXd& ways, double margin);

 private:
  std::optional<SheetPatches> patches_;  // none: no sheet
};

// Whether a closed surface is thin enough to fold onto itself: one piece whose thickness is under a
// fortieth of its extent, as cloth, a flag or a rope. Lattices, with many holes through them, are
// not.
bool isThin(const TriangleMesh& mesh);

}  // namespace calipso::fem
