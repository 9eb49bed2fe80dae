#pragma once

#include <memory>

#include "preconditioner.hpp"

namespace calipso::fem {

// Geometric multigrid on the lattice of a voxel mesh. @pre the mesh has lattice coordinates
std::unique_ptr<Preconditioner> makeMultigrid(const VolumeMesh& mesh);

}  // namespace calipso::fem
