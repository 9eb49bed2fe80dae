#pragma once

#include "calipso_scene/triangle_mesh.hpp"

namespace calipso {

// Puts right what stock models get wrong. Number and order of the vertices stay.
//  - Vertices that no face names are put where one is that a face names.
//  - Faces with a vertex twice, and faces that repeat another one, are left out.
//  - Where neighbours are wound differently, a closed piece of the surface is wound to face
//    outwards, an open one as most of it is. A piece that is wound alike stays as it is: one that
//    faces inwards can be the inside of a hollow.
//  - A closed mesh with a negative volume is turned inside out.
void repairMesh(TriangleMesh* mesh);

}  // namespace calipso
