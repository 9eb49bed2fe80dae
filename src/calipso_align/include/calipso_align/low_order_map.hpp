#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "calipso_align/silhouette.hpp"

// A similarity with a smooth deformation of few parameters, in the camera frame:
//   x(d) = c + t + s exp([w]) (d + l E (d/l) + l Q(d/l)),   d = X - c
//  code   meaning                                                      unit
//  X      model point at the rough pose                                m
//  c, l   centroid and size of the model (fixed)                       m
//  w, t   rotation vector and translation                              rad, m
//  log s  logarithm of the scale
//  E      symmetric strain: xx, yy, zz, xy, xz, yz (rotation is w's)
//  Q      quadratic bending: for each of x, y, z the terms xx, yy, zz, xy, xz, yz
namespace calipso::align {

class LowOrderMap {
 public:
  static constexpr int kRotation = 0, kTranslation = 3, kLogScale = 6, kStrain = 7, kQuadratic = 13;
  static constexpr int kParameters = 31;
  using Parameters = Eigen::Matrix<double, kParameters, 1>;
  using Jacobian = Eigen::Matrix<double, 3, kParameters>;

  // Identity for a model whose points at the rough pose are `X` (camera frame).
  explicit LowOrderMap(const Points& X);

  const Parameters& parameters() const { return p_; }
  void setParameters(const Parameters& p);
  const Eigen::Vector3d& centroid() const { return c_; }
  double size() const { return l_; }  // root mean square distance from the centroid, m

  Eigen::Vector3d operator()(const Eigen::Vector3d& X) const;
  Points apply(const Points& X) const;
  // dx/dp at X; the rotation's columns are for an increment exp([dw]) from the left.
  Jacobian jacobian(const Eigen::Vector3d& X) const;
  // Derivative of g . x(X) by the parameters, g a fixed direction: jacobian(X)' g.
  Parameters gradient(const Eigen::Vector3d& X, const Eigen::Vector3d& g) const;
  // p with the increment added: rotations are composed, all others summed.
  Parameters plus(const Parameters& step) const;
  // The same map with its scale counted as strain: s (1 + E) = 1 + E'.
  void absorbScale();

 private:
  Eigen::Vector3d deformed(const Eigen::Vector3d& d) const;  // d + l E (d/l) + l Q(d/l)

  Eigen::Vector3d c_;
  double l_;
  Parameters p_ = Parameters::Zero();
  Eigen::Matrix3d R_ = Eigen::Matrix3d::Identity();
  double s_ = 1.0;
};

}  // namespace calipso::align
