// Measures the finite element core on the reference beam and prints one JSON object per line:
// steps of several sizes, elements and solvers, error against time beside Bullet's deformable body,
// and the hard cases. Arguments: any of steps, newton, rest, trajectories, hard (default: all).
#include <malloc.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <set>
#include <stdexcept>
#include <string>

#include "beam.hpp"
#include "calipso_scene/help.hpp"
#include "hard_cases.hpp"

namespace calipso::fem {
namespace {

constexpr double kStep = 1.0 / 30.0;

// Memory the process has in use, kB.
double residentKilobytes() {
  long total = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> total >> resident;
  return resident * (sysconf(_SC_PAGESIZE) / 1024.0);
}

void measureBeam(const std::string& kind, int n, FemOptions options, int steps) {
  malloc_trim(0);
  const double before_kb = residentKilobytes(), before_ms = cpuMilliseconds();
  DeformableBody body = makeBeam(n, options);
  const double build_ms = cpuMilliseconds() - before_ms;
  body.step(kStep);  // builds what is kept afterwards
  int iterations = 0, newton = 0;
  StepReport report;
  const double cpu = cpuMilliseconds();
  const auto wall = std::chrono::steady_clock::now();
  for (int k = 0; k < steps; ++k) {
    report = body.step(kStep);
    iterations += report.linear_iterations;
    newton += report.newton_iterations;
  }
  const double wall_ms =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - wall).count();
  std::printf(
      "{\"kind\": \"%s\", \"nodes\": %d, \"element\": \"%s\", \"solver\": \"%s\", \"steps\": %d, "
      "\"cpu_ms_per_step\": %.4g, \"wall_ms_per_step\": %.4g, \"cg_iterations\": %.4g, "
      "\"newton_iterations\": %.4g, \"tip\": %.6g, \"build_cpu_ms\": %.4g, \"kb_per_node\": "
      "%.3g}\n",
      kind.c_str(), body.nodeCount(), toString(options.element).c_str(), report.solver.c_str(),
      steps, (cpuMilliseconds() - cpu) / steps, wall_ms / steps, double(iterations) / steps,
      double(newton) / steps, tipHeight(body), build_ms,
      (residentKilobytes() - before_kb) / body.nodeCount());
  std::fflush(stdout);
}

void measureSteps() {
  FemOptions options;
  options.linearised = true;
  options.linear_tolerance = 1e-5;
  for (const ElementType element :
       {ElementType::kHexEnhanced, ElementType::kHexQ1, ElementType::kTetP1})
    for (const SolverKind solver :
         {SolverKind::kAutomatic, SolverKind::kCholesky, SolverKind::kMultigrid,
          SolverKind::kIncompleteCholesky, SolverKind::kJacobi}) {
      if (element == ElementType::kTetP1 && solver != SolverKind::kAutomatic) continue;
      options.element = element;
      options.solver = solver;
      const bool is_default = solver == SolverKind::kAutomatic;
      for (const int n : {4, 7, 12})
        measureBeam("linearised", n, options, n == 12 && !is_default ? 5 : 40);
    }
}

void measureNewton() {
  FemOptions options;
  options.newton_tolerance = 1e-4;
  for (const int n : {4, 7, 12, 20, 29, 39}) measureBeam("newton", n, options, n > 20 ? 5 : 20);
}

void measureHardCase(const std::string& name, MaterialModel material, int across,
                     double most_seconds) {
  const HardCaseResult r = runHardCase(name, material, across, most_seconds);
  std::printf(
      "{\"kind\": \"hard\", \"case\": \"%s\", \"nodes\": %d, \"material\": \"%s\", \"h\": %.4g, "
      "\"steps\": %d, \"energy_growth\": %.3g, \"displacement\": %.3g, "
      "\"momentum_error\": %.3g, \"recovering_steps\": %d, \"unconverged_steps\": %d, "
      "\"finite\": %s, \"recovered\": %s}\n",
      r.name.c_str(), r.nodes, r.material.c_str(), r.h, r.steps, r.energy_growth, r.displacement,
      r.momentum_error, r.recovering_steps, r.unconverged_steps, r.finite ? "true" : "false",
      r.recovered ? "true" : "false");
  std::fflush(stdout);
}

// The default material to the end; the others, which take up to a hundred times as long, on the
// coarser grid and for some seconds each.
void measureHardCases() {
  constexpr double kSeconds = 2.0;
  for (const std::string& name : hardCaseNames())
    for (const int across : {2, 4})
      if (across == 4 || name.find("unconstrained") == std::string::npos)  // has a grid of its own
        measureHardCase(name, MaterialModel::kStVenantKirchhoff, across, 60.0);
  for (const MaterialModel material : {MaterialModel::kStableNeoHookean, MaterialModel::kCorotated})
    for (const std::string& name : hardCaseNames()) measureHardCase(name, material, 2, kSeconds);
}

}  // namespace
}  // namespace calipso::fem

int main(int argc, char** argv) {
  using namespace calipso::fem;
  const std::string usage =
      "usage: benchmark [steps|newton|rest|trajectories|hard]...   (default: all)\n";
  calipso::helpIfAsked(argc, argv, usage);
  const std::set<std::string> known = {"steps", "newton", "rest", "trajectories", "hard"};
  const std::set<std::string> wanted(argv + 1, argv + argc);
  const auto want = [&wanted](const char* part) { return wanted.empty() || wanted.count(part); };
  try {
    for (const std::string& part : wanted)
      if (known.count(part) == 0) throw std::invalid_argument("no part '" + part + "'\n" + usage);
    if (want("steps")) measureSteps();
    if (want("newton")) measureNewton();
    if (want("rest")) measureRest();
    if (want("trajectories")) measureTrajectories();
    if (want("hard")) measureHardCases();
  } catch (const std::exception& e) {
    std::cerr << "benchmark: " << e.what() << "\n";
    return 1;
  }
  return 0;
}
