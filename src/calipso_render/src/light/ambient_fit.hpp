#pragma once

#include "calipso_render/light_fit.hpp"

namespace calipso::render {

// Ambient light from several sides: the harmonics of bands 1 and 2 that explain the samples under
// the sun and the gloss of `fit`, with the clusters' albedos free. They are taken if they predict
// samples that were held out (the other pictures, or with one picture other strips of it) better
// than the light of `fit` does, each of them, and clearly so all together.
// @return whether they were
bool refineAmbient(const LightEvidence& evidence, LightFit& fit);

}  // namespace calipso::render
