#include "mesh_probe.hpp"
#include "reference_cases.hpp"

namespace calipso::fem {
namespace {

void prescribePlane(DeformableBody* body, int axis, double at, double displacement) {
  for (int node : nodesOnPlane(body->model().mesh(), axis, at))
    body->prescribe(node, axis, [displacement](double) { return displacement; });
}

// Affine displacement u = (F - I) X of all boundary nodes; the inside has to follow.
void prescribeBoundary(DeformableBody* body, const Box& box, const Eigen::Matrix3d& F) {
  const VolumeMesh& mesh = body->model().mesh();
  const double tolerance = 1e-9 * (box.max - box.min).norm();
  for (int i = 0; i < mesh.nodeCount(); ++i) {
    const Eigen::Vector3d X = mesh.node(i), u = F * X - X;
    if ((X - box.min).minCoeff() > tolerance && (box.max - X).minCoeff() > tolerance) continue;
    for (int axis = 0; axis < 3; ++axis)
      body->prescribe(i, axis, [value = u[axis]](double) { return value; });
  }
}

// The supports of the table's two modes; any other mode is given by its F.
void support(const CaseFile& file, const YAML::Node& state, const Box& box, DeformableBody* body) {
  const std::string mode = readText(file, state, "mode");
  if (mode != "uniaxial_stress" && mode != "uniaxial_strain")
    return prescribeBoundary(body, box, readMatrix(require(file, state, "F")));
  const double stretch = readNumber(file, state, "axial_stretch");
  for (int axis = 0; axis < 3; ++axis) prescribePlane(body, axis, box.min[axis], 0.0);
  prescribePlane(body, 0, box.max.x(), (stretch - 1.0) * (box.max - box.min).x());
  if (mode == "uniaxial_strain")
    for (int axis = 1; axis < 3; ++axis) prescribePlane(body, axis, box.max[axis], 0.0);
}

double faceForce(const DeformableBody& body, int axis, double at) {
  double force = 0.0;
  for (int node : nodesOnPlane(body.model().mesh(), axis, at)) force += body.reaction(node)[axis];
  return force;
}

void runState(const CaseFile& file, const std::string& kind, ElementType element,
              const YAML::Node& state) {
  const Box box = readBox(file);
  Material material = readMaterial(file);
  material.poissons_ratio = readNumber(file, state, "nu");
  const MaterialModel model = materialModelFromString(readText(file, state, "model"));
  DeformableBody body(boxMesh(box.min, box.max, {4, 2, 2}), material, exactOptions(model, element));
  support(file, state, box, &body);
  const StepReport report = body.solveStatic();

  const Eigen::Vector3d extent = box.max - box.min;
  const VolumeMesh& mesh = body.model().mesh();
  ResultLine line = lineFor(file, kind, element, model, mesh.nodeCount());
  addReport(report, &line);
  std::string suffix = "@" + readText(file, state, "mode") + ",nu=" + readText(file, state, "nu");
  if (state["axial_stretch"]) suffix += ",stretch=" + readText(file, state, "axial_stretch");
  const auto show = [&](const char* name, double value) {
    if (state[name]) printQuantity(line, name + suffix, scalar(value), state[name]);
  };
  const double force = faceForce(body, 0, box.max.x()), volume = extent.prod();
  const double energy =
      body.elasticEnergy() + restEnergyDensity(model, lameParameters(material)) * volume;
  const Eigen::Vector3d u = displacementAt(mesh, body.positions(), box.max) -
                            displacementAt(mesh, body.positions(), box.min);
  show("axial_force", force);
  show("axial_nominal_stress", force * extent.x() / volume);
  show("energy", energy);
  show("energy_density", energy / volume);
  show("lateral_stretch", 1.0 + u.y() / extent.y());
  // Zero in uniaxial stress, where no reaction exists to be compared.
  if (readText(file, state, "mode") == "uniaxial_strain")
    show("lateral_nominal_stress", faceForce(body, 1, box.max.y()) * extent.y() / volume);
}

}  // namespace

void evaluateHomogeneous(const CaseFile& file) {
  for (const YAML::Node& state : file.at("cases")) {
    if (!state["axial_force"] && !state["energy"]) continue;  // the state does not exist
    for (const ElementType element :
         {ElementType::kHexQ1, ElementType::kTetP1, FemOptions().element})
      attempt(file.path, [&] {
        runState(file, element == FemOptions().element ? "default" : "same_discretisation", element,
                 state);
      });
  }
}

}  // namespace calipso::fem
