#include <gtest/gtest.h>

#include <cmath>

#include "../tools/film.hpp"
#include "calipso_flow/clip_dynamics.hpp"

// Bodies whose motion is known because it was simulated, estimated from pictures of them.
namespace calipso::flow {
namespace {

TEST(Filmed, windAcrossASheetIsFound) {
  const Eigen::Vector3d wind(0.0, 4.0, 0.0);
  const FilmedSheet sheet = filmedSheet(wind, 24);
  const ObjectDynamics found =
      analyseFilm(sheet.model, sheet.camera, sheet.shapes, sheet.times, sheet.gravity);
  ASSERT_TRUE(found.deformation);
  ASSERT_TRUE(found.deformation->wind) << found.deformation->note;
  const WindEstimate& w = *found.deformation->wind;
  // What is asked for: 10 degrees, 15 %.
  EXPECT_GT(w.mean.normalized().dot(wind.normalized()), std::cos(10.0 * M_PI / 180.0));
  EXPECT_NEAR(w.mean.norm(), wind.norm(), 0.15 * wind.norm());
  EXPECT_GT(w.explained, 0.9);
  // Along the sheet nothing is seen: the deviation is that of what is known beforehand.
  EXPECT_GT(std::sqrt(w.mean_covariance(0, 0)), 2.0 * std::sqrt(w.mean_covariance(1, 1)));
}

TEST(Filmed, beamVibratesAtItsFrequency) {
  const FilmedBeam beam = filmedBeam(15e3, 40);
  const ObjectDynamics found = analyseFilm(beam.model, beam.camera, beam.shapes, beam.times,
                                           Eigen::Vector3d(0.0, 0.0, -9.81));
  ASSERT_TRUE(found.deformation);
  ASSERT_FALSE(found.deformation->lines.empty());
  // 1 % over two seconds; here over 1.3.
  EXPECT_NEAR(found.deformation->lines.front().line.naturalFrequency(), beam.frequency,
              0.02 * beam.frequency);
}

}  // namespace
}  // namespace calipso::flow
