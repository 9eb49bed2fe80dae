#include "texture/surface_chart.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <queue>
#include <unordered_map>
#include <utility>

#include "texture/mesh_topology.hpp"

namespace calipso::render {
namespace {

constexpr float kStretch = 1.35f;  // of an edge laid flat, at most; and 1 / that at least
constexpr float kCell = 0.05f;     // of the radius: squares by which laid triangles are found
// part of `down` that must lie in the seed's plane to be a direction there
constexpr float kUpright = 0.1f;

float cross(const Eigen::Vector2f& a, const Eigen::Vector2f& b) {
  return a.x() * b.y() - a.y() * b.x();
}

Eigen::Vector2f middleOf(const std::array<Eigen::Vector2f, 3>& c) {
  return (c[0] + c[1] + c[2]) / 3.0f;
}

// The third corner of a triangle whose first two lie at p and q, on the left of the way from p to
// q.
// @param a, b, c the corners in space
Eigen::Vector2f hinged(const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c,
                       const Eigen::Vector2f& p, const Eigen::Vector2f& q) {
  const Eigen::Vector3f edge = b - a, arm = c - a;
  const float length = std::max(edge.norm(), 1e-12f);
  const float along = arm.dot(edge) / length, aside = edge.cross(arm).norm() / length;
  const Eigen::Vector2f flat = q - p, direction = flat / std::max(flat.norm(), 1e-12f);
  return p + along * direction + aside * Eigen::Vector2f(-direction.y(), direction.x());
}

// Triangles in the plane, found by place.
class FlatPatches {
 public:
  explicit FlatPatches(float cell) : cell_(cell) {}

  void add(const std::array<Eigen::Vector2f, 3>& corners) {
    const int id = static_cast<int>(all_.size());
    all_.push_back(corners);
    Eigen::AlignedBox2f box;
    for (const Eigen::Vector2f& c : corners) box.extend(c);
    for (int y = row(box.min().y()); y <= row(box.max().y()); ++y) {
      for (int x = row(box.min().x()); x <= row(box.max().x()); ++x)
        cells_[key(x, y)].push_back(id);
    }
  }

  bool covers(const Eigen::Vector2f& point) const {
    const auto cell = cells_.find(key(row(point.x()), row(point.y())));
    if (cell == cells_.end()) return false;
    return std::any_of(cell->second.begin(), cell->second.end(),
                       [&](int id) { return contains(all_[id], point); });
  }

 private:
  static bool contains(const std::array<Eigen::Vector2f, 3>& t, const Eigen::Vector2f& p) {
    for (int k = 0; k < 3; ++k) {
      if (cross(t[(k + 1) % 3] - t[k], p - t[k]) < 0.0f) return false;
    }
    return true;
  }
  int row(float x) const { return static_cast<int>(std::floor(x / cell_)); }
  static std::int64_t key(int x, int y) { return static_cast<std::int64_t>(x) * 1000003 + y; }

  float cell_;
  std::vector<std::array<Eigen::Vector2f, 3>> all_;
  std::unordered_map<std::int64_t, std::vector<int>> cells_;
};

// Lays one chart.
class ChartBuilder {
 public:
  ChartBuilder(const Points& vertices, const Triangles& triangles, const std::vector<int>& place,
               const std::vector<std::array<int, 3>>& neighbours, float radius)
      : vertices_(vertices),
        triangles_(triangles),
        place_(place),
        neighbours_(neighbours),
        radius_(radius),
        done_(triangles.size(), false),
        covered_(kCell * radius) {}

  std::vector<FlatTriangle> build(int seed, const Eigen::Vector3f& down) {
    const Eigen::Vector3f across =
        (corner(seed, 1) - corner(seed, 0)).cross(corner(seed, 2) - corner(seed, 0));
    if (!(across.squaredNorm() > 0.0f)) return {};
    lay(seed, seedCorners(seed, across.normalized(), down));
    while (!front_.empty()) {
      const Reached next = front_.top();
      front_.pop();
      if (done_[next.triangle]) continue;
      const std::array<Eigen::Vector2f, 3> corners = placed(next.triangle, next.side);
      if (fits(next.triangle, corners)) lay(next.triangle, corners);
    }
    return std::move(chart_);
  }

 private:
  // A triangle that can be laid, and its side by which it is reached; the nearest to the origin
  // comes first.
  struct Reached {
    float distance;
    int triangle, side;
    bool operator>(const Reached& o) const {
      return std::pair(distance, triangle) > std::pair(o.distance, o.triangle);
    }
  };

  const Eigen::Vector3f& corner(int t, int k) const { return vertices_[triangles_[t][k]]; }

  std::array<Eigen::Vector2f, 3> seedCorners(int seed, const Eigen::Vector3f& normal,
                                             const Eigen::Vector3f& down) const {
    Eigen::Vector3f y = down - normal * normal.dot(down);
    y = y.norm() < kUpright * down.norm() ? normal.unitOrthogonal() : y.normalized();
    const Eigen::Vector3f x = y.cross(normal),
                          middle = (corner(seed, 0) + corner(seed, 1) + corner(seed, 2)) / 3.0f;
    std::array<Eigen::Vector2f, 3> corners;
    for (int k = 0; k < 3; ++k)
      corners[k] = {x.dot(corner(seed, k) - middle), y.dot(corner(seed, k) - middle)};
    return corners;
  }

  void lay(int t, const std::array<Eigen::Vector2f, 3>& corners) {
    done_[t] = true;
    chart_.push_back({t, corners});
    covered_.add(corners);
    for (int k = 0; k < 3; ++k) laid_.try_emplace(place_[triangles_[t][k]], corners[k]);
    for (const int n : neighbours_[t]) {
      if (n < 0 || done_[n]) continue;
      const auto side =
          std::find(neighbours_[n].begin(), neighbours_[n].end(), t) - neighbours_[n].begin();
      const float distance = middleOf(placed(n, static_cast<int>(side))).norm();
      if (distance <= radius_) front_.push({distance, n, static_cast<int>(side)});
    }
  }

  // Where a triangle comes to lie whose `side` is laid.
  std::array<Eigen::Vector2f, 3> placed(int t, int side) const {
    const Eigen::Vector3i& v = triangles_[t];
    const int a = side, b = (side + 1) % 3, c = (side + 2) % 3;
    std::array<Eigen::Vector2f, 3> corners;
    corners[a] = laid_.at(place_[v[a]]), corners[b] = laid_.at(place_[v[b]]);
    const auto third = laid_.find(place_[v[c]]);
    corners[c] = third != laid_.end()
                     ? third->second
                     : hinged(corner(t, a), corner(t, b), corner(t, c), corners[a], corners[b]);
    return corners;
  }

  bool fits(int t, const std::array<Eigen::Vector2f, 3>& c) const {
    for (int k = 0; k < 3; ++k) {
      const float flat = (c[(k + 1) % 3] - c[k]).norm(),
                  real = (corner(t, (k + 1) % 3) - corner(t, k)).norm();
      if (flat > kStretch * real || real > kStretch * flat) return false;
    }
    return cross(c[1] - c[0], c[2] - c[0]) > 0.0f && !covered_.covers(middleOf(c));
  }

  const Points& vertices_;
  const Triangles& triangles_;
  const std::vector<int>& place_;
  const std::vector<std::array<int, 3>>& neighbours_;
  float radius_;
  std::vector<bool> done_;
  FlatPatches covered_;
  std::vector<FlatTriangle> chart_;
  std::unordered_map<int, Eigen::Vector2f> laid_;  // corners, by place
  std::priority_queue<Reached, std::vector<Reached>, std::greater<>> front_;
};

}  // namespace

SurfaceUnfolder::SurfaceUnfolder(const Points& vertices, const Triangles& triangles)
    : vertices_(vertices),
      triangles_(triangles),
      place_(weld(vertices)),
      neighbours_(triangles.size(), {-1, -1, -1}) {
  // by edge: triangle and side
  std::map<std::pair<int, int>, std::vector<std::pair<int, int>>> sides;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const int a = place_[triangles[t][k]], b = place_[triangles[t][(k + 1) % 3]];
      if (a != b) sides[std::minmax(a, b)].emplace_back(static_cast<int>(t), k);
    }
  }
  for (const auto& [edge, of] : sides) {
    if (of.size() != 2) continue;
    neighbours_[of[0].first][of[0].second] = of[1].first;
    neighbours_[of[1].first][of[1].second] = of[0].first;
  }
}

Eigen::Vector3f SurfaceUnfolder::middle(int triangle) const {
  const Eigen::Vector3i& t = triangles_[triangle];
  return (vertices_[t[0]] + vertices_[t[1]] + vertices_[t[2]]) / 3.0f;
}

std::vector<float> SurfaceUnfolder::distances(const std::vector<bool>& goal) const {
  using Reached = std::pair<float, int>;
  std::vector<float> way(triangles_.size(), std::numeric_limits<float>::infinity());
  std::priority_queue<Reached, std::vector<Reached>, std::greater<>> front;
  for (std::size_t t = 0; t < goal.size(); ++t) {
    if (goal[t]) way[t] = 0.0f, front.emplace(0.0f, static_cast<int>(t));
  }
  while (!front.empty()) {
    const auto [so_far, t] = front.top();
    front.pop();
    if (so_far > way[t]) continue;
    for (const int n : neighbours_[t]) {
      const float on = n < 0 ? 0.0f : so_far + (middle(n) - middle(t)).norm();
      if (n >= 0 && on < way[n]) way[n] = on, front.emplace(on, n);
    }
  }
  return way;
}

std::vector<FlatTriangle> SurfaceUnfolder::around(int seed, const Eigen::Vector3f& down,
                                                  float radius) const {
  ChartBuilder builder(vertices_, triangles_, place_, neighbours_, radius);
  return builder.build(seed, down);
}

}  // namespace calipso::render
