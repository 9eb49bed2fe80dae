#include "light/reflectance_cost.hpp"

#include <algorithm>
#include <cmath>

#include "calipso_render/light.hpp"

namespace calipso::render {

bool ReflectanceCost::Evaluate(double const* const* parameters, double* residuals,
                               double** jacobians) const {
  using Map = Eigen::Map<const Eigen::Vector3d>;
  using Column = Eigen::Map<Eigen::Array3d>;
  using Square = Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>;
  const Eigen::Vector3d l = Map(parameters[0]);
  const Eigen::Array3d A = Map(parameters[1]).array().exp(), L = Map(parameters[2]).array().exp();
  const double g = parameters[3][0], ks = std::exp(parameters[5][0]),
               m = std::exp(parameters[5][1]);
  const Eigen::Array3d a = Map(parameters[4]).array().exp();
  const double nl = std::max(0.0, s_.normal.dot(l));
  const Lobe T = torranceSparrowLobe(s_.normal, l, s_.view, m);

  const double nv = s_.normal.dot(s_.view),
               mirrored_height = (2.0 * nv * s_.normal - s_.view).dot(s_.up);
  const double mirrored = ks * s_.even * grazing(static_cast<float>(nv));

  const Eigen::Array3d more = A - (1.0 - g) * A.mean() * s_.below;  // D
  const Eigen::Array3d ambient = A * s_.even + more * s_.lean,
                       sun = L * (s_.visible * nl + s_.thrown_sun);
  const Eigen::Array3d highlight = ks * T.value * s_.visible * L,
                       surroundings = mirrored * (A + more * mirrored_height);
  Column r(residuals);
  r = (a * (ambient + sun) + highlight + surroundings - s_.radiance.array()) / s_.scale;
  if (jacobians == nullptr) return true;

  if (jacobians[0] != nullptr) {
    const Eigen::Vector3d dnl = nl > 0.0 ? s_.normal : Eigen::Vector3d(Eigen::Vector3d::Zero());
    const Eigen::Vector3d per_sun = L * s_.visible / s_.scale;
    Square J(jacobians[0]);
    J = (per_sun.array() * a).matrix() * dnl.transpose() + ks * per_sun * T.by_light.transpose();
  }
  const Eigen::Array3d by_more = a * s_.lean + mirrored * mirrored_height;
  if (jacobians[1] != nullptr) {
    Square J(jacobians[1]);
    const Eigen::Array3d own = A * (a * s_.even + mirrored + by_more);
    J = Eigen::Matrix3d((own / s_.scale).matrix().asDiagonal());
    J -= ((1.0 - g) / 3.0 / s_.scale * by_more * s_.below).matrix() * A.matrix().transpose();
  }
  if (jacobians[2] != nullptr) {
    Square J(jacobians[2]);
    J = Eigen::Matrix3d(((a * sun + highlight) / s_.scale).matrix().asDiagonal());
  }
  if (jacobians[3] != nullptr) {
    Column J(jacobians[3]);
    J = by_more * A.mean() * s_.below / s_.scale;
  }
  if (jacobians[4] != nullptr) {
    Square J(jacobians[4]);
    J = Eigen::Matrix3d((a * (ambient + sun) / s_.scale).matrix().asDiagonal());
  }
  if (jacobians[5] != nullptr) {
    Eigen::Map<Eigen::Matrix<double, 3, 2, Eigen::RowMajor>> J(jacobians[5]);
    J.col(0) = (highlight + surroundings) / s_.scale;
    J.col(1) = ks * m * T.by_roughness * s_.visible * L / s_.scale;
  }
  return true;
}

}  // namespace calipso::render
