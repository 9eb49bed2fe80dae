#pragma once

#include <functional>
#include <vector>

#include "calipso_flow/motion_filter.hpp"

namespace calipso::flow {

// Sets the kind and the noise densities of pieces[index] to those under which the measurements are
// likeliest; the other pieces stay as they are.
void chooseKind(const std::vector<PoseMeasurement>& measurements, size_t index,
                const MotionPrior& prior, double noise_scale, std::vector<MotionPiece>& pieces);

// The likeliest factor on the measurements' deviations.
double chooseNoiseScale(const std::vector<PoseMeasurement>& measurements,
                        const std::vector<MotionPiece>& pieces, const MotionPrior& prior,
                        double start);

// The factor by what a constant acceleration leaves of four successive positions, at the lower
// quartile: that of frames between which nothing happens. Not below 1, and 1 when there are too few
// to tell.
double noiseScaleBetweenJumps(const std::vector<PoseMeasurement>& measurements);

struct Maximum {
  double at, value;
};

// Largest value of `score` in [low, high]: a grid of a tenth of `step`, then golden section.
Maximum maximise(const std::function<double(double)>& score, double low, double high, double step);

}  // namespace calipso::flow
