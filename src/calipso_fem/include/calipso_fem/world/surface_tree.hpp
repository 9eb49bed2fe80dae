#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <optional>
#include <vector>

#include "calipso_scene/triangle_mesh.hpp"

namespace calipso::fem {

struct SurfaceHit {
  int triangle = -1;
  Eigen::Vector3d barycentric = Eigen::Vector3d::Zero();
  Eigen::Vector3d point = Eigen::Vector3d::Zero();    // on the surface, m
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  // outwards, unit length
  double distance = 0.0;                              // m, negative inside
};

// Which triangles a search looks at, and which of their nearest points count.
struct SurfaceFilter {
  std::function<bool(int triangle)> regards;
  std::function<bool(const SurfaceHit& hit)> accepts;
};

// Barycentric coordinates of the point of triangle abc nearest to p.
Eigen::Vector3d closestBarycentric(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                   const Eigen::Vector3d& b, const Eigen::Vector3d& c);

// Bounding-volume hierarchy over a triangle surface: signed distances (angle-weighted
// pseudo-normals, Baerentzen and Aanaes 2005) and swept points. Vertices may move; then refit().
class SurfaceTree {
 public:
  explicit SurfaceTree(TriangleMesh mesh);

  // Same triangles, new vertex positions (#V x 3, m).
  void refit(const decltype(TriangleMesh::vertices)& vertices);

  // Nearest point of the surface if it is closer than `reach` (m).
  std::optional<SurfaceHit> nearest(const Eigen::Vector3d& point, double reach) const;
  // First triangle that the segment from -> to enters through its outer side; distance is the depth
  // of `to` behind it, negative.
  std::optional<SurfaceHit> firstEntry(const Eigen::Vector3d& from,
                                       const Eigen::Vector3d& to) const;
  // The same among some of the triangles.
  std::optional<SurfaceHit> nearest(const Eigen::Vector3d& point, double reach,
                                    const SurfaceFilter& filter) const;
  std::optional<SurfaceHit> firstEntry(const Eigen::Vector3d& from, const Eigen::Vector3d& to,
                                       const std::function<bool(int triangle)>& accepts) const;

  // Triangles whose boxes are within `reach` (m) of the point's.
  void eachAround(const Eigen::Vector3d& point, double reach,
                  const std::function<void(int triangle)>& visit) const;

  const TriangleMesh& mesh() const { return mesh_; }
  const Eigen::Vector3d& faceNormal(int triangle) const { return face_normal_[triangle]; }
  const Eigen::Vector3d& vertexNormal(int vertex) const {
    return vertex_normal_[vertex];
  }  // not of unit length
  const Eigen::AlignedBox3d& bounds() const { return nodes_.front().box; }

 private:
  struct Node {
    Eigen::AlignedBox3d box;
    int left = -1, right = -1;  // children; leaves: -1
    int first = 0, count = 0;   // range in order_
  };

  template <class Visit>
  void approach(const Eigen::Vector3d& point, const double& squared, const Visit& visit) const;
  bool orient(const Eigen::Vector3d& point, double reach, SurfaceHit& hit) const;
  template <class Filter>
  std::optional<SurfaceHit> firstEntryOf(const Eigen::Vector3d& from, const Eigen::Vector3d& to,
                                         const Filter& accepts) const;
  int build(int first, int count);
  Eigen::AlignedBox3d boxOf(int triangle) const;
  void updateNormals();
  void improve(int triangle, const Eigen::Vector3d& point, double& squared, SurfaceHit& hit) const;
  Eigen::Vector3d pseudoNormal(int triangle, const Eigen::Vector3d& barycentric) const;

  TriangleMesh mesh_;
  std::vector<Node> nodes_;
  std::vector<int> order_;                  // triangles, grouped by leaf
  std::vector<Eigen::Vector3i> neighbour_;  // across the edge opposite to each corner; -1: border
  std::vector<Eigen::Vector3d> face_normal_, vertex_normal_;
};

}  // namespace calipso::fem
