#pragma once

#include <ceres/sized_cost_function.h>

#include <Eigen/Core>

namespace calipso::render {

// What one pixel's three channels say about light and material (paper: section 6, eqs. 10, 11).
//   (a E + ks (T L V + F S (A + D r.up)) - I) / scale
//   E = A S + D U + L (V max(0, n.l) + B)
//   D = A - (1 - g) mean(A) c: half of what the upper hemisphere sends more than the lower one,
//       whose colour c is known
//   T = torranceSparrow(n, l, v, m),  F = grazing(n.v)
//   r: v mirrored at n,  V, S: visible part of sun and sky,  U: how far that sky lies upwards,
//   B: sunlight that the object throws back (of l as it was, a constant here)
// Parameter blocks, colours as logarithms so that they stay positive:
//   0  l   direction to the sun, unit, world   3
//   1  A   ambient light                       3
//   2  L   sun                                 3
//   3  g   how much brighter the sky is        1
//   4  a   albedo of the pixel's cluster       3
//   5  log ks, log m                           2
class ReflectanceCost : public ceres::SizedCostFunction<3, 3, 3, 3, 1, 3, 2> {
 public:
  struct Sample {
    Eigen::Array3d below = {1.0, 1.0, 1.0};  // c, mean 1
    Eigen::Vector3d normal, view, up;        // unit, world
    Eigen::Vector3d radiance;                // I, linear B, G, R
    double visible = 1.0, even = 1.0;        // V, S
    double lean = 0.0, thrown_sun = 0.0;     // U, B
    double scale = 1.0;
  };
  explicit ReflectanceCost(const Sample& sample) : s_(sample) {}

  bool Evaluate(double const* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  Sample s_;
};

}  // namespace calipso::render
