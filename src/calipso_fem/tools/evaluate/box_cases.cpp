#include <Eigen/Core>

#include "mesh_probe.hpp"
#include "reference_cases.hpp"

namespace calipso::fem {
namespace {

Eigen::Vector3d readTraction(const CaseFile& file) {
  const YAML::Node t = file.root["traction"];
  if (!t || !t.IsMap()) return Eigen::Vector3d::Zero();
  for (const char* key : {"dead_traction_per_reference_area", "dead_traction"})
    if (t[key]) return readVector3(t[key]);
  throw std::runtime_error(file.path + ": traction: no dead_traction_per_reference_area");
}

void runBox(const CaseFile& file, const std::string& kind, ElementType element,
            const Eigen::Vector3i& cells, const YAML::Node& reference) {
  const Box box = readBox(file);
  DeformableBody body(boxMesh(box.min, box.max, cells), readMaterial(file),
                      exactOptions(readModel(file), element));
  const VolumeMesh& mesh = body.model().mesh();
  body.setCellMaterials(readCellMaterials(file, mesh));
  body.setGravity(readGravity(file));
  body.setNodalForces(planeTraction(mesh, 0, box.max.x(), readTraction(file)));
  for (int node : nodesOnPlane(mesh, 0, box.min.x())) body.fixNode(node);
  const StepReport report = body.solveStatic();

  const Eigen::Vector3d center(box.max.x(), 0.5 * (box.min.y() + box.max.y()),
                               0.5 * (box.min.z() + box.max.z()));
  ResultLine line = lineFor(file, kind, element, readModel(file), mesh.nodeCount());
  addReport(report, &line);
  line.quantity = "tip";
  line.value = displacementAt(mesh, body.positions(), center);
  line.reference = readVector(reference["tip"]);
  print(line);
  line.quantity = "energy";
  line.value = scalar(body.elasticEnergy());
  line.reference = readVector(reference["energy"]);
  print(line);
  if (!reference["tip_corner_ypzp"]) return;
  line.quantity = "tip_corner_ypzp";
  line.value = displacementAt(mesh, body.positions(), box.max);
  line.reference = readVector(reference["tip_corner_ypzp"]);
  print(line);
}

}  // namespace

void evaluateBoxLoads(const CaseFile& file) {
  std::vector<Eigen::Vector3i> grids;
  for (const YAML::Node& r : require(file, file.at("same_discretisation"), "results")) {
    const Eigen::Vector3i cells(r["nx"].as<int>(), r["ny"].as<int>(), r["nz"].as<int>());
    runBox(file, "same_discretisation", referenceElement(r["element"].as<std::string>()), cells, r);
    if (grids.empty() || std::find(grids.begin(), grids.end(), cells) == grids.end())
      grids.push_back(cells);
  }
  for (const Eigen::Vector3i& cells : grids)
    runBox(file, "default", FemOptions().element, cells, file.at("reference"));
}

}  // namespace calipso::fem
