#pragma once

#include <optional>
#include <vector>

#include "calipso_render/light_fit.hpp"

namespace calipso::render {

// A pixel near the mirror direction of the sun.
struct HighlightSample {
  LightSample at;
  float spread = 0.0f;  // root mean square turn of the normal across the pixel, rad per axis
};

// Every pixel of the views inside the masks whose normal lies near the half vector of light and
// viewer, each in the cluster of the nearest of `samples` in its picture.
std::vector<HighlightSample> highlightSamples(const std::vector<View>& views,
                                              const std::vector<bool>& moves,
                                              const std::vector<LightSample>& samples,
                                              const Eigen::Vector3f& light);

// Specular strength and roughness from the highlights' shape: for every roughness the best strength
// and brightness of the clusters (linear least squares, outliers weighed down), and of these the
// best. nullopt: no highlight is seen, or any roughness explains it.
// @param fit light and albedos so far
// @param visible as in LightEvidence
std::optional<SeenGloss> fitGloss(
    const std::vector<HighlightSample>& highlights, const LightFit& fit,
    const std::function<float(const LightSample&, const Eigen::Vector3f&)>& visible);

// Strength with which the surroundings are mirrored, by all samples beside the highlights' gloss.
// @param fit light, albedos and gloss so far
float surroundingsStrength(const LightEvidence& evidence, const LightFit& fit);

}  // namespace calipso::render
