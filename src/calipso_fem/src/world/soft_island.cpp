#include "soft_island.hpp"

#include <algorithm>
#include <map>
#include <numeric>

#include "obstacle_query.hpp"

namespace calipso::fem {
namespace {

// Disjoint sets; the smallest member stands for its set.
class Sets {
 public:
  explicit Sets(size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0); }
  size_t find(size_t k) const {
    while (parent_[k] != k) k = parent_[k];
    return k;
  }
  void unite(size_t a, size_t b) {
    a = find(a), b = find(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<size_t> parent_;
};

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
  Sets sets(softs.size() + 1);
  for (size_t s = 0; s < softs.size(); ++s)
    for (const Obstacle& obstacle : obstacles) {
      if (!obstacle.rigid && !obstacle.soft) continue;
      const auto other = std::find_if(softs.begin(), softs.end(),
                                      [&](const SoftEntry& e) { return e.soft == obstacle.soft; });
      if (obstacle.soft && (other == softs.end() || other->soft == softs[s].soft)) continue;
      const double watch = watchOf(softs[s], obstacle, rigid, h);
      if (!obstacleBounds(obstacle).intersects(boxOf(*softs[s].soft, watch))) continue;
      sets.unite(s, obstacle.rigid ? rigids : static_cast<size_t>(other - softs.begin()));
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
