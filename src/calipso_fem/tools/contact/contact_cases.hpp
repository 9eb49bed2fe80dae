#pragma once

#include <ctime>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "../../test/soft_scene.hpp"
#include "../../test/world_fixtures.hpp"

// Contact cases with known answers, on the simulator's own code.
namespace calipso::fem {

constexpr double kG = 9.81;            // m/s^2
constexpr double kFrame = 1.0 / 30.0;  // s

struct Result {
  std::string quantity;
  double value = 0.0, reference = 0.0;
  double penetration_ratio = 0.0;  // largest depth over the minimal proximity distance
  double energy_growth = 0.0;      // of the total energy, over its scale in the case
  double ms_per_frame = 0.0;       // process CPU time
};

inline double processMs() {
  timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return 1e3 * t.tv_sec + 1e-6 * t.tv_nsec;
}

inline double wallMs() {
  timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return 1e3 * t.tv_sec + 1e-6 * t.tv_nsec;
}

// How deep a vertex of one surface is in another, or below z = 0, m.
double deepestOverlap(const std::vector<TriangleMesh>& surfaces);

inline std::string cubes(int count) { return count == 1 ? "one soft cube" : "two soft cubes"; }

// Plays a world and keeps what every case wants to know.
struct Run {
  double deepest = 0.0, ms = 0.0, slowest_ms = 0.0, wall_ms = 0.0, slowest_wall_ms = 0.0;
  int frames = 0;
  double period = kFrame;

  void play(World& world, double seconds, const std::function<void(const WorldState&)>& look = {});
  double msPerFrame() const { return frames ? ms / frames : 0.0; }
  double wallMsPerFrame() const { return frames ? wall_ms / frames : 0.0; }
};

using Cases = std::map<std::string, std::function<std::vector<Result>()>>;

Cases analyticCases();
Cases momentumCases();
Cases hardCases();
Cases speedCases();
Cases selfCases();    // bodies that meet themselves
Cases bulletCases();  // the same scenes in Bullet's own deformable contact
// A folder as in scenes/FORMAT.md whose truth is known.
std::vector<Result> sceneCase(const std::string& directory);

}  // namespace calipso::fem
