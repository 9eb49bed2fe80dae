#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calipso_flow/object_model.hpp"
#include "calipso_flow/vibration.hpp"

namespace calipso::flow {

// E / rho with which the aligned model vibrates as the object in the video does: frequencies go
// with the square root of it.
struct StiffnessRatio {
  double value = 0.0;      // m^2/s^2
  double deviation = 0.0;  // from the frequency's
  int mode = 0;            // of the model, 0 the lowest
  double agreement = 0.0;  // modal assurance: squared cosine of the observed and the model's shape
};

// @param shape  complex displacement of the line, 3 #V, object frame
// @param note   says why nothing is returned
// @pre model.attached is where the model is held
std::optional<StiffnessRatio> stiffnessRatio(const ObjectModel& model, const SpectralLine& line,
                                             const Eigen::VectorXcd& shape, std::string& note);

}  // namespace calipso::flow
