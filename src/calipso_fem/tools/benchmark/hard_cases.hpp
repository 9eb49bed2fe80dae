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
  double h = 0.0;  // s
  int steps = 0;
  // largest growth of the total energy (with that of dead loads) within a step, relative to the
  // largest energy so far
  double energy_growth = 0.0;
  // at the end: largest distance from rest / size; of a free body: distance of its centre from
  // where it should be / its way
  double displacement = 0.0;
  double momentum_error = 0.0;  // free bodies: change of linear or angular momentum, relative
  int recovering_steps = 0;     // steps in which the material was stiffened against inversion
  int unconverged_steps = 0;
  bool finite = true;      // no NaN at any step
  bool recovered = false;  // displacement below 1e-3 and momentum kept
};

// All of them, in a fixed order. `material` in {stvk, snh, corot}.
std::vector<std::string> hardCaseNames();
// On a beam of 4 across x across x across cells; ends after so much CPU time at the latest.
// @throw std::invalid_argument for an unknown name
HardCaseResult runHardCase(const std::string& name, MaterialModel material, int across,
                           double most_cpu_seconds = 1e9);

}  // namespace calipso::fem
