#include "calipso_render/edge_coverage.hpp"

#include <algorithm>
#include <cmath>
#include <unordered_map>

namespace calipso::render {
namespace {

int objectOrNone(std::uint32_t id) {
  return id == VisibilityBuffer::kNothing ? -1 : VisibilityBuffer::objectOf(id);
}

float signedArea(const ScreenMesh& mesh, const Eigen::Vector3i& t) {
  const Eigen::Vector3f &p = mesh.points[t[0]], &q = mesh.points[t[1]], &r = mesh.points[t[2]];
  return (q.x() - p.x()) * (r.y() - p.y()) - (r.x() - p.x()) * (q.y() - p.y());
}

// Edge functions and nearness of one triangle, linear in the picture, at all samples of a pixel at once.
class Sampler {
 public:
  Sampler() = default;
  Sampler(const Eigen::Vector3f* p, float area) {
    near_ = {0.0f, 0.0f, 0.0f};
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3f &a = p[(i + 1) % 3], &b = p[(i + 2) % 3];
      edges_[i] = {a.y() - b.y(), b.x() - a.x(), (b.y() - a.y()) * a.x() - (b.x() - a.x()) * a.y()};
      near_ += edges_[i] * (p[i].z() / area);
    }
  }

  void draw(int u, int v, std::uint32_t id, EdgeCoverage::Pixel& pixel) const {
    constexpr float kReach = 0.375f;  // px from the centre to the outermost samples
    float at_centre[3];
    for (int i = 0; i < 3; ++i) {
      at_centre[i] = edges_[i][0] * u + edges_[i][1] * v + edges_[i][2];
      if (at_centre[i] < -kReach * (std::abs(edges_[i][0]) + std::abs(edges_[i][1]))) return;
    }
    const float near_centre = near_[0] * u + near_[1] * v + near_[2];
    for (int s = 0; s < EdgeCoverage::kSamples; ++s) {
      const Eigen::Vector2f d = EdgeCoverage::offset(s);
      const float w0 = at_centre[0] + edges_[0][0] * d.x() + edges_[0][1] * d.y();
      const float w1 = at_centre[1] + edges_[1][0] * d.x() + edges_[1][1] * d.y();
      const float w2 = at_centre[2] + edges_[2][0] * d.x() + edges_[2][1] * d.y();
      const float near = near_centre + near_[0] * d.x() + near_[1] * d.y();
      const bool wins = (w0 >= 0.0f) & (w1 >= 0.0f) & (w2 >= 0.0f) & (near > pixel.nearness[s]);
      pixel.nearness[s] = wins ? near : pixel.nearness[s];
      pixel.ids[s] = wins ? id : pixel.ids[s];
    }
  }

 private:
  Eigen::Vector3f edges_[3];  // a u + b v + c >= 0 inside
  Eigen::Vector3f near_;
};

}  // namespace

std::vector<MeshEdge> meshEdges(const Triangles& triangles) {
  std::unordered_map<std::uint64_t, int> found;
  std::vector<MeshEdge> edges;
  edges.reserve(triangles.size() * 3 / 2);
  for (int t = 0; t < static_cast<int>(triangles.size()); ++t) {
    for (int i = 0; i < 3; ++i) {
      const int from = std::min(triangles[t][i], triangles[t][(i + 1) % 3]);
      const int to = std::max(triangles[t][i], triangles[t][(i + 1) % 3]);
      const std::uint64_t key = (static_cast<std::uint64_t>(from) << 32) | static_cast<unsigned>(to);
      const auto [it, inserted] = found.try_emplace(key, static_cast<int>(edges.size()));
      if (inserted) edges.push_back({from, to, t, -1});
      else if (edges[it->second].b < 0) edges[it->second].b = t;
    }
  }
  return edges;
}

EdgeCoverage::EdgeCoverage(const VisibilityBuffer& centre)
    : region_(centre.region()), slots_(centre.region().area(), -1), tiles_across_(centre.region().width / kTile + 1),
      tiles_(static_cast<std::size_t>(tiles_across_) * (centre.region().height / kTile + 1), 0) {
  const int width = region_.width, height = region_.height;
  for (int v = 0; v < height; ++v) {
    const std::uint32_t* row = centre.ids(v);
    const std::uint32_t* below = v + 1 < height ? centre.ids(v + 1) : row;
    for (int u = 0; u < width; ++u) {
      const int here = objectOrNone(row[u]);
      const bool right_differs = u + 1 < width && objectOrNone(row[u + 1]) != here;
      const bool below_differs = objectOrNone(below[u]) != here;
      if (right_differs || below_differs) choose(u, v);
      if (right_differs) choose(u + 1, v);
      if (below_differs) choose(u, v + 1);
    }
  }
}

void EdgeCoverage::choose(int column, int row) {
  if (column < 0 || row < 0 || column >= region_.width || row >= region_.height) return;
  int& slot = slots_[static_cast<std::size_t>(row) * region_.width + column];
  if (slot >= 0) return;
  slot = static_cast<int>(pixels_.size());
  tiles_[static_cast<std::size_t>(row / kTile) * tiles_across_ + column / kTile] = 1;
  pixels_.emplace_back();
  pixels_.back().ids.fill(VisibilityBuffer::kNothing);
  pixels_.back().nearness.fill(VisibilityBuffer::kFar);
}

void EdgeCoverage::chooseSilhouette(const ScreenMesh& mesh, const std::vector<MeshEdge>& edges) {
  std::vector<char> turned(mesh.triangles->size());
  for (std::size_t t = 0; t < turned.size(); ++t) turned[t] = signedArea(mesh, (*mesh.triangles)[t]) > 0.0f;
  for (const MeshEdge& edge : edges) {
    if (edge.b >= 0 && turned[edge.a] == turned[edge.b]) continue;
    const Eigen::Vector3f &p = mesh.points[edge.from], &q = mesh.points[edge.to];
    if (std::isnan(p.z() + q.z())) continue;
    const float length = std::min((q - p).head<2>().norm(), 2.0f * (region_.width + region_.height));
    const int steps = 1 + static_cast<int>(2.0f * length);
    for (int i = 0; i <= steps; ++i) {
      const Eigen::Vector3f s = p + (q - p) * (static_cast<float>(i) / steps);
      choose(static_cast<int>(std::floor(s.x() + 0.5f)) - region_.x,
             static_cast<int>(std::floor(s.y() + 0.5f)) - region_.y);
    }
  }
}

void EdgeCoverage::draw(const ScreenMesh& mesh, int object) {
  if (pixels_.empty()) return;
  for (int t = 0; t < static_cast<int>(mesh.triangles->size()); ++t) {
    drawTriangle(mesh, t, (static_cast<std::uint32_t>(object) << 24) | static_cast<std::uint32_t>(t));
  }
}

void EdgeCoverage::drawTriangle(const ScreenMesh& mesh, int triangle, std::uint32_t id) {
  const Eigen::Vector3i& t = (*mesh.triangles)[triangle];
  const Eigen::Vector3f offset(region_.x, region_.y, 0.0f);
  Eigen::Vector3f p[3] = {mesh.points[t[0]] - offset, mesh.points[t[1]] - offset,
                          mesh.points[t[2]] - offset};
  float area = signedArea(mesh, t);
  if (mesh.hides(area) || std::isnan(p[0].z() + p[1].z() + p[2].z()) || !(std::abs(area) > 1e-9f)) return;
  if (area < 0.0f) std::swap(p[1], p[2]), area = -area;
  // From the pixel whose square holds the least coordinate to the one that holds the greatest.
  const auto low = [](float a, float b, float c) { return static_cast<int>(std::clamp(std::min({a, b, c}) + 0.5f, 0.0f, 1e6f)); };
  const auto high = [](float a, float b, float c, int ceiling) {
    return std::min(ceiling, static_cast<int>(std::clamp(std::max({a, b, c}) + 1.5f, 0.0f, 1e6f)) - 1);
  };
  const int u0 = low(p[0].x(), p[1].x(), p[2].x()), u1 = high(p[0].x(), p[1].x(), p[2].x(), region_.width - 1);
  const int v0 = low(p[0].y(), p[1].y(), p[2].y()), v1 = high(p[0].y(), p[1].y(), p[2].y(), region_.height - 1);
  if (!anyChosen(u0, v0, u1, v1)) return;
  Sampler sampler;
  bool ready = false;
  for (int v = v0; v <= v1; ++v) {
    const int* slots = &slots_[static_cast<std::size_t>(v) * region_.width];
    for (int u = u0; u <= u1; ++u) {
      if (slots[u] < 0) continue;
      if (!ready) sampler = Sampler(p, area), ready = true;
      sampler.draw(u, v, id, pixels_[slots[u]]);
    }
  }
}

bool EdgeCoverage::anyChosen(int u0, int v0, int u1, int v1) const {
  for (int j = v0 / kTile; j <= v1 / kTile && v0 <= v1; ++j) {
    for (int i = u0 / kTile; i <= u1 / kTile && u0 <= u1; ++i) {
      if (tiles_[static_cast<std::size_t>(j) * tiles_across_ + i] != 0) return true;
    }
  }
  return false;
}

const EdgeCoverage::Pixel* EdgeCoverage::at(int u, int v) const {
  u -= region_.x, v -= region_.y;
  if (u < 0 || v < 0 || u >= region_.width || v >= region_.height) return nullptr;
  const int slot = slots_[static_cast<std::size_t>(v) * region_.width + u];
  return slot < 0 ? nullptr : &pixels_[slot];
}

}  // namespace calipso::render
