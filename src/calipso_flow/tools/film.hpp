#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_flow/clip_dynamics.hpp"
#include "calipso_flow/object_model.hpp"
#include "calipso_scene/camera.hpp"

// Pictures of bodies whose motion is known because we simulated it.
namespace calipso::flow {

using Shapes = std::vector<decltype(TriangleMesh::vertices)>;  // world, m; one per frame

// A box from `low` to `high`, its sides divided into `cells`; faces outwards.
TriangleMesh dividedBox(const Eigen::Vector3d& low, const Eigen::Vector3d& high,
                        const Eigen::Vector3i& cells);

// Looks from `eye` at `target`, z up.
Camera lookingAt(const Eigen::Vector3d& eye, const Eigen::Vector3d& target, int width, int height,
                 double focal_px);

// An 8-bit picture of a surface that carries a smooth texture from its rest shape, before a
// textured wall, with Gaussian noise. @param moved  #V x 3, world
cv::Mat film(const ObjectModel& model, const decltype(TriangleMesh::vertices)& moved,
             const Camera& camera, double noise_grey, uint64_t seed);

// What the analysis of its film, with noise of so many grey levels, says of a surface's motion.
ObjectDynamics analyseFilm(const ObjectModel& model, const Camera& camera, const Shapes& shapes,
                           const std::vector<double>& times, const Eigen::Vector3d& gravity,
                           double noise_grey = 2.0);

struct FilmedSheet {
  ObjectModel model;
  Camera camera;
  Eigen::Vector3d gravity;
  std::vector<double> times;  // s
  Shapes shapes;
  Eigen::Vector3d wind;  // m/s, mean over the clip
};

struct SheetTruth {
  int nodes = 500;                   // of the simulation's grid
  double step = 1.0 / 120.0;         // s
  double stiffness = 1.0;            // times the modulus that the simulator starts with
  bool pegged = false;               // held at its upper corners only
  double width = 0.7, height = 0.8;  // m
  double gust = 0.0;  // share of the wind by which it swells and fades, once in 1.5 s
};

// A sheet that hangs at rest by its upper edge, simulated in a wind that sets in with the first
// frame.
FilmedSheet filmedSheet(const Eigen::Vector3d& wind, int frames, const SheetTruth& settings = {});

struct FilmedBeam {
  ObjectModel model;
  Camera camera;
  std::vector<double> times;
  Shapes shapes;
  double frequency;         // Hz, lowest
  double second_frequency;  // Hz, of bending with one node
  double stiffness_ratio;   // m^2/s^2
};

struct BeamTruth {
  double stiffness_ratio = 15e3;  // m^2/s^2
  double damping = 0.0;           // s: viscosity over stiffness
  double second = 0.0;            // of the speed at the tip: share in the shape with one node
};

// A beam that is held at one end, struck at the first frame, without weight.
FilmedBeam filmedBeam(const BeamTruth& truth, int frames);

}  // namespace calipso::flow
