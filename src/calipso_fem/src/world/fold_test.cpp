#include "fold_test.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <calipso_scene/disjoint_sets.hpp>
#include <cmath>
#include <numeric>
#include <utility>

namespace calipso::fem {
namespace {

Eigen::Vector3d areaVector(const TriangleMesh& mesh, int f) {
  const Eigen::Vector3d a = mesh.vertex(mesh.triangles(f, 0));
  return 0.5 * (mesh.vertex(mesh.triangles(f, 1)) - a).cross(mesh.vertex(mesh.triangles(f, 2)) - a);
}

// The direction that most of the surface looks along, or against.
Eigen::Vector3d mainDirection(const TriangleMesh& mesh) {
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (int f = 0; f < mesh.triangleCount(); ++f) {
    const Eigen::Vector3d a = areaVector(mesh, f);
    if (a.norm() > 0.0) spread += a * a.transpose() / a.norm();
  }
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spread).eigenvectors().col(2);
}

double cross(const Eigen::Vector2d& o, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return (a - o).x() * (b - o).y() - (a - o).y() * (b - o).x();
}

// Area of the convex hull of points in the plane (Andrew 1979).
double hullArea(std::vector<Eigen::Vector2d> points) {
  std::sort(points.begin(), points.end(), [](const auto& a, const auto& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  });
  std::vector<Eigen::Vector2d> hull;
  for (int pass = 0; pass < 2; ++pass, std::reverse(points.begin(), points.end())) {
    const size_t start = hull.size();
    for (const Eigen::Vector2d& p : points) {
      while (hull.size() >= start + 2 && cross(hull[hull.size() - 2], hull.back(), p) <= 0.0)
        hull.pop_back();
      hull.push_back(p);
    }
    hull.pop_back();
  }
  double area = 0.0;
  for (size_t i = 1; i + 1 < hull.size(); ++i) area += 0.5 * cross(hull[0], hull[i], hull[i + 1]);
  return area;
}

double outlineArea(const TriangleMesh& mesh, const Eigen::Vector3d& axis) {
  const Eigen::Vector3d u = axis.unitOrthogonal(), v = axis.cross(u);
  std::vector<Eigen::Vector2d> points;
  for (int i = 0; i < mesh.vertexCount(); ++i)
    points.emplace_back(u.dot(mesh.vertex(i)), v.dot(mesh.vertex(i)));
  return hullArea(points);
}

}  // namespace

FoldTest::FoldTest(const TriangleMesh& rest) {
  constexpr double kFlat = 0.9;     // cosine
  constexpr double kFilled = 0.85;  // of the outline's hull
  const Eigen::Vector3d axis = mainDirection(rest);
  if (!isThin(rest)) return;
  double sides[2] = {0.0, 0.0};
  std::vector<signed char> side;
  for (int f = 0; f < rest.triangleCount(); ++f) {
    const Eigen::Vector3d a = areaVector(rest, f);
    const double along = axis.dot(a);
    const bool flat = std::abs(along) > kFlat * a.norm();
    side.push_back(flat ? (along > 0.0 ? 1 : -1) : 0);
    if (flat) sides[along > 0.0] += std::abs(along);
  }
  const double outline = outlineArea(rest, axis);
  if (std::min(sides[0], sides[1]) > kFilled * outline) patches_.emplace(rest, std::move(side));
}

bool FoldTest::isUnfolded(const SurfaceTree& surface) {
  if (!patches_) return false;
  patches_->turn(surface);
  return patches_->isUnfolded();
}

std::vector<int> FoldTest::mayMeet(const SurfaceTree& surface, const Eigen::VectorXd& ways,
                                   double margin) {
  if (patches_) return patches_->mayMeet(surface, ways, margin);
  std::vector<int> all(surface.mesh().vertexCount());
  std::iota(all.begin(), all.end(), 0);
  return all;
}

bool isThin(const TriangleMesh& mesh) {
  constexpr double kThin = 1.0 / 40.0;
  constexpr int kMostHoles = 2;  // through it; a lattice has dozens
  DisjointSets pieces(mesh.vertexCount());
  double area = 0.0;
  for (int f = 0; f < mesh.triangleCount(); ++f) {
    area += areaVector(mesh, f).norm();
    for (int k = 1; k < 3; ++k) pieces.join(mesh.triangles(f, 0), mesh.triangles(f, k));
  }
  for (int f = 1; f < mesh.triangleCount(); ++f)
    if (pieces.find(mesh.triangles(f, 0)) != pieces.find(mesh.triangles(0, 0))) return false;
  std::vector<char> used(mesh.vertexCount(), 0);
  for (int f = 0; f < mesh.triangleCount(); ++f)
    for (int k = 0; k < 3; ++k) used[mesh.triangles(f, k)] = 1;
  // Euler's formula of a closed surface, which has three edges to two triangles.
  const long vertices = std::count(used.begin(), used.end(), 1);
  const long holes = 1 - (2 * vertices - mesh.triangleCount()) / 4;
  if (holes > kMostHoles) return false;
  return 2.0 * std::abs(signedVolume(mesh)) / area < kThin * std::sqrt(0.5 * area);
}

}  // namespace calipso::fem
