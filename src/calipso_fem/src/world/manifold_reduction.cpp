#include "manifold_reduction.hpp"

#include <algorithm>

namespace calipso::fem {
namespace {

constexpr size_t kFew = 8;
constexpr double kSameNormal = 0.98;  // cosine
constexpr double kOutPerApart = 10.0;
constexpr double kDiagonal = 0.70710678118654752;
constexpr double kDirections[][2] = {
    {1, 0},  {kDiagonal, kDiagonal},   {0, 1},  {-kDiagonal, kDiagonal},
    {-1, 0}, {-kDiagonal, -kDiagonal}, {0, -1}, {kDiagonal, -kDiagonal}};

using Contacts = std::vector<btManifoldPoint*>;
using Group = std::vector<size_t>;  // of contacts

// Marks those of a group that stay.
void keepSpanning(const Contacts& contacts, const Group& group, std::vector<bool>& kept) {
  const auto keepMost = [&](const auto& gain) {
    size_t best = group.front();
    double most = gain(*contacts[best]);
    for (const size_t k : group)
      if (const double g = gain(*contacts[k]); g > most) best = k, most = g;
    kept[best] = true;
  };
  keepMost([](const btManifoldPoint& p) { return -p.getDistance(); });
  btVector3 u, v;
  btPlaneSpace1(contacts[group.front()]->m_normalWorldOnB, u, v);
  for (const auto& [cosine, sine] : kDirections) {
    const btVector3 out = cosine * u + sine * v;
    keepMost([&](const btManifoldPoint& p) {
      return out.dot(p.getPositionWorldOnB()) - kOutPerApart * p.getDistance();
    });
  }
}

}  // namespace

std::vector<btManifoldPoint*> redundantContacts(const Contacts& contacts) {
  if (contacts.size() <= kFew) return {};
  std::vector<Group> groups;
  for (size_t k = 0; k < contacts.size(); ++k) {
    const auto group = std::find_if(groups.begin(), groups.end(), [&](const Group& g) {
      return contacts[g.front()]->m_normalWorldOnB.dot(contacts[k]->m_normalWorldOnB) > kSameNormal;
    });
    if (group == groups.end())
      groups.push_back({k});
    else
      group->push_back(k);
  }
  std::vector<bool> kept(contacts.size(), false);
  for (const Group& group : groups) keepSpanning(contacts, group, kept);
  Contacts redundant;
  for (size_t k = 0; k < contacts.size(); ++k)
    if (!kept[k]) redundant.push_back(contacts[k]);
  return redundant;
}

}  // namespace calipso::fem
