#pragma once

#include <Eigen/Core>
#include <calipso_scene/triangle_mesh.hpp>
#include <vector>

namespace calipso::flow {

// One damped oscillation shared by several series:
//   y(t) = Re( amplitude exp((i omega - decay) (t - t_0)) ),  omega = 2 pi frequency.
struct SpectralLine {
  double frequency = 0.0;           // Hz
  double deviation = 0.0;           // Hz, standard
  double decay = 0.0;               // 1/s; negative: it grows
  double quality = 0.0;             // its power over the power left, per degree of freedom
  Eigen::VectorXcd amplitude;       // per series, at t_0
  double naturalFrequency() const;  // without the damping, Hz
};

struct Spectrum {
  std::vector<SpectralLine> lines;  // strongest first; empty: nothing oscillates
  Eigen::VectorXd mean;             // per series: what is left when the oscillations are taken away
  double residual = 0.0;            // root mean square that no line explains
};

struct SpectrumParams {
  double least_periods = 1.0;  // of a line within the clip
  double least_quality = 8.0;
  int most_lines = 4;
  double noise = 0.0;  // standard deviation that errors explain; no line is sought below
};

// Lines of several series taken at the same times, which need not be evenly spaced: the periodogram
// names candidates, one after another, and nonlinear least squares over all lines together refines
// them (variable projection), so that a clip of little more than a period is enough and
// neighbouring lines do not bend each other.
// @param series  #times x #series
// @throw std::invalid_argument when sizes differ or times do not increase
Spectrum findLines(const Eigen::VectorXd& times, const Eigen::MatrixXd& series,
                   const SpectrumParams& params = {});

// Where the crests of an oscillating surface go.
struct CrestTravel {
  Eigen::Vector3d wave_vector = Eigen::Vector3d::Zero();  // rad/m, in the mesh's frame
  double travelling = 0.0;                                // 0: standing, 1: purely travelling
};

// Phase gradient of the complex displacement `shape` (3 #V) over the surface, weighted by power.
CrestTravel crestTravel(const TriangleMesh& mesh, const Eigen::VectorXcd& shape);

}  // namespace calipso::flow
