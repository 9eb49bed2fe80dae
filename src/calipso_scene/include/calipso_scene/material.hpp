#pragma once

namespace calipso {

// An isotropic elastic material.
struct Material {
  double youngs_modulus = 1e6;  // E, Pa, > 0
  double poissons_ratio = 0.4;  // nu, in (-1, 0.5)
  double density = 1000.0;      // rho, kg/m^3, > 0
  double damping = 0.01;        // Rayleigh stiffness damping, s, >= 0
};

// Starting values for an object of bounding diagonal `diagonal` (m): a body of that size that sags
// by about a thousandth of it under its own weight, so that it looks firm but can be deformed.
Material defaultMaterial(double diagonal, double gravity);

// @throw std::invalid_argument naming parameter, value and range
void validate(const Material& material);

}  // namespace calipso
