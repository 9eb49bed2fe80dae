#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calipso_flow/deformation_modes.hpp"
#include "calipso_flow/stiffness_ratio.hpp"
#include "calipso_flow/vibration.hpp"
#include "calipso_flow/wind_estimate.hpp"

namespace calipso::flow {

// A line of the motion's spectrum as it shows on the surface. World axes.
struct SurfaceLine {
  SpectralLine line;       // amplitudes are the modes'
  double amplitude = 0.0;  // m, root mean square over the surface, at the first frame
  Eigen::Vector3d wave_vector = Eigen::Vector3d::Zero();  // rad/m; zero: a standing vibration
};

// How an object deforms over a clip, and what follows from it.
struct DeformationMotion {
  std::vector<double> times;  // s
  DeformationModes modes;
  std::vector<SurfaceLine> lines;                  // strongest first
  Eigen::Vector3d lean = Eigen::Vector3d::Zero();  // m, world: see leanOf
  std::optional<StiffnessRatio> stiffness;
  std::optional<WindEstimate> wind;  // of a thin sheet, when it was wanted
  std::string note;                  // what was refused, for the user
};

// @param observations  one per frame, the key frame first
// @param with_wind     also simulate a thin sheet in search of the wind: takes far longer than all
// the rest
DeformationMotion describeDeformation(const DeformableTracker& tracker,
                                      const std::vector<DeformationObservation>& observations,
                                      const Eigen::Vector3d& gravity, bool with_wind);

// Horizontal way from what holds an object (or its upper end) to its far end, in its mean shape.
// @param mean_shape  #V x 3, object frame
Eigen::Vector3d leanOf(const ObjectModel& model, const decltype(TriangleMesh::vertices)& mean_shape,
                       const Eigen::Vector3d& gravity);

// True when tracks that a still object would leave in place have moved: of an object that is held
// somewhere this means that it deforms, unless it swings as a whole (movesRigidly).
bool hasLeft(const Observation& observation, const Eigen::Isometry3d& still_pose,
             const Camera& camera, double rest_px);

// True when the poses found so far explain how the tracks of the last one have left their place.
bool movesRigidly(const std::vector<Observation>& observations, const Eigen::Isometry3d& still_pose,
                  const Camera& camera);

// Covariance of the velocity and spin of a deforming object as a whole that comes from what is
// assumed of it where the picture is silent, foremost that it hardly stretches. Such an error is
// shared by neighbouring frames and goes as the motion goes: it does not average out.
Matrix6d assumedTwist(const DeformableTracker& tracker,
                      const std::vector<DeformationObservation>& observations,
                      const DeformationModes& modes, const Eigen::Vector3d& centroid);

// The rigid motion closest to the deformation, as an observation of the object's pose.
Observation rigidPart(const DeformableTracker& tracker, const DeformationObservation& observation,
                      const Eigen::Vector3d& centroid);

}  // namespace calipso::flow
