#include <algorithm>

#include "mesh_probe.hpp"
#include "reference_cases.hpp"

namespace calipso::fem {
namespace {

// Cook's membrane: x = 48 xi, y = 44 xi + eta (44 - 28 xi), z in [0, 1].
VolumeMesh cookMesh(const Eigen::Vector3i& cells) {
  VolumeMesh mesh = boxMesh(Eigen::Vector3d::Zero(), Eigen::Vector3d::Ones(), cells);
  for (int i = 0; i < mesh.nodeCount(); ++i) {
    const double xi = mesh.nodes(i, 0), eta = mesh.nodes(i, 1);
    mesh.nodes(i, 0) = 48.0 * xi;
    mesh.nodes(i, 1) = 44.0 * xi + eta * (44.0 - 28.0 * xi);
  }
  return mesh;
}

void runCook(const CaseFile& file, const std::string& kind, ElementType element,
             const Eigen::Vector3i& cells, const YAML::Node& reference) {
  DeformableBody body(cookMesh(cells), readMaterial(file), exactOptions(readModel(file), element));
  const VolumeMesh& mesh = body.model().mesh();
  body.setNodalForces(planeTraction(
      mesh, 0, 48.0, readVector3(require(file, file.at("traction"), "dead_traction"))));
  const bool plane_strain = file.at("bc").as<std::string>().find("z=1 (plane strain)") != std::string::npos;
  const auto zero = [](double) { return 0.0; };
  for (int node : nodesOnPlane(mesh, 2, 0.0)) body.prescribe(node, 2, zero);
  if (plane_strain)
    for (int node : nodesOnPlane(mesh, 2, 1.0)) body.prescribe(node, 2, zero);
  for (int node : nodesOnPlane(mesh, 0, 0.0)) body.fixNode(node);
  const StepReport report = body.solveStatic();

  ResultLine line = lineFor(file, kind, element, readModel(file), mesh.nodeCount());
  addReport(report, &line);
  const auto show = [&](const std::string& name, const Eigen::VectorXd& value,
                        const YAML::Node& expected) {
    if (!expected) return;
    line.quantity = name;
    line.value = value;
    line.reference = readVector(expected);
    print(line);
  };
  const auto at = [&](double y) {
    return displacementAt(mesh, body.positions(), {48.0, y, 0.0});
  };
  const bool converged = static_cast<bool>(reference["u_top_right_48_60_0"]);
  show("u_top_right", at(60.0), reference[converged ? "u_top_right_48_60_0" : "u_top_right"]);
  show("u_mid_right", at(52.0), reference[converged ? "u_mid_right_48_52_0" : "u_mid_right"]);
  show("energy", scalar(body.elasticEnergy()), reference["energy"]);
}

}  // namespace

void evaluateCook(const CaseFile& file) {
  std::vector<Eigen::Vector3i> grids;
  for (const YAML::Node& r : require(file, file.at("same_discretisation"), "results")) {
    const Eigen::Vector3i cells(r["nx"].as<int>(), r["ny"].as<int>(), r["nz"].as<int>());
    runCook(file, "same_discretisation", referenceElement(r["element"].as<std::string>()), cells, r);
    if (std::find(grids.begin(), grids.end(), cells) == grids.end()) grids.push_back(cells);
  }
  for (const Eigen::Vector3i& cells : grids)
    runCook(file, "default", FemOptions().element, cells, file.at("reference"));
}

}  // namespace calipso::fem
