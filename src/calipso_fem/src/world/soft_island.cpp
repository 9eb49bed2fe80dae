#include "soft_island.hpp"

#include <algorithm>
#include <calipso_scene/disjoint_sets.hpp>
#include <map>

#include "obstacle_query.hpp"

namespace calipso::fem {
namespace {

Eigen::AlignedBox3d boxOf(const SoftObject& soft, double margin) {
  const Eigen::Vector3d low = soft.vertices().colwise().minCoeff().transpose(),
                        high = soft.vertices().colwise().maxCoeff().transpose();
  return {low.array() - margin, high.array() + margin};
}

}  // namespace

// All rigid bodies count as one: they may touch each other.
std::vector<SoftContacts::Island> SoftContacts::islandsOf(const std::vector<SoftEntry>& softs,
                                                          const std::vector<Obstacle>& obstacles,
                                                          const RigidWorld& rigid, double h) const {
  const size_t rigids = softs.size();
  DisjointSets sets(static_cast<int>(softs.size()) + 1);
  for (size_t s = 0; s < softs.size(); ++s)
    for (const Obstacle& obstacle : obstacles) {
      if (!obstacle.rigid && !obstacle.soft) continue;
      const auto other = std::find_if(softs.begin(), softs.end(),
                                      [&](const SoftEntry& e) { return e.soft == obstacle.soft; });
      if (obstacle.soft && (other == softs.end() || other->soft == softs[s].soft)) continue;
      const double watch = watchOf(softs[s], obstacle, rigid, h);
      if (!obstacleBounds(obstacle).intersects(boxOf(*softs[s].soft, watch))) continue;
      sets.join(s, obstacle.rigid ? rigids : static_cast<size_t>(other - softs.begin()));
    }
  std::map<size_t, Island> islands;
  for (size_t s = 0; s < softs.size(); ++s) {
    Island& island = islands[sets.find(s)];
    island.members.push_back(static_cast<int>(s));
    island.softs.push_back(softs[s]);
  }
  std::vector<Island> list;
  for (auto& [first, island] : islands) list.push_back(std::move(island));
  return list;
}

}  // namespace calipso::fem
