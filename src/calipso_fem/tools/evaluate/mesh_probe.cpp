#include "mesh_probe.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <stdexcept>

namespace calipso::fem {
namespace {

using Eigen::Vector3d;

double sizeOf(const VolumeMesh& mesh) {
  return (mesh.nodes.colwise().maxCoeff() - mesh.nodes.colwise().minCoeff()).norm();
}

Eigen::VectorXd shape(const Vector3d& xi, int corners) {
  Eigen::VectorXd N(corners);
  if (corners == 4) {
    N << 1.0 - xi.sum(), xi.x(), xi.y(), xi.z();
    return N;
  }
  for (int c = 0; c < 8; ++c)
    N[c] = (c & 1 ? xi.x() : 1 - xi.x()) * (c & 2 ? xi.y() : 1 - xi.y()) *
           (c & 4 ? xi.z() : 1 - xi.z());
  return N;
}

// Parent coordinates in [0, 1]^3 (simplex for tetrahedra) by Newton with a difference Jacobian,
// exact for the affine and bilinear cells met here.
Vector3d invertMap(const Eigen::MatrixXd& corners, const Vector3d& p) {
  const int n = static_cast<int>(corners.rows());
  Vector3d xi = Vector3d::Constant(n == 4 ? 0.25 : 0.5);
  for (int it = 0; it < 30; ++it) {
    const Vector3d r = corners.transpose() * shape(xi, n) - p;
    Eigen::Matrix3d J;
    constexpr double kStep = 1e-3;
    for (int a = 0; a < 3; ++a)
      J.col(a) =
          corners.transpose() *
          (shape(xi + kStep * Vector3d::Unit(a), n) - shape(xi - kStep * Vector3d::Unit(a), n)) /
          (2.0 * kStep);
    const Vector3d d = J.inverse() * r;
    xi -= d;
    if (d.norm() < 1e-14) break;
  }
  return xi;
}

Eigen::MatrixXd cornersOf(const VolumeMesh& mesh, int cell) {
  Eigen::MatrixXd corners(mesh.cells.cols(), 3);
  for (int c = 0; c < mesh.cells.cols(); ++c) corners.row(c) = mesh.nodes.row(mesh.cells(cell, c));
  return corners;
}

// Area-weighted load of one face with the given corners, equally to all of them: exact for
// triangles and parallelograms.
void addFace(const VolumeMesh& mesh, const std::vector<int>& face, const Vector3d& traction,
             Vec* f) {
  const auto at = [&](int k) { return mesh.node(face[k]); };
  double area = 0.5 * (at(1) - at(0)).cross(at(2) - at(0)).norm();
  // The four corners of a lattice face come in the order 00, 10, 01, 11.
  if (face.size() == 4) area += 0.5 * (at(1) - at(3)).cross(at(2) - at(3)).norm();
  for (int node : face) f->segment<3>(3 * node) += area / face.size() * traction;
}

}  // namespace

std::vector<int> nodesOnPlane(const VolumeMesh& mesh, int axis, double value) {
  const double tolerance = 1e-9 * sizeOf(mesh);
  std::vector<int> nodes;
  for (int i = 0; i < mesh.nodeCount(); ++i)
    if (std::abs(mesh.nodes(i, axis) - value) <= tolerance) nodes.push_back(i);
  return nodes;
}

Vec planeTraction(const VolumeMesh& mesh, int axis, double value, const Vector3d& traction) {
  const double tolerance = 1e-9 * sizeOf(mesh);
  Vec f = Vec::Zero(3 * mesh.nodeCount());
  const std::size_t face_corners = mesh.isTetrahedral() ? 3 : 4;
  for (int cell = 0; cell < mesh.cellCount(); ++cell) {
    std::vector<int> face;
    for (int c = 0; c < mesh.cells.cols(); ++c)
      if (std::abs(mesh.nodes(mesh.cells(cell, c), axis) - value) <= tolerance)
        face.push_back(mesh.cells(cell, c));
    if (face.size() == face_corners) addFace(mesh, face, traction, &f);
  }
  return f;
}

Vector3d displacementAt(const VolumeMesh& mesh, const Vec& x, const Vector3d& p) {
  const int n = static_cast<int>(mesh.cells.cols());
  constexpr double kInside = 1e-7;
  for (int cell = 0; cell < mesh.cellCount(); ++cell) {
    const Eigen::MatrixXd corners = cornersOf(mesh, cell);
    const double reach = (corners.colwise().maxCoeff() - corners.colwise().minCoeff()).norm();
    if ((corners.row(0).transpose() - p).norm() > 1.001 * reach) continue;
    const Vector3d xi = invertMap(corners, p);
    const bool inside = n == 4 ? xi.minCoeff() > -kInside && xi.sum() < 1.0 + kInside
                               : xi.minCoeff() > -kInside && xi.maxCoeff() < 1.0 + kInside;
    if (!inside) continue;
    const Eigen::VectorXd N = shape(xi, n);
    Vector3d u = Vector3d::Zero();
    for (int c = 0; c < n; ++c) {
      const int node = mesh.cells(cell, c);
      u += N[c] * (x.segment<3>(3 * node) - mesh.node(node));
    }
    return u;
  }
  throw std::invalid_argument("no cell holds the material point asked for");
}

}  // namespace calipso::fem
