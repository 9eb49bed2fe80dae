#include "calipso_fem/world/surface_tree.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <stdexcept>

namespace calipso::fem {
namespace {

constexpr int kLeafSize = 4;

std::vector<Eigen::Vector3i> neighbours(const TriangleMesh& mesh) {
  std::map<std::pair<int, int>, int> half_edge;  // directed edge -> triangle
  for (int f = 0; f < mesh.triangleCount(); ++f)
    for (int k = 0; k < 3; ++k)
      half_edge[{mesh.triangles(f, (k + 1) % 3), mesh.triangles(f, (k + 2) % 3)}] = f;
  std::vector<Eigen::Vector3i> across(mesh.triangleCount(), Eigen::Vector3i::Constant(-1));
  for (int f = 0; f < mesh.triangleCount(); ++f)
    for (int k = 0; k < 3; ++k) {
      const auto twin =
          half_edge.find({mesh.triangles(f, (k + 2) % 3), mesh.triangles(f, (k + 1) % 3)});
      if (twin != half_edge.end()) across[f][k] = twin->second;
    }
  return across;
}

}  // namespace

// Ericson 2005, section 5.1.5.
Eigen::Vector3d closestBarycentric(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                   const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const Eigen::Vector3d ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0.0 && d2 <= 0.0) return {1, 0, 0};
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0.0 && d4 <= d3) return {0, 1, 0};
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) return {1 - d1 / (d1 - d3), d1 / (d1 - d3), 0};
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0.0 && d5 <= d6) return {0, 0, 1};
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) return {1 - d2 / (d2 - d6), 0, d2 / (d2 - d6)};
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0) {
    const double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return {0, 1 - w, w};
  }
  const double sum = va + vb + vc;
  return {va / sum, vb / sum, vc / sum};
}

SurfaceTree::SurfaceTree(TriangleMesh mesh)
    : mesh_(std::move(mesh)), order_(mesh_.triangleCount()) {
  if (order_.empty())
    throw std::invalid_argument("a surface for contacts needs at least one triangle");
  std::iota(order_.begin(), order_.end(), 0);
  neighbour_ = neighbours(mesh_);
  build(0, static_cast<int>(order_.size()));
  updateNormals();
}

Eigen::AlignedBox3d SurfaceTree::boxOf(int triangle) const {
  Eigen::AlignedBox3d box;
  for (int k = 0; k < 3; ++k) box.extend(mesh_.vertex(mesh_.triangles(triangle, k)));
  return box;
}

// Children follow their parent in nodes_, so that refit() may walk backwards.
int SurfaceTree::build(int first, int count) {
  const int id = static_cast<int>(nodes_.size());
  nodes_.push_back({{}, -1, -1, first, count});
  for (int i = first; i < first + count; ++i) nodes_[id].box.extend(boxOf(order_[i]));
  if (count <= kLeafSize) return id;
  int axis = 0;
  nodes_[id].box.diagonal().maxCoeff(&axis);
  const int half = count / 2;
  std::nth_element(order_.begin() + first, order_.begin() + first + half,
                   order_.begin() + first + count, [&](int a, int b) {
                     const double ca = boxOf(a).center()[axis], cb = boxOf(b).center()[axis];
                     return ca != cb ? ca < cb : a < b;
                   });
  const int left = build(first, half), right = build(first + half, count - half);
  nodes_[id].left = left;
  nodes_[id].right = right;
  return id;
}

void SurfaceTree::refit(const decltype(TriangleMesh::vertices)& vertices) {
  mesh_.vertices = vertices;
  for (int id = static_cast<int>(nodes_.size()) - 1; id >= 0; --id) {
    Node& node = nodes_[id];
    node.box.setEmpty();
    if (node.left >= 0)
      node.box.extend(nodes_[node.left].box).extend(nodes_[node.right].box);
    else
      for (int i = node.first; i < node.first + node.count; ++i) node.box.extend(boxOf(order_[i]));
  }
  updateNormals();
}

void SurfaceTree::updateNormals() {
  face_normal_.assign(mesh_.triangleCount(), Eigen::Vector3d::Zero());
  vertex_normal_.assign(mesh_.vertexCount(), Eigen::Vector3d::Zero());
  for (int f = 0; f < mesh_.triangleCount(); ++f) {
    const Eigen::Vector3d p[3] = {mesh_.vertex(mesh_.triangles(f, 0)),
                                  mesh_.vertex(mesh_.triangles(f, 1)),
                                  mesh_.vertex(mesh_.triangles(f, 2))};
    face_normal_[f] = (p[1] - p[0]).cross(p[2] - p[0]).normalized();
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d e = p[(k + 1) % 3] - p[k], g = p[(k + 2) % 3] - p[k];
      vertex_normal_[mesh_.triangles(f, k)] +=
          std::atan2(e.cross(g).norm(), e.dot(g)) * face_normal_[f];
    }
  }
}

Eigen::Vector3d SurfaceTree::pseudoNormal(int f, const Eigen::Vector3d& barycentric) const {
  constexpr double kOnBorder = 1e-9;
  int zeros = 0, zero = 0, largest = 0;
  for (int k = 0; k < 3; ++k)
    if (barycentric[k] < kOnBorder) {
      ++zeros;
      zero = k;
    }
  barycentric.maxCoeff(&largest);
  if (zeros == 2) return vertex_normal_[mesh_.triangles(f, largest)].normalized();
  const int other = zeros == 1 ? neighbour_[f][zero] : -1;
  return other < 0 ? face_normal_[f] : (face_normal_[f] + face_normal_[other]).normalized();
}

void SurfaceTree::improve(int f, const Eigen::Vector3d& point, double& squared,
                          SurfaceHit& hit) const {
  const Eigen::Vector3d a = mesh_.vertex(mesh_.triangles(f, 0)),
                        b = mesh_.vertex(mesh_.triangles(f, 1)),
                        c = mesh_.vertex(mesh_.triangles(f, 2));
  const Eigen::Vector3d w = closestBarycentric(point, a, b, c);
  const Eigen::Vector3d q = w[0] * a + w[1] * b + w[2] * c;
  const double squared_distance = (point - q).squaredNorm();
  if (!(squared_distance < squared)) return;  // also for triangles without area
  squared = squared_distance;
  hit.triangle = f;
  hit.barycentric = w;
  hit.point = q;
}

// Triangles that may be nearer to the point than `squared`, which the visits lower.
template <class Visit>
void SurfaceTree::approach(const Eigen::Vector3d& point, const double& squared,
                           const Visit& visit) const {
  std::vector<int> stack = {0};
  while (!stack.empty()) {
    const Node& node = nodes_[stack.back()];
    stack.pop_back();
    if (node.box.squaredExteriorDistance(point) >= squared) continue;
    if (node.left < 0) {
      for (int i = node.first; i < node.first + node.count; ++i) visit(order_[i]);
      continue;
    }
    // The nearer child is searched first.
    const bool left_first = nodes_[node.left].box.squaredExteriorDistance(point) <=
                            nodes_[node.right].box.squaredExteriorDistance(point);
    stack.push_back(left_first ? node.right : node.left);
    stack.push_back(left_first ? node.left : node.right);
  }
}

// Side and normal of a hit. @return false on a triangle without area
bool SurfaceTree::orient(const Eigen::Vector3d& point, double reach, SurfaceHit& hit) const {
  const Eigen::Vector3d offset = point - hit.point;
  const Eigen::Vector3d pseudo = pseudoNormal(hit.triangle, hit.barycentric);
  const double sign = offset.dot(pseudo) < 0.0 ? -1.0 : 1.0;
  hit.distance = sign * offset.norm();
  hit.normal =
      std::abs(hit.distance) > 1e-6 * reach ? Eigen::Vector3d(offset / hit.distance) : pseudo;
  return hit.normal.squaredNorm() >= 0.5;
}

void SurfaceTree::eachAround(const Eigen::Vector3d& point, double reach,
                             const std::function<void(int)>& visit) const {
  approach(point, reach * reach, visit);
}

std::optional<SurfaceHit> SurfaceTree::nearest(const Eigen::Vector3d& point, double reach) const {
  double squared = reach * reach;
  SurfaceHit hit;
  approach(point, squared, [&](int f) { improve(f, point, squared, hit); });
  if (hit.triangle < 0 || !orient(point, reach, hit)) return std::nullopt;
  return hit;
}

std::optional<SurfaceHit> SurfaceTree::nearest(const Eigen::Vector3d& point, double reach,
                                               const SurfaceFilter& filter) const {
  double squared = reach * reach;
  std::optional<SurfaceHit> best;
  approach(point, squared, [&](int f) {
    if (!filter.regards(f)) return;
    SurfaceHit hit;
    double nearer = squared;
    improve(f, point, nearer, hit);
    if (hit.triangle < 0 || !orient(point, reach, hit) || !filter.accepts(hit)) return;
    squared = nearer;
    best = hit;
  });
  return best;
}

template <class Filter>
std::optional<SurfaceHit> SurfaceTree::firstEntryOf(const Eigen::Vector3d& from,
                                                    const Eigen::Vector3d& to,
                                                    const Filter& accepts) const {
  const Eigen::Vector3d d = to - from;
  Eigen::AlignedBox3d sweep(from.cwiseMin(to), from.cwiseMax(to));
  SurfaceHit hit;
  double first = std::numeric_limits<double>::infinity();
  std::vector<int> stack = {0};
  while (!stack.empty()) {
    const Node& node = nodes_[stack.back()];
    stack.pop_back();
    if (!node.box.intersects(sweep)) continue;
    if (node.left >= 0) {
      stack.push_back(node.right);
      stack.push_back(node.left);
      continue;
    }
    for (int i = node.first; i < node.first + node.count; ++i) {
      const int f = order_[i];
      const Eigen::Vector3d& n = face_normal_[f];
      const Eigen::Vector3d a = mesh_.vertex(mesh_.triangles(f, 0));
      const double height = n.dot(from - a), fall = -n.dot(d);
      if (fall <= 0.0 || height < 0.0 || height > fall || height / fall >= first) continue;
      const Eigen::Vector3d q = from + height / fall * d;
      const Eigen::Vector3d b = mesh_.vertex(mesh_.triangles(f, 1)),
                            c = mesh_.vertex(mesh_.triangles(f, 2));
      const Eigen::Vector3d w = closestBarycentric(q, a, b, c);
      const double size = (b - a).norm() + (c - a).norm();
      if ((w[0] * a + w[1] * b + w[2] * c - q).norm() > 1e-9 * size || !accepts(f)) continue;
      first = height / fall;
      hit = {f, w, q, n, height - fall};
    }
  }
  if (hit.triangle < 0) return std::nullopt;
  return hit;
}

std::optional<SurfaceHit> SurfaceTree::firstEntry(const Eigen::Vector3d& from,
                                                  const Eigen::Vector3d& to) const {
  return firstEntryOf(from, to, [](int) { return true; });
}

std::optional<SurfaceHit> SurfaceTree::firstEntry(const Eigen::Vector3d& from,
                                                  const Eigen::Vector3d& to,
                                                  const std::function<bool(int)>& accepts) const {
  return firstEntryOf(from, to, accepts);
}

}  // namespace calipso::fem
