#pragma once

#include <Eigen/Core>
#include <string>

#include "calipso_scene/material.hpp"

// Energy densities of isotropic hyperelastic materials, their first derivative P = dPsi/dF (first
// Piola-Kirchhoff stress) and second derivative dP/dF. SI units.
//  symbol   code     meaning
//  F        F        deformation gradient
//  Psi      psi      energy per rest volume, J/m^3
//  lambda   lambda   first Lame parameter, Pa
//  mu       mu       shear modulus, Pa
namespace calipso::fem {

enum class MaterialModel {
  kLinear,                 // mu eps:eps + lambda/2 tr(eps)^2
  kStVenantKirchhoff,      // mu E:E + lambda/2 tr(E)^2, E = (F^T F - I) / 2
  kStableNeoHookean,       // Smith, de Goes, Kim 2018, eq. 13 with the log barrier, rest-consistent
  kStableNeoHookeanNoLog,  // mu/2 (I_C - 3) - mu (J - 1) + (lambda + mu)/2 (J - 1)^2
  kCorotated               // mu |F - R|^2 + lambda/2 tr(R^T F - I)^2
};

struct Lame {
  double lambda = 0.0, mu = 0.0;
};

// Derivative of vec(P) by vec(F), both column by column.
using Matrix9d = Eigen::Matrix<double, 9, 9>;

// @throw std::invalid_argument as validate(Material)
Lame lameParameters(const Material& material);

// Psi(F); zero at F = I for every model but kStableNeoHookean (see restEnergyDensity).
double energyDensity(MaterialModel model, const Lame& lame, const Eigen::Matrix3d& F);
Eigen::Matrix3d stress(MaterialModel model, const Lame& lame, const Eigen::Matrix3d& F);
Matrix9d tangent(MaterialModel model, const Lame& lame, const Eigen::Matrix3d& F);

// Psi(I).
double restEnergyDensity(MaterialModel model, const Lame& lame);

// Nearest positive semi-definite matrix (Frobenius norm) of a symmetric one.
Matrix9d projectPositive(const Matrix9d& H);

// Rotation of the polar decomposition F = R S with det R = +1, also for inverted F.
Eigen::Matrix3d polarRotation(const Eigen::Matrix3d& F);

// Von Mises equivalent of the Cauchy stress P F^T / det F, Pa.
double vonMises(const Eigen::Matrix3d& P, const Eigen::Matrix3d& F);

std::string toString(MaterialModel model);
MaterialModel materialModelFromString(const std::string& name);  // @throw std::invalid_argument

}  // namespace calipso::fem
