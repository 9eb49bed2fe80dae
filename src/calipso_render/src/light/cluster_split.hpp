#pragma once

#include "calipso_render/light_fit.hpp"

namespace calipso::render {

// Parts of clusters that have another reflectance than the rest, though the same hue (tyres, panes
// and pale paint are all grey), become clusters of their own: under the light found so far their
// values are farther from the others' than shading that is missed could bring them.
// @return whether there were any
bool splitClusters(const LightFit& fit, LightEvidence& evidence);

}  // namespace calipso::render
