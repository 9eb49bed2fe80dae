#include "calipso_fem/material_model.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "material_split.hpp"

namespace calipso::fem {
namespace {

constexpr std::array<std::pair<MaterialModel, const char*>, 5> kNames = {{
    {MaterialModel::kLinear, "linear"},
    {MaterialModel::kStVenantKirchhoff, "stvk"},
    {MaterialModel::kStableNeoHookean, "snh"},
    {MaterialModel::kStableNeoHookeanNoLog, "snh0"},
    {MaterialModel::kCorotated, "corot"},
}};

}  // namespace

Lame lameParameters(const Material& material) {
  validate(material);
  const double E = material.youngs_modulus, nu = material.poissons_ratio;
  return {E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), 0.5 * E / (1.0 + nu)};
}

double energyDensity(MaterialModel model, const Lame& lame, const Eigen::Matrix3d& F) {
  return evaluateSplit(model, lame, F, 0).energy();
}

Eigen::Matrix3d stress(MaterialModel model, const Lame& lame, const Eigen::Matrix3d& F) {
  return evaluateSplit(model, lame, F, 1).stress();
}

Matrix9d tangent(MaterialModel model, const Lame& lame, const Eigen::Matrix3d& F) {
  return evaluateSplit(model, lame, F, 2).tangent();
}

double restEnergyDensity(MaterialModel model, const Lame& lame) {
  return energyDensity(model, lame, Eigen::Matrix3d::Identity());
}

Matrix9d projectPositive(const Matrix9d& H) {
  const Eigen::SelfAdjointEigenSolver<Matrix9d> eigen(H);
  if (eigen.eigenvalues()[0] >= 0.0) return H;
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).asDiagonal() *
         eigen.eigenvectors().transpose();
}

double vonMises(const Eigen::Matrix3d& P, const Eigen::Matrix3d& F) {
  const double J = F.determinant();
  const Eigen::Matrix3d sigma = P * F.transpose() / (std::abs(J) > 1e-12 ? J : 1e-12);
  const Eigen::Matrix3d deviator = sigma - sigma.trace() / 3.0 * Eigen::Matrix3d::Identity();
  return std::sqrt(1.5) * deviator.norm();
}

std::string toString(MaterialModel model) {
  for (const auto& [value, name] : kNames)
    if (value == model) return name;
  return "unknown";
}

MaterialModel materialModelFromString(const std::string& name) {
  for (const auto& [value, known] : kNames)
    if (name == known) return value;
  throw std::invalid_argument("material model '" + name +
                              "': known are linear, stvk, snh, snh0, corot");
}

}  // namespace calipso::fem
