#pragma once

#include <Eigen/Geometry>

#include "calipso_align/low_order_map.hpp"

// What a deformed body is said to have moved by: the rigid motion that comes closest.
namespace calipso::align {

// The rigid motion that brings `from` closest to `to` (least squares, Kabsch 1976).
Eigen::Isometry3d bestRigid(const Points& from, const Points& to);

// The rigid part of a map, about the model's centroid, and how it changes with the map's
// parameters.
//  d_i  model point from its centroid      x_i  where the map takes it, from their centroid
//  R    rotation for which sum |x_i - R d_i|^2 is least:   sum (R d_i) x x_i = 0
//  so that a change of x_i turns it by     (tr(S) 1 - S)^-1 sum (R d_i) x dx_i
//  with                                    S = sum (R d_i) x_i'
// NOTE: the rotation vector's change is taken for that turn, which holds up to half the rotation
// vector's length.
struct RigidPart {
  Eigen::Vector3d rotation;     // rotation vector, rad
  Eigen::Vector3d translation;  // of the centroid, m
  Eigen::Matrix<double, 3, LowOrderMap::kParameters> rotation_by_parameters;
  Eigen::Matrix<double, 3, LowOrderMap::kParameters> translation_by_parameters;
};

RigidPart rigidPart(const Points& X, const LowOrderMap& map);

}  // namespace calipso::align
