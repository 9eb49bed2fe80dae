#include <Eigen/Core>

#include "mesh_probe.hpp"
#include "reference_cases.hpp"

namespace calipso::fem {
namespace {

Eigen::Vector3d readTraction(const CaseFile& file) {
  const YAML::Node t = file.root["traction"];
  if (!t || t.IsNull()) return Eigen::Vector3d::Zero();
  if (!t.IsMap()) throw std::runtime_error(file.path + ": traction: expected an object or null");
  for (const char* key : {"dead_traction_per_reference_area", "dead_traction"})
    if (t[key]) return readVector3(t[key]);
  throw std::runtime_error(file.path + ": traction: no dead_traction_per_reference_area");
}

// The last part of a quantity's name tells of the grid: equal cells, or "@graded" towards the
// clamped end.
void runBox(const CaseFile& file, const std::string& kind, ElementType element,
            const Eigen::Vector3i& cells, const YAML::Node& reference, bool graded = false) {
  const Box box = readBox(file);
  VolumeMesh grid = boxMesh(box.min, box.max, cells);
  if (graded) gradeBox(0, GradedEnds::kLow, &grid);
  DeformableBody body(std::move(grid), readMaterial(file), exactOptions(readModel(file), element));
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
  const auto show = [&](const char* name, const auto& value) {
    if (reference[name])
      printQuantity(line, name + std::string(graded ? "@graded" : ""), value, reference[name]);
  };
  show("tip", displacementAt(mesh, body.positions(), center));
  show("energy", scalar(body.elasticEnergy()));
  show("tip_corner_ypzp", displacementAt(mesh, body.positions(), box.max));
}

}  // namespace

void evaluateBoxLoads(const CaseFile& file) {
  for (const YAML::Node& r : sameDiscretisation(file))
    attempt(file.path, [&] {
      runBox(file, "same_discretisation", referenceElement(readText(file, r, "element")),
             readCells(file, r), r);
    });
  if (!converged(file).IsMap()) return;
  // Parts of different stiffness meet at cell faces of the equal grid; a graded one would move
  // them.
  const bool uniform = readText(file, file.root, "family") == "H";
  for (const Eigen::Vector3i& cells : gridsOf(file))
    for (const bool graded : {false, true})
      if (!graded || !uniform)
        attempt(file.path, [&] {
          runBox(file, "default", FemOptions().element, cells, converged(file), graded);
        });
}

}  // namespace calipso::fem
