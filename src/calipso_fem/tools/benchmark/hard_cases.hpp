#pragma once

#include <string>
#include <vector>

#include "calipso_fem/deformable_body.hpp"

namespace calipso::fem {

// What a hard start or load did to a body.
struct HardCaseResult {
  std::string name;
  int nodes = 0;
  std::string material;
  double h = 0.0;                 // s
  int steps = 0;
  double energy_growth = 0.0;     // largest growth of the total energy in a step without work,
                                  // relative to the largest energy so far
  double displacement = 0.0;      // at the end: largest distance from where it should be / size
  bool finite = true;             // no NaN at any step
  bool recovered = false;         // displacement below 1e-3
  bool should_recover = true;     // false: under load, only to stay finite
};

// All of them, in a fixed order. `material` in {stvk, snh, corot}.
std::vector<std::string> hardCaseNames();
// @throw std::invalid_argument for an unknown name
HardCaseResult runHardCase(const std::string& name, MaterialModel material);

}  // namespace calipso::fem
