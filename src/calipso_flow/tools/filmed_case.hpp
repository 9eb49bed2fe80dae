#pragma once

#include <string>
#include <vector>

namespace calipso::flow {

// Bodies simulated with a known wind and a known stiffness, filmed, and estimated from the
// pictures: one JSON object per case.
std::vector<std::string> evaluateFilmed();

}  // namespace calipso::flow
