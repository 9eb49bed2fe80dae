#include <chrono>

#include "calipso_fem/modal_analysis.hpp"
#include "mesh_probe.hpp"
#include "reference_cases.hpp"

namespace calipso::fem {
namespace {

void runModes(const CaseFile& file, const std::string& kind, ElementType element, bool lumped,
              const Eigen::Vector3i& cells, const Eigen::VectorXd& reference) {
  const Box box = readBox(file);
  VolumeMesh mesh = boxMesh(box.min, box.max, cells);
  if (element == ElementType::kTetP1) mesh = kuhnSplit(mesh);
  const ElasticModel model(mesh, readMaterial(file), MaterialModel::kLinear, element);
  std::vector<int> fixed;
  for (int node : nodesOnPlane(mesh, 0, box.min.x()))
    for (int axis = 0; axis < 3; ++axis) fixed.push_back(3 * node + axis);
  const auto start = std::chrono::steady_clock::now();
  const ModalResult modes =
      naturalFrequencies(model, fixed, static_cast<int>(reference.size()), lumped);
  ResultLine line = lineFor(file, kind, element, MaterialModel::kLinear, mesh.nodeCount());
  line.solver = "subspace_iteration";
  line.quantity = lumped ? "frequencies_hz:lumped" : "frequencies_hz:consistent";
  line.value = modes.frequencies;
  line.reference = reference;
  line.newton_iterations = modes.iterations;
  line.error = (modes.frequencies - reference).cwiseQuotient(reference).cwiseAbs().maxCoeff();
  line.ms_per_step =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  print(line);
}

}  // namespace

void evaluateModes(const CaseFile& file) {
  const YAML::Node finest = converged(file)["frequencies_hz"];
  for (const YAML::Node& r : sameDiscretisation(file))
    attempt(file.path, [&] {
      const Eigen::Vector3i cells = readCells(file, r);
      const ElementType element = referenceElement(readText(file, r, "element"));
      const bool lumped = readText(file, r, "mass") == "lumped";
      runModes(file, "same_discretisation", element, lumped, cells,
               readVector(require(file, r, "frequencies_hz")));
    });
  if (!finest) return;
  for (const Eigen::Vector3i& cells : gridsOf(file))
    for (const bool lumped : {false, true})
      attempt(file.path, [&] {
        runModes(file, "default", FemOptions().element, lumped, cells, readVector(finest));
      });
}

}  // namespace calipso::fem
