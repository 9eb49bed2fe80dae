#include "mesh_probe.hpp"
#include "reference_cases.hpp"

namespace calipso::fem {
namespace {

void prescribePlane(DeformableBody* body, int axis, double at, double displacement) {
  for (int node : nodesOnPlane(body->model().mesh(), axis, at))
    body->prescribe(node, axis, [displacement](double) { return displacement; });
}

void runState(const CaseFile& file, const std::string& kind, ElementType element,
              const YAML::Node& state) {
  const Box box = readBox(file);
  Material material = readMaterial(file);
  material.poissons_ratio = state["nu"].as<double>();
  const MaterialModel model = materialModelFromString(state["model"].as<std::string>());
  DeformableBody body(boxMesh(box.min, box.max, {4, 2, 2}), material,
                      exactOptions(model, element));
  const VolumeMesh& mesh = body.model().mesh();
  const Eigen::Vector3d extent = box.max - box.min;
  const double stretch = state["axial_stretch"].as<double>();
  for (int axis = 0; axis < 3; ++axis) prescribePlane(&body, axis, box.min[axis], 0.0);
  prescribePlane(&body, 0, box.max.x(), (stretch - 1.0) * extent.x());
  if (state["mode"].as<std::string>() == "uniaxial_strain")
    for (int axis = 1; axis < 3; ++axis) prescribePlane(&body, axis, box.max[axis], 0.0);
  const StepReport report = body.solveStatic();

  double force = 0.0;
  for (int node : nodesOnPlane(mesh, 0, box.max.x())) force += body.reaction(node).x();
  ResultLine line = lineFor(file, kind, element, model, mesh.nodeCount());
  addReport(report, &line);
  const std::string suffix = "@" + state["mode"].as<std::string>() + ",nu=" +
                             state["nu"].as<std::string>() + ",stretch=" +
                             state["axial_stretch"].as<std::string>();
  const auto show = [&](const std::string& name, double value, const std::string& key) {
    line.quantity = name + suffix;
    line.value = scalar(value);
    line.reference = readVector(state[key]);
    print(line);
  };
  show("axial_force", force, "axial_force");
  const double rest = restEnergyDensity(model, lameParameters(material)) * extent.prod();
  show("energy", body.elasticEnergy() + rest, "energy");
  const double lateral = displacementAt(mesh, body.positions(), box.max).y() / extent.y();
  show("lateral_stretch", 1.0 + lateral, "lateral_stretch");
}

}  // namespace

void evaluateHomogeneous(const CaseFile& file) {
  for (const YAML::Node& state : file.at("cases")) {
    if (!state["axial_force"]) continue;  // the table says that the state does not exist
    runState(file, "same_discretisation", ElementType::kHexQ1, state);
    runState(file, "same_discretisation", ElementType::kTetP1, state);
    runState(file, "default", FemOptions().element, state);
  }
}

}  // namespace calipso::fem
