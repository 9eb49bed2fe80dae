#include "self_proximity.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "obstacle_query.hpp"

namespace calipso::fem {
namespace {

constexpr int kNone = -1;
constexpr double kOutwards = 1e-3;  // thicknesses: off the vertex's own surface

std::vector<std::array<int, 8>> carriers(const Embedding& embedding) {
  std::vector<std::array<int, 8>> all(embedding.vertexCount());
  for (int v = 0; v < embedding.vertexCount(); ++v) {
    all[v].fill(kNone);
    int k = 0;
    for (Eigen::SparseMatrix<double, Eigen::RowMajor>::InnerIterator it(embedding.weights, v);
         it && k < 8; ++it)
      if (it.value() != 0.0) all[v][k++] = static_cast<int>(it.col());
    std::sort(all[v].begin(), all[v].begin() + k);
  }
  return all;
}

double areaOf(const TriangleMesh& mesh) {
  double area = 0.0;
  for (int f = 0; f < mesh.triangleCount(); ++f) {
    const Eigen::Vector3d a = mesh.vertex(mesh.triangles(f, 0));
    area +=
        0.5 *
        (mesh.vertex(mesh.triangles(f, 1)) - a).cross(mesh.vertex(mesh.triangles(f, 2)) - a).norm();
  }
  return area;
}

double meanEdge(const TriangleMesh& mesh) {
  double sum = 0.0;
  for (int f = 0; f < mesh.triangleCount(); ++f)
    for (int k = 0; k < 3; ++k)
      sum +=
          (mesh.vertex(mesh.triangles(f, k)) - mesh.vertex(mesh.triangles(f, (k + 1) % 3))).norm();
  return sum / (3.0 * mesh.triangleCount());
}

// Where surfaces touch the way between them has no direction: across the face then, on its border
// between the two.
Eigen::Vector3d normalOfTouch(const SurfaceTree& surface, int vertex, const SurfaceHit& hit) {
  constexpr double kOnBorder = 1e-9;
  const Eigen::Vector3d& face = surface.faceNormal(hit.triangle);
  if (hit.barycentric.minCoeff() > kOnBorder) return face;
  Eigen::Vector3d looks = Eigen::Vector3d::Zero();
  for (int k = 0; k < 3; ++k)
    looks += hit.barycentric[k] *
             surface.vertexNormal(surface.mesh().triangles(hit.triangle, k)).normalized();
  const Eigen::Vector3d between = looks - surface.vertexNormal(vertex).normalized();
  return between.norm() > 0.5 ? Eigen::Vector3d(between.normalized()) : face;
}

template <class OnePiece>
int countCrossings(const SurfaceTree& surface, double depth, const OnePiece& areOne) {
  int count = 0;
  const TriangleMesh& mesh = surface.mesh();
  for (int f = 0; f < mesh.triangleCount(); ++f)
    for (int k = 0; k < 3; ++k) {
      const int a = mesh.triangles(f, k), b = mesh.triangles(f, (k + 1) % 3);
      const auto hit = surface.firstEntry(mesh.vertex(a), mesh.vertex(b), [&](int other) {
        return !areOne(a, other) && !areOne(b, other);
      });
      if (hit && hit->distance < -depth) ++count;
    }
  return count;
}

}  // namespace

// NOTE: a face that looks away from a vertex beside it has to turn before it can meet it, and moves
// its corners by about half an edge: a surface that has moved by less than `spare` since has not.
SelfProximity::SelfProximity(const TriangleMesh& rest, const Embedding& embedding)
    : rest_(rest),
      nodes_(carriers(embedding)),
      fold_(rest),
      thickness_(2.0 * std::abs(signedVolume(rest)) / areaOf(rest)),
      spare_(0.5 * meanEdge(rest)) {}

bool SelfProximity::shareANode(int vertex, int triangle) const {
  for (int k = 0; k < 3; ++k) {
    const auto &a = nodes_[vertex], &b = nodes_[rest_.triangles(triangle, k)];
    for (size_t i = 0, j = 0; i < a.size() && j < b.size() && a[i] != kNone && b[j] != kNone;) {
      if (a[i] == b[j]) return true;
      a[i] < b[j] ? ++i : ++j;
    }
  }
  return false;
}

bool SelfProximity::onePiece(int vertex, int triangle, double apart) const {
  if (shareANode(vertex, triangle)) return true;
  const Eigen::Vector3d p = rest_.vertex(vertex), a = rest_.vertex(rest_.triangles(triangle, 0)),
                        b = rest_.vertex(rest_.triangles(triangle, 1)),
                        c = rest_.vertex(rest_.triangles(triangle, 2));
  const Eigen::Vector3d w = closestBarycentric(p, a, b, c);
  return (w[0] * a + w[1] * b + w[2] * c - p).squaredNorm() <= apart * apart;
}

double SelfProximity::shallow(double apart) const {
  constexpr double kOfDistance = 0.1, kOfThickness = 0.25;
  return std::min(kOfDistance * apart, kOfThickness * thickness_);
}

std::optional<SurfaceHit> SelfProximity::nearest(const SurfaceTree& surface, int vertex,
                                                 const Eigen::Vector3d& at, double reach,
                                                 double apart, double depth) const {
  constexpr double kBlunt = 0.02;  // minimal distances
  const double known = shallow(apart) + depth, deepest = std::max(known, 0.5 * thickness_);
  const Eigen::Vector3d& looks = surface.vertexNormal(vertex);
  // What got in deeper than that unnoticed, at a rim, is found again as long as it is in the nearer
  // half.
  std::optional<bool> inside;
  const auto isInside = [&] {
    if (!inside)
      inside = encloses(surface.mesh(), at + kOutwards * thickness_ * looks.normalized());
    return *inside;
  };
  SurfaceFilter filter;
  filter.regards = [&](int f) {
    const Eigen::Vector3d& n = surface.faceNormal(f);
    return n.dot(looks) < 0.0 &&
           n.dot(at - surface.mesh().vertex(surface.mesh().triangles(f, 0))) >= -deepest;
  };
  filter.accepts = [&](const SurfaceHit& hit) {
    if (hit.distance < -deepest || onePiece(vertex, hit.triangle, apart)) return false;
    return hit.distance >= -known || isInside();
  };
  std::optional<SurfaceHit> hit = surface.nearest(at, std::max(reach, deepest), filter);
  if (hit && std::abs(hit->distance) < kBlunt * apart)
    hit->normal = normalOfTouch(surface, vertex, *hit);
  return hit;
}

std::vector<SurfaceHit> SelfProximity::ahead(const SurfaceTree& surface, int vertex, double reach,
                                             double apart) const {
  std::vector<SurfaceHit> hits;
  const TriangleMesh& mesh = surface.mesh();
  const Eigen::Vector3d x = mesh.vertex(vertex), &looks = surface.vertexNormal(vertex);
  surface.eachAround(x, reach, [&](int f) {
    const Eigen::Vector3d& n = surface.faceNormal(f);
    const Eigen::Vector3d a = mesh.vertex(mesh.triangles(f, 0)),
                          b = mesh.vertex(mesh.triangles(f, 1)),
                          c = mesh.vertex(mesh.triangles(f, 2));
    if (n.dot(looks) >= 0.0 || n.dot(x - a) < 0.0) return;
    const Eigen::Vector3d w = closestBarycentric(x, a, b, c), q = w[0] * a + w[1] * b + w[2] * c;
    const double distance = (x - q).norm();
    if (distance < reach && !onePiece(vertex, f, apart)) hits.push_back({f, w, q, n, distance});
  });
  return hits;
}

int SelfProximity::crossings(const SurfaceTree& surface, double apart, double depth) const {
  return countCrossings(
      surface, depth, [&](int vertex, int triangle) { return onePiece(vertex, triangle, apart); });
}

int crossings(const SurfaceTree& surface, double depth) {
  return countCrossings(surface, depth, [&](int vertex, int triangle) {
    return (surface.mesh().triangles.row(triangle).array() == vertex).any();
  });
}

bool SelfProximity::isUnfolded(const SurfaceTree& surface) { return fold_.isUnfolded(surface); }

bool SelfProximity::staysFar(const SurfaceTree& surface, const Eigen::Isometry3d& motion,
                             double travel) const {
  if (!far_ || !(travel < spare_)) return false;
  const Eigen::Isometry3d since = motion * far_->motion.inverse();
  const Vertices carried =
      (far_->vertices * since.linear().transpose()).rowwise() + since.translation().transpose();
  const double moved =
      std::sqrt((surface.mesh().vertices - carried).rowwise().squaredNorm().maxCoeff());
  return 2.0 * moved + travel < spare_;
}

void SelfProximity::searched(const SurfaceTree& surface, const Eigen::Isometry3d& motion,
                             size_t vertices, bool far) {
  searches_ += static_cast<long>(vertices);
  far_.reset();
  if (far) far_ = Far{surface.mesh().vertices, motion};
}

}  // namespace calipso::fem
