#pragma once

#include <vector>

#include "calipso_flow/clip_dynamics.hpp"

namespace calipso::flow {

// Notes in the measurements what the support planes tell of the motion, before it is fitted: a body
// that is clear of them has nothing that holds it, and one that would have gone through them
// strikes them (PoseMeasurement::falls, strikes). Nothing is noted where there are no planes. Other
// objects are not known of: what lies on one, clear of the planes, is taken for likelier to fall.
// @param observations  one per measurement
void noteContacts(const std::vector<SupportPlane>& planes, const ObjectModel& model,
                  const std::vector<Observation>& observations, const Eigen::Vector3d& gravity,
                  std::vector<PoseMeasurement>& measurements);

}  // namespace calipso::flow
