#pragma once

#include <optional>
#include <vector>

#include "calipso_render/light_fit.hpp"
#include "light/highlight_samples.hpp"

namespace calipso::render {

using SunVisible =
    std::function<float(const LightSample&, const Eigen::Vector3f&)>;  // LightEvidence's

// Specular strength and roughness from the highlights' shape: for every roughness the best strength
// and brightness of the clusters (linear least squares, outliers weighed down), and of these the
// best. nullopt: no highlight is seen, or any roughness explains it.
// @param fit light and albedos so far
std::optional<SeenGloss> fitGloss(const std::vector<HighlightSample>& highlights,
                                  const LightFit& fit, const SunVisible& visible);

// Do the highlights speak for the light's direction against those a few degrees beside it, whatever
// the roughness? One that shading has put in the wrong place is no highlight's, but what else is
// bright there.
bool tellDirection(const std::vector<HighlightSample>& highlights, const LightFit& fit,
                   const SunVisible& visible);

// All of it, of so many objects together and of those that differ.
SeenGlosses seenGlosses(const std::vector<HighlightSample>& highlights, std::size_t objects,
                        const LightFit& fit, const SunVisible& visible);

// Strength with which the surroundings are mirrored, by all samples beside the highlights' gloss.
// @param fit light, albedos and gloss so far
float surroundingsStrength(const LightEvidence& evidence, const LightFit& fit);

}  // namespace calipso::render
