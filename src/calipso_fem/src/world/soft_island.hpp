#pragma once

#include <memory>
#include <vector>

#include "step_motion.hpp"

namespace calipso::fem {

// Deformable objects that may act on each other in a step, solved by themselves. Private to the
// contacts.
struct SoftContacts::Island {
  std::vector<int> members;      // indices of the step's list
  std::vector<SoftEntry> softs;  // as members
  std::unique_ptr<StepMotion> motion;
  Contacts contacts;
  ContactReport report;   // without bodies
  bool accepted = false;  // may be kept
};

}  // namespace calipso::fem
