#include "sheet_patches.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace calipso::fem {
namespace {

constexpr int kLeafSize = 8;  // faces

Eigen::Vector3d centerOf(const TriangleMesh& mesh, int f) {
  return (mesh.vertex(mesh.triangles(f, 0)) + mesh.vertex(mesh.triangles(f, 1)) +
          mesh.vertex(mesh.triangles(f, 2))) /
         3.0;
}

double angleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::acos(std::clamp(a.dot(b), -1.0, 1.0));
}

}  // namespace

// It may go on turning as it has since the last step, twice as fast.
bool SheetPatches::Cone::isUnfolded() const {
  constexpr double kWidest = M_PI / 3.0, kUpright = M_PI / 2.0;
  return angle < kWidest && angle + 2.0 * turning < kUpright;
}

SheetPatches::SheetPatches(const TriangleMesh& rest, std::vector<signed char> side)
    : side_(std::move(side)), order_(rest.triangleCount()) {
  std::iota(order_.begin(), order_.end(), 0);
  build(rest, 0, rest.triangleCount());
}

int SheetPatches::build(const TriangleMesh& rest, int first, int count) {
  const int id = static_cast<int>(patches_.size());
  patches_.emplace_back();
  patches_[id].first = first;
  patches_[id].count = count;
  for (int i = first; i < first + count; ++i)
    for (int k = 0; k < 3; ++k) patches_[id].rest.extend(rest.vertex(rest.triangles(order_[i], k)));
  if (count <= kLeafSize) return id;
  int axis = 0;
  patches_[id].rest.diagonal().maxCoeff(&axis);
  const int half = count / 2;
  std::nth_element(order_.begin() + first, order_.begin() + first + half,
                   order_.begin() + first + count, [&](int a, int b) {
                     const double ca = centerOf(rest, a)[axis], cb = centerOf(rest, b)[axis];
                     return ca != cb ? ca < cb : a < b;
                   });
  const int left = build(rest, first, half), right = build(rest, first + half, count - half);
  patches_[id].left = left;
  patches_[id].right = right;
  return id;
}

void SheetPatches::turn(const SurfaceTree& surface) {
  for (int id = static_cast<int>(patches_.size()) - 1; id >= 0; --id) {
    Patch& p = patches_[id];
    Cone& cone = p.cone;
    if (p.left >= 0) {
      cone.sum = patches_[p.left].cone.sum + patches_[p.right].cone.sum;
    } else {
      cone.sum.setZero();
      for (int i = p.first; i < p.first + p.count; ++i)
        cone.sum += side_[order_[i]] * surface.faceNormal(order_[i]);
    }
    cone.axis = cone.sum.normalized();
    double least = 1.0;
    for (int i = p.first; i < p.first + p.count; ++i)
      if (const int side = side_[order_[i]]; side != 0)
        least = std::min(least, side * cone.axis.dot(surface.faceNormal(order_[i])));
    const double before = std::exchange(cone.angle, std::acos(std::max(-1.0, least)));
    cone.turning = std::abs(cone.angle - before);
  }
  for (Patch& p : patches_) {
    const double lean = angleBetween(p.cone.axis, patches_.front().cone.axis);
    p.cone.turning += std::abs(lean - std::exchange(p.cone.lean, lean));
  }
}

void SheetPatches::refit(const SurfaceTree& surface, const Eigen::VectorXd& ways) {
  const TriangleMesh& mesh = surface.mesh();
  for (int id = static_cast<int>(patches_.size()) - 1; id >= 0; --id) {
    Patch& p = patches_[id];
    p.box.setEmpty();
    p.way = 0.0;
    if (p.left >= 0) {
      p.box.extend(patches_[p.left].box).extend(patches_[p.right].box);
      p.way = std::max(patches_[p.left].way, patches_[p.right].way);
      continue;
    }
    for (int i = p.first; i < p.first + p.count; ++i)
      for (int k = 0; k < 3; ++k) {
        const int v = mesh.triangles(order_[i], k);
        p.box.extend(mesh.vertex(v));
        p.way = std::max(p.way, ways[v]);
      }
  }
}

// Whether the sheet is not folded in the rectangle around two patches, which holds what is straight
// between them at rest.
bool SheetPatches::isUnfoldedAround(const Patch& a, const Patch& b) const {
  const Eigen::AlignedBox3d piece = a.rest.merged(b.rest);
  const Eigen::Vector3d axis = (a.cone.sum + b.cone.sum).normalized();
  std::vector<int> stack = {0};
  while (!stack.empty()) {
    const Patch& p = patches_[stack.back()];
    stack.pop_back();
    if (!p.rest.intersects(piece)) continue;
    if (p.left >= 0 && !piece.contains(p.rest)) {
      stack.push_back(p.left);
      stack.push_back(p.right);
    } else if (!p.cone.sum.isZero(0.0)) {  // not a piece of the rim alone
      Cone cone = p.cone;
      cone.angle += angleBetween(axis, cone.axis);
      if (!cone.isUnfolded()) return false;
    }
  }
  return true;
}

// The pairs of parts that a patch meets itself by, if it does.
void SheetPatches::divide(int patch, std::vector<std::pair<int, int>>& pairs) const {
  const Patch& p = patches_[patch];
  pairs.emplace_back(p.left, p.left);
  pairs.emplace_back(p.right, p.right);
  pairs.emplace_back(p.left, p.right);
}

std::vector<int> SheetPatches::mayMeet(const SurfaceTree& surface, const Eigen::VectorXd& ways,
                                       double margin) {
  refit(surface, ways);
  std::vector<bool> meets(patches_.size(), false);
  std::vector<std::pair<int, int>> pairs = {{0, 0}};
  while (!pairs.empty()) {
    const auto [i, j] = pairs.back();
    pairs.pop_back();
    const Patch &a = patches_[i], &b = patches_[j];
    if (i == j ? a.cone.isUnfolded()
               : a.box.exteriorDistance(b.box) > margin + a.way + b.way || isUnfoldedAround(a, b))
      continue;
    if (i == j && a.left >= 0) {
      divide(i, pairs);
    } else if (a.left < 0 && b.left < 0) {
      meets[i] = meets[j] = true;
    } else if (b.left < 0 || (a.left >= 0 && a.count >= b.count)) {
      pairs.emplace_back(a.left, j);
      pairs.emplace_back(a.right, j);
    } else {
      pairs.emplace_back(i, b.left);
      pairs.emplace_back(i, b.right);
    }
  }
  const TriangleMesh& mesh = surface.mesh();
  std::vector<int> vertices;
  for (size_t id = 0; id < patches_.size(); ++id)
    for (int i = patches_[id].first; meets[id] && i < patches_[id].first + patches_[id].count; ++i)
      for (int k = 0; k < 3; ++k) vertices.push_back(mesh.triangles(order_[i], k));
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  return vertices;
}

}  // namespace calipso::fem
