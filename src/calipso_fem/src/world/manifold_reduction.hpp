#pragma once

#include <btBulletDynamicsCommon.h>

#include <vector>

// Private to the rigid world.
namespace calipso::fem {

// Contacts of one pair of bodies that add nothing to what the others can hold: a body of many
// convex parts touches with dozens of corners, of which those that span the most carry it as well.
// Of each set of contacts with nearly the same normal stay the deepest and the outermost in eight
// directions, where being further apart counts against being further out. Pairs with few contacts
// keep all.
// @return the ones to leave out, as they came
std::vector<btManifoldPoint*> redundantContacts(const std::vector<btManifoldPoint*>& contacts);

}  // namespace calipso::fem
