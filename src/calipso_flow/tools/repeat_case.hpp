#pragma once

#include <string>
#include <vector>

namespace calipso::flow {

// A box thrown past a camera, filmed once, with fresh noise for every repeat: how often the 95 %
// ellipsoids of velocity, spin and gravity hold the truth. One JSON object.
std::vector<std::string> evaluateRepeats(int repeats);

}  // namespace calipso::flow
