// Measures the finite element core on the reference beam and prints one JSON object per line:
// steps of several sizes, elements and solvers, and the hard cases. Arguments: any of steps, newton,
// hard (default: all).
#include <ctime>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <set>

#include "calipso_fem/deformable_body.hpp"
#include "hard_cases.hpp"

namespace calipso::fem {
namespace {

constexpr double kStep = 1.0 / 30.0;

double cpuMilliseconds() { return 1000.0 * std::clock() / CLOCKS_PER_SEC; }

// Beam [0, 1] x [0, 0.25]^2 m of 4n x n x n cells, clamped at x = 0, under gravity.
DeformableBody makeBeam(int n, const FemOptions& options) {
  DeformableBody body(boxMesh({0, 0, 0}, {1.0, 0.25, 0.25}, {4 * n, n, n}),
                      Material{1e6, 0.3, 1000.0, 0.0}, options);
  for (int i = 0; i < body.nodeCount(); ++i)
    if (body.model().mesh().nodes(i, 0) == 0.0) body.fixNode(i);
  body.setGravity({0.0, -9.81, 0.0});
  return body;
}

double tipHeight(const DeformableBody& body) {
  double sum = 0.0;
  int count = 0;
  const VolumeMesh& mesh = body.model().mesh();
  for (int i = 0; i < mesh.nodeCount(); ++i)
    if (mesh.nodes(i, 0) > 1.0 - 1e-9) {
      sum += body.positions()[3 * i + 1] - mesh.nodes(i, 1);
      ++count;
    }
  return sum / count;
}

void measureBeam(const std::string& kind, int n, FemOptions options, int steps) {
  DeformableBody body = makeBeam(n, options);
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
      "\"newton_iterations\": %.4g, \"tip\": %.6g}\n",
      kind.c_str(), body.nodeCount(), toString(options.element).c_str(), report.solver.c_str(),
      steps, (cpuMilliseconds() - cpu) / steps, wall_ms / steps, double(iterations) / steps,
      double(newton) / steps, tipHeight(body));
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
      for (const int n : {4, 7, 12}) measureBeam("linearised", n, options, n == 12 ? 10 : 40);
    }
}

void measureNewton() {
  FemOptions options;
  options.newton_tolerance = 1e-4;
  options.linear_tolerance = 1e-3;
  for (const int n : {4, 7, 12, 20, 29, 39}) measureBeam("newton", n, options, n > 12 ? 3 : 15);
}

void measureHardCases() {
  for (const MaterialModel material : {MaterialModel::kStVenantKirchhoff})
    for (const std::string& name : hardCaseNames()) {
      const HardCaseResult r = runHardCase(name, material);
      std::printf(
          "{\"kind\": \"hard\", \"case\": \"%s\", \"nodes\": %d, \"material\": \"%s\", \"h\": %.4g, "
          "\"steps\": %d, \"energy_growth\": %.3g, \"displacement\": %.3g, \"finite\": %s, "
          "\"recovered\": %s, \"should_recover\": %s}\n",
          r.name.c_str(), r.nodes, r.material.c_str(), r.h, r.steps, r.energy_growth,
          r.displacement, r.finite ? "true" : "false", r.recovered ? "true" : "false",
          r.should_recover ? "true" : "false");
      std::fflush(stdout);
    }
}

}  // namespace
}  // namespace calipso::fem

int main(int argc, char** argv) {
  using namespace calipso::fem;
  const std::set<std::string> wanted(argv + 1, argv + argc);
  const auto want = [&wanted](const char* part) { return wanted.empty() || wanted.count(part); };
  try {
    if (want("steps")) measureSteps();
    if (want("newton")) measureNewton();
    if (want("hard")) measureHardCases();
  } catch (const std::exception& e) {
    std::cerr << "benchmark: " << e.what() << "\n";
    return 1;
  }
  return 0;
}
