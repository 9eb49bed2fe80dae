#include "draw/joint_visibility.hpp"

#include <algorithm>
#include <limits>
#include <utility>

#include "draw/light_batch.hpp"

namespace calipso::render {
namespace {

// times the larger one's extent that two groups may have together; how many groups there are at most
constexpr float kApart = 4.0f;
constexpr std::size_t kMostGroups = 4;

struct Group {
  std::vector<Occluder> members;
  Eigen::AlignedBox2f box;  // m, across the light
  float side() const { return box.isEmpty() ? 0.0f : box.sizes().maxCoeff(); }
};

Eigen::AlignedBox2f boxOf(const Points& vertices, const Eigen::Vector3f& s,
                          const Eigen::Vector3f& t) {
  Eigen::AlignedBox2f box;
  for (const Eigen::Vector3f& p : vertices) box.extend(Eigen::Vector2f(p.dot(s), p.dot(t)));
  return box;
}

struct Pair {
  std::size_t first = 0, second = 0;
  float side = std::numeric_limits<float>::max();  // of both together
};

// The two that are the smallest together: of those that are near each other, or of any.
Pair smallestPair(const std::vector<Group>& groups, bool any) {
  Pair least;
  for (std::size_t i = 0; i < groups.size(); ++i) {
    for (std::size_t j = i + 1; j < groups.size(); ++j) {
      const float side = groups[i].box.merged(groups[j].box).sizes().maxCoeff();
      const bool near = side <= kApart * std::max(groups[i].side(), groups[j].side());
      if ((any || near) && side < least.side) least = {i, j, side};
    }
  }
  return least;
}

}  // namespace

JointVisibility::JointVisibility(std::vector<std::unique_ptr<Visibility>> groups)
    : groups_(std::move(groups)) {}

float JointVisibility::visibility(const Eigen::Vector3f& p, const Eigen::Vector3f& n) const {
  float all = 1.0f;
  for (const auto& group : groups_) all *= group->visibility(p, n);
  return all;
}

void JointVisibility::visibilities(const LightPoints& points, int count, float* visible) const {
  groups_.front()->visibilities(points, count, visible);
  for (std::size_t i = 1; i < groups_.size(); ++i) {
    float more[LightBatch::kMost + 8];
    for (int first = 0; first < count; first += LightBatch::kMost) {
      LightPoints rest = points;
      for (int c = 0; c < 3; ++c) rest.position[c] += first, rest.normal[c] += first;
      const int here = std::min(LightBatch::kMost, count - first);
      groups_[i]->visibilities(rest, here, more);
      for (int k = 0; k < here; ++k) visible[first + k] *= more[k];
    }
  }
}

bool JointVisibility::empty() const {
  return std::all_of(groups_.begin(), groups_.end(), [](const auto& g) { return g->empty(); });
}

std::optional<float> JointVisibility::uniform(const Eigen::Vector3f& p, const Eigen::Vector3f& n,
                                              float radius) const {
  bool known = true;
  for (const auto& group : groups_) {
    const std::optional<float> here = group->uniform(p, n, radius);
    if (here && *here == 0.0f) return 0.0f;
    known = known && here.has_value();
  }
  return known ? std::optional<float>(1.0f) : std::nullopt;
}

std::vector<std::vector<Occluder>> nearGroups(const std::vector<Occluder>& occluders,
                                              const Eigen::Vector3d& direction) {
  const Eigen::Vector3f h = direction.normalized().cast<float>(), s = h.unitOrthogonal();
  std::vector<Group> groups;
  for (const Occluder& o : occluders) groups.push_back({{o}, boxOf(*o.vertices, s, h.cross(s))});
  while (groups.size() > 1) {
    const Pair pair = smallestPair(groups, groups.size() > kMostGroups);
    if (pair.second == 0) break;
    Group &first = groups[pair.first], &second = groups[pair.second];
    first.members.insert(first.members.end(), second.members.begin(), second.members.end());
    first.box.extend(second.box);
    groups.erase(groups.begin() + static_cast<std::ptrdiff_t>(pair.second));
  }
  std::vector<std::vector<Occluder>> members;
  for (Group& group : groups) members.push_back(std::move(group.members));
  return members;
}

}  // namespace calipso::render
