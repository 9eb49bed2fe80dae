#pragma once

#include <Eigen/Geometry>
#include <Eigen/SparseCore>
#include <calipso_scene/triangle_mesh.hpp>
#include <optional>

namespace calipso::flow {

// Smooth displacements of an object, by a coarse lattice of control points c_m over its box of
// principal axes:
//   u(X) = sum_m w_m(X) c_m
// Cubic B-splines along axes that are long, linear along short ones, constant through a sheet.
class DeformationField {
 public:
  using Weights = Eigen::SparseMatrix<double, Eigen::RowMajor>;  // #points x size()
  using Points = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

  // @param spans  B-spline intervals along the longest axis, >= 1
  // @throw std::invalid_argument when the mesh has no extent
  DeformationField(const TriangleMesh& mesh, int spans);

  int size() const { return counts_.prod(); }  // control points
  // @param points  object frame, m; points outside of the box take the values at its faces
  Weights weightsAt(const Points& points) const;
  // Unit normal of an object that is a thin sheet, object frame.
  const std::optional<Eigen::Vector3d>& sheetNormal() const { return sheet_normal_; }
  // R of the roughness  c^T R c: the sum of squared second differences of neighbouring controls.
  Eigen::MatrixXd roughness() const;

 private:
  int index(const Eigen::Vector3i& at) const {
    return at.x() + counts_.x() * (at.y() + counts_.y() * at.z());
  }

  Eigen::Matrix3d axes_;        // columns, object frame
  Eigen::Vector3d low_, size_;  // of the box along the axes, m
  Eigen::Vector3i counts_;      // control points along each axis: 1, 2 or spans + 3
  std::optional<Eigen::Vector3d> sheet_normal_;
};

}  // namespace calipso::flow
