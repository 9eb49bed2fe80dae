#pragma once

#include <vector>

#include "calipso_align/silhouette.hpp"

namespace calipso::align {

// Distance of every point of `from` to the nearest of the triangles with corners x, m.
std::vector<double> distancesToSurface(const Points& from, const Points& x,
                                       const Triangles& triangles);

}  // namespace calipso::align
