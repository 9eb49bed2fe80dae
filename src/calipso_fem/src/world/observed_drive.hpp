#pragma once

#include <memory>

#include "calipso_fem/world/soft_object.hpp"

namespace calipso::fem {

// What drives a deforming object in the video, by inverse dynamics: a twin of it, as it was before
// any edit, is led along the observed motion, and the load that this takes,
//   F = M (omega^2 (y1 - x1) + 2 omega (w1 - (x1 - x0) / h)),
// implicit in the end x1 of the step from x0, is what acts on the object. Not edited, it goes on as
// in the video; edited, it answers to the same load.
//  symbol  meaning                                                       unit
//  M       lumped masses                                                 kg
//  y1, w1  observed positions and velocities at the step's end, 3n       m, m/s
class ObservedDrive {
 public:
  // @param twin  in the state from which it goes on; made with twinOptions()
  explicit ObservedDrive(std::unique_ptr<SoftObject> twin);

  // The lead's part in x1 acts as Rayleigh's damping by mass does, with omega^2 h + 2 omega.
  static FemOptions twinOptions(FemOptions options);

  // Takes the twin a step of h (s) on. @return F, 3n, N, that took it there
  Vec advance(const Vec& positions, const Vec& velocities, double h);
  // False: a step could not be solved; the motion told is none that the material could follow.
  bool holds() const { return holds_; }
  const SoftObject& twin() const { return *twin_; }

 private:
  std::unique_ptr<SoftObject> twin_;
  bool holds_ = true;
};

}  // namespace calipso::fem
