#include "dynamics_case.hpp"

#include <algorithm>
#include <chrono>
#include <ctime>
#include <filesystem>

#include "calipso_flow/clip_dynamics.hpp"
#include "carry_case.hpp"
#include "clip_case.hpp"
#include "deformation_errors.hpp"
#include "json_entry.hpp"
#include "motion_errors.hpp"
#include "throw_case.hpp"
#include "trace.hpp"

namespace calipso::flow {
namespace {

// Wall and processor time, ms.
struct Cost {
  double wall = 0.0, cpu = 0.0;
};

Cost now() {
  const std::chrono::duration<double, std::milli> wall =
      std::chrono::steady_clock::now().time_since_epoch();
  return {wall.count(), 1e3 * std::clock() / CLOCKS_PER_SEC};
}

void add(const Cost& since, int frames, Cost& cost) {
  const Cost end = now();
  cost.wall += (end.wall - since.wall) / frames;
  cost.cpu += (end.cpu - since.cpu) / frames;
}

// Per frame, for all objects together.
struct Costs {
  Cost track, fit, wind;  // fit: without the search for the wind
};

std::string describe(const ClipCase& clip, size_t index, const ObjectDynamics& dynamics,
                     const Costs& costs) {
  const Scene& scene = clip.scene;
  const ObjectModel& model = clip.models[index];
  const TrueObject& truth = clip.truths[index];
  const bool moving = std::any_of(dynamics.motions.begin(), dynamics.motions.end(),
                                  [](const ObjectMotion& m) { return m.moving; });
  JsonEntry entry;
  entry.text("case", std::filesystem::path(scene.directory).filename().string());
  entry.text("object", dynamics.name).number("perturbation", clip.perturbation.number());
  entry.flag("moving", moving);
  addMotionErrors(scene, truth, dynamics, entry);
  addDeformationErrors(model, truth, dynamics, scene.gravity, entry);
  entry.null("endpoint_error_px");
  const bool rigid = !dynamics.deformation && truth.world_from_object.size() > 1;
  if (rigid) addThrow(scene, model, truth, dynamics, entry);
  const bool both_deform = dynamics.deformation && truth.vertices.size() == dynamics.motions.size();
  if (both_deform) addCarriedOn(scene, model, truth, dynamics, entry);
  entry.number("width", scene.camera.width);
  entry.number("track_ms_frame", costs.track.wall).number("fit_ms_frame", costs.fit.wall);
  entry.number("track_cpu_ms_frame", costs.track.cpu).number("fit_cpu_ms_frame", costs.fit.cpu);
  entry.number("wind_ms_frame", costs.wind.wall).number("wind_cpu_ms_frame", costs.wind.cpu);
  entry.number("cpu_ms_frame", costs.track.cpu + costs.fit.cpu + costs.wind.cpu);
  return entry.number("ms_frame", costs.track.wall + costs.fit.wall + costs.wind.wall).str();
}

// Follows all objects through the clip.
std::vector<ObjectDynamics> analyse(const ClipCase& clip, Costs& costs) {
  const Scene& scene = clip.scene;
  DynamicsParams params;
  params.supports = scene.onlySupports();
  ClipAnalyser analyser(makeFrame(0.0, clip.frame(0), scene.cameraAt(0)), clip.models, clip.masks,
                        scene.gravity, params);
  for (int k = 1; k < scene.frame_count; ++k) {
    const cv::Mat picture = clip.frame(k);
    const Cost start = now();
    analyser.add(makeFrame(k / scene.fps, picture, scene.cameraAt(k)));
    add(start, scene.frame_count, costs.track);
  }
  const Cost start = now();
  std::vector<ObjectDynamics> dynamics = analyser.finish(false);
  add(start, scene.frame_count, costs.fit);
  const bool deforms = std::any_of(dynamics.begin(), dynamics.end(), [](const ObjectDynamics& d) {
    return d.deformation.has_value();
  });
  if (!deforms) return dynamics;
  // What the wind costs is what all of it costs more.
  const Cost again = now();
  dynamics = analyser.finish(true);
  add(again, scene.frame_count, costs.wind);
  costs.wind.wall -= costs.fit.wall, costs.wind.cpu -= costs.fit.cpu;
  return dynamics;
}

}  // namespace

std::vector<std::string> evaluateScene(const std::string& directory,
                                       const DynamicsOptions& options) {
  std::vector<std::string> entries;
  for (int n = 0; n <= options.perturbations; ++n) {
    const ClipCase clip = loadClipCase(directory, options.models, options.scale, Perturbation(n));
    Costs costs;
    const std::vector<ObjectDynamics> dynamics = analyse(clip, costs);
    for (size_t i = 0; i < dynamics.size(); ++i) {
      entries.push_back(describe(clip, i, dynamics[i], costs));
      if (!options.trace.empty())
        writeTrace(options.trace, clip.scene, clip.models[i], clip.truths[i], dynamics[i], n);
    }
  }
  return entries;
}

}  // namespace calipso::flow
