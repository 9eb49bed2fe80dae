#pragma once

#include <memory>
#include <vector>

#include "calipso_render/visibility.hpp"
#include "frame/staged_frame.hpp"
#include "place/relief_sky.hpp"

namespace calipso::render {

// Who casts shadows: maps towards a light (live) or rays (final).

std::unique_ptr<Visibility> sunVisibility(const std::vector<Occluder>& occluders,
                                          const Light& light, const RenderParams& params);

// The sky over a support plane as one wide light: near contact an object hides much of it.
std::unique_ptr<Visibility> skyVisibility(const std::vector<Occluder>& occluders,
                                          const RenderParams& params);

// The same over walls.
ReliefSky skyOnWalls(const std::vector<Occluder>& occluders, const Relief& relief,
                     const RenderParams& params);

// Pixels onto which the sun can cast the vertices' shadow.
// @param relief as the frame's camera sees it
// @param vertices world, m
// @param sun direction towards it
cv::Rect shadowBounds(const StagedFrame& frame, const Relief& relief, const Points& vertices,
                      const Eigen::Vector3f& sun);

}  // namespace calipso::render
