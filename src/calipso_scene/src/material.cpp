#include "calipso_scene/material.hpp"

#include <cmath>
#include <sstream>
#include <stdexcept>

namespace calipso {

namespace {

void require(bool holds, const char* name, double value, const char* range) {
  if (holds) return;
  std::ostringstream text;
  text << name << " = " << value << " is not allowed; it must be " << range;
  throw std::invalid_argument(text.str());
}

}  // namespace

Material defaultMaterial(double diagonal, double gravity) {
  // A cube of edge L under its own weight shortens by rho g L^2 / 2E; a slender body bends by about
  // fifty times more. E = 500 rho g L keeps the first at a thousandth of L.
  constexpr double kStiffnessOverWeight = 500.0;
  constexpr double kWeightless = 1e-3;  // m/s^2: below it, 9.81 sets the scale
  Material material;
  const double g = std::abs(gravity) > kWeightless ? std::abs(gravity) : 9.81;
  material.youngs_modulus = kStiffnessOverWeight * material.density * g * diagonal;
  return material;
}

void validate(const Material& material) {
  const double E = material.youngs_modulus;
  const double nu = material.poissons_ratio;
  require(std::isfinite(E) && E > 0.0, "youngs_modulus", E, "finite and > 0 Pa");
  require(std::isfinite(nu) && nu > -1.0 && nu < 0.5, "poissons_ratio", nu, "in (-1, 0.5)");
  require(std::isfinite(material.density) && material.density > 0.0, "density", material.density,
          "finite and > 0 kg/m^3");
  require(std::isfinite(material.damping) && material.damping >= 0.0, "damping", material.damping,
          "finite and >= 0 s");
}

}  // namespace calipso
