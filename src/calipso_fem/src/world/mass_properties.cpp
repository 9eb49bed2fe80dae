#include "calipso_fem/world/mass_properties.hpp"

#include <LinearMath/btConvexHullComputer.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <map>
#include <stdexcept>
#include <utility>

namespace calipso::fem {
namespace {

// Integrals of 1, x and x x^T over the solid, each a sum over the tetrahedra (origin, triangle).
struct Moments {
  double volume = 0.0;
  Eigen::Vector3d first = Eigen::Vector3d::Zero();
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
};

Moments moments(const TriangleMesh& mesh, const Eigen::Vector3d& origin) {
  Moments m;
  for (int f = 0; f < mesh.triangleCount(); ++f) {
    const Eigen::Vector3d a = mesh.vertex(mesh.triangles(f, 0)) - origin;
    const Eigen::Vector3d b = mesh.vertex(mesh.triangles(f, 1)) - origin;
    const Eigen::Vector3d c = mesh.vertex(mesh.triangles(f, 2)) - origin;
    const double v = a.dot(b.cross(c)) / 6.0;
    const Eigen::Vector3d s = a + b + c;
    m.volume += v;
    m.first += v / 4.0 * s;
    m.second +=
        v / 20.0 * (s * s.transpose() + a * a.transpose() + b * b.transpose() + c * c.transpose());
  }
  return m;
}

// Is it that of a solid: does its mass spread in every direction? Not where parts are inside out.
bool isSpread(const Moments& m) {
  const Eigen::Vector3d r = m.first / m.volume;
  const Eigen::Vector3d spread =  // ascending
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(m.second - m.volume * r * r.transpose(),
                                                     Eigen::EigenvaluesOnly)
          .eigenvalues();
  return spread[0] > 1e-9 * spread[2];
}

MassProperties fromMoments(const Moments& m, const Eigen::Vector3d& origin, double density) {
  MassProperties p;
  p.volume = m.volume;
  p.mass = density * m.volume;
  const Eigen::Vector3d r = m.first / m.volume;
  p.center = origin + r;
  const Eigen::Matrix3d central = density * (m.second - m.volume * r * r.transpose());
  p.inertia = central.trace() * Eigen::Matrix3d::Identity() - central;
  return p;
}

// Without volume where the points lie in one plane.
TriangleMesh hullOf(const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>& points) {
  btConvexHullComputer hull;
  hull.compute(points.data(), 3 * sizeof(double), static_cast<int>(points.rows()), 0.0, 0.0);
  TriangleMesh mesh;
  mesh.vertices.resize(hull.vertices.size(), 3);
  for (int i = 0; i < hull.vertices.size(); ++i)
    mesh.vertices.row(i) << hull.vertices[i].x(), hull.vertices[i].y(), hull.vertices[i].z();
  std::vector<Eigen::Vector3i> triangles;
  for (int f = 0; f < hull.faces.size(); ++f) {
    const auto* first = &hull.edges[hull.faces[f]];
    // Fan around the face's first vertex.
    for (const auto* e = first->getNextEdgeOfFace();
         e->getTargetVertex() != first->getSourceVertex(); e = e->getNextEdgeOfFace())
      triangles.emplace_back(first->getSourceVertex(), e->getSourceVertex(), e->getTargetVertex());
  }
  mesh.triangles.resize(static_cast<Eigen::Index>(triangles.size()), 3);
  for (size_t f = 0; f < triangles.size(); ++f)
    mesh.triangles.row(static_cast<Eigen::Index>(f)) = triangles[f].transpose();
  if (signedVolume(mesh) < 0.0) mesh.triangles.col(1).swap(mesh.triangles.col(2));
  return mesh;
}

bool hasNoVolume(const TriangleMesh& hull) {
  const double d = hull.vertexCount() ? boundingDiagonal(hull) : 0.0;
  return !(signedVolume(hull) > 1e-12 * d * d * d);
}

}  // namespace

double surfaceArea(const TriangleMesh& mesh) {
  double doubled = 0.0;
  for (int t = 0; t < mesh.triangleCount(); ++t) {
    const Eigen::RowVector3i face = mesh.triangles.row(t);
    const Eigen::Vector3d a = mesh.vertex(face[0]);
    doubled += (mesh.vertex(face[1]) - a).cross(mesh.vertex(face[2]) - a).norm();
  }
  return 0.5 * doubled;
}

bool isClosed(const TriangleMesh& mesh) {
  std::map<std::pair<int, int>, int> balance;
  for (int f = 0; f < mesh.triangleCount(); ++f)
    for (int k = 0; k < 3; ++k) {
      const int i = mesh.triangles(f, k), j = mesh.triangles(f, (k + 1) % 3);
      balance[std::minmax(i, j)] += i < j ? 1 : -1;
    }
  for (const auto& edge : balance)
    if (edge.second != 0) return false;
  return mesh.triangleCount() > 0;
}

TriangleMesh convexHull(const Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>& points) {
  TriangleMesh mesh = hullOf(points);
  if (hasNoVolume(mesh))
    throw std::invalid_argument("convex hull of " + std::to_string(points.rows()) +
                                " points is flat; a solid needs four points off one plane");
  return mesh;
}

bool isFlat(const TriangleMesh& mesh) { return hasNoVolume(hullOf(mesh.vertices)); }

MassProperties massProperties(const TriangleMesh& mesh, double density) {
  if (!(density > 0.0 && std::isfinite(density)))
    throw std::invalid_argument(
        "density = " + std::to_string(density) +
        " kg/m^3; must be > 0 and finite (what nothing can move is static)");
  const Eigen::Vector3d origin = mesh.vertices.colwise().mean().transpose();
  Moments m = moments(mesh, origin);
  const bool inside_out = m.volume < 0.0;
  if (inside_out) m = {-m.volume, -m.first, -m.second};
  const double diagonal = boundingDiagonal(mesh);
  const bool encloses = m.volume > 1e-6 * diagonal * diagonal * diagonal && isClosed(mesh);
  if (encloses && isSpread(m)) {
    MassProperties p = fromMoments(m, origin, density);
    if (inside_out) p.note = "the faces pointed inwards and were turned";
    return p;
  }
  MassProperties p = fromMoments(moments(convexHull(mesh.vertices), origin), origin, density);
  p.note = std::string(encloses ? "parts of the mesh are inside out" : "the mesh is not closed") +
           "; its convex hull stands in for mass and inertia";
  return p;
}

}  // namespace calipso::fem
