#include <chrono>
#include <cmath>
#include <cstdio>

#include "beam.hpp"
#include "bullet_beam.hpp"

namespace calipso::fem {
namespace {

constexpr double kStep = 1.0 / 30.0;

struct Run {
  int nodes = 0;
  double tip = 0.0, cpu_ms = 0.0, wall_ms = 0.0;
};

// `steps` steps of h from rest.
Run runBeam(int n, const FemOptions& options, double h, int steps) {
  DeformableBody body = makeBeam(n, options);
  const double cpu = cpuMilliseconds();
  const auto wall = std::chrono::steady_clock::now();
  for (int k = 0; k < steps; ++k) body.step(h);
  const std::chrono::duration<double, std::milli> passed = std::chrono::steady_clock::now() - wall;
  return {body.nodeCount(), tipHeight(body), cpuMilliseconds() - cpu, passed.count()};
}

double equilibriumTip(MaterialModel material) {
  FemOptions options;
  options.material_model = material;
  options.newton_tolerance = 1e-8;
  options.linear_tolerance = 1e-6;
  options.static_load_steps = 4;
  DeformableBody body = makeBeam(16, options);
  body.solveStatic();
  return tipHeight(body);
}

void printRest(const std::string& engine, const Run& r, int steps, double reference) {
  std::printf(
      "{\"kind\": \"rest\", \"engine\": \"%s\", \"nodes\": %d, \"cpu_ms_per_step\": %.4g, "
      "\"wall_ms_per_step\": %.4g, \"tip\": %.6g, \"rel_error\": %.4g}\n",
      engine.c_str(), r.nodes, r.cpu_ms / steps, r.wall_ms / steps, r.tip,
      std::abs(r.tip / reference - 1.0));
  std::fflush(stdout);
}

void printTrajectory(const std::string& what, const FemOptions& o, double h, const Run& r,
                     double seconds, double reference) {
  std::printf(
      "{\"kind\": \"trajectory\", \"varied\": \"%s\", \"nodes\": %d, \"element\": \"%s\", "
      "\"material\": \"%s\", \"solver\": \"%s\", \"scheme\": \"%s\", \"linearised\": %s, "
      "\"linear_tolerance\": %.1g, \"h\": %.4g, \"cpu_ms_per_second\": %.4g, "
      "\"wall_ms_per_second\": %.4g, \"rel_error\": %.4g}\n",
      what.c_str(), r.nodes, toString(o.element).c_str(), toString(o.material_model).c_str(),
      toString(o.solver).c_str(), toString(o.scheme).c_str(), o.linearised ? "true" : "false",
      o.linear_tolerance, h, r.cpu_ms / seconds, r.wall_ms / seconds,
      std::abs(r.tip / reference - 1.0));
  std::fflush(stdout);
}

constexpr double kSeconds = 0.5;

void trajectory(const std::string& what, int n, const FemOptions& options, int steps_per_second,
                double reference) {
  const int steps = static_cast<int>(kSeconds * steps_per_second);
  const double h = 1.0 / steps_per_second;
  printTrajectory(what, options, h, runBeam(n, options, h, steps), kSeconds, reference);
}

// The least dissipative scheme with small steps on a finer grid.
double trajectoryReference(MaterialModel material, int n, int steps_per_second) {
  FemOptions options;
  options.material_model = material;
  options.scheme = TimeScheme::kBdf2;
  options.newton_tolerance = 1e-6;
  return runBeam(n, options, 1.0 / steps_per_second, static_cast<int>(kSeconds * steps_per_second))
      .tip;
}

}  // namespace

void measureRest() {
  constexpr int kSteps = 480;  // the swinging has died down to a thousandth
  const double reference = equilibriumTip(MaterialModel::kStVenantKirchhoff);
  FemOptions options;
  options.linearised = true;
  for (const ElementType element :
       {ElementType::kHexEnhanced, ElementType::kHexQ1, ElementType::kTetP1})
    for (const int n : {1, 2, 3, 4, 7}) {
      options.element = element;
      printRest("calipso " + toString(element), runBeam(n, options, kStep, kSteps), kSteps,
                reference);
    }
  for (const int n : {1, 2, 3, 4, 5}) {
    const auto wall = std::chrono::steady_clock::now();
    const BulletResult b = runBulletBeam(n, kStep, kSteps);
    const std::chrono::duration<double, std::milli> passed =
        std::chrono::steady_clock::now() - wall;
    printRest("bullet", {b.nodes, b.tip, b.cpu_ms_per_step * kSteps, passed.count()}, kSteps,
              reference);
  }
}

void measureTrajectories() {
  const double reference = trajectoryReference(MaterialModel::kStVenantKirchhoff, 7, 480);
  const FemOptions standard;
  for (const int n : {1, 2, 3, 4, 7}) trajectory("resolution", n, standard, 60, reference);
  for (const TimeScheme scheme :
       {TimeScheme::kBackwardEuler, TimeScheme::kTrapezoidal, TimeScheme::kBdf2})
    for (const int rate : {30, 60, 120, 240}) {
      FemOptions options;
      options.scheme = scheme;
      trajectory("time step", 3, options, rate, reference);
    }
  for (const ElementType element : {ElementType::kHexEnhanced, ElementType::kHexQ1,
                                    ElementType::kHexMeanDilatation, ElementType::kTetP1})
    for (const int n : {2, 3, 4}) {
      FemOptions options;
      options.element = element;
      trajectory("element", n, options, 60, reference);
    }
  for (const SolverKind solver :
       {SolverKind::kAutomatic, SolverKind::kCholesky, SolverKind::kJacobi,
        SolverKind::kIncompleteCholesky, SolverKind::kStaleCholesky, SolverKind::kMultigrid}) {
    FemOptions options;
    options.solver = solver;
    trajectory("solver", 4, options, 60, reference);
  }
  for (const double tolerance : {1e-1, 1e-2, 1e-3, 1e-5, 1e-8})
    for (const bool linearised : {true, false}) {
      FemOptions options;
      options.linear_tolerance = tolerance;
      options.newton_tolerance = std::min(1e-2, 10.0 * tolerance);
      options.linearised = linearised;
      trajectory("tolerance", 4, options, 60, reference);
    }
  for (const MaterialModel material :
       {MaterialModel::kStVenantKirchhoff, MaterialModel::kStableNeoHookean,
        MaterialModel::kCorotated}) {
    const double own = trajectoryReference(material, 4, 120);
    FemOptions options;
    options.material_model = material;
    for (const int n : {1, 2, 3}) trajectory("material", n, options, 60, own);
  }
}

}  // namespace calipso::fem
