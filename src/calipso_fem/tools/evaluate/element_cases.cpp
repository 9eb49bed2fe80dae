#include <cmath>

#include "reference_cases.hpp"

namespace calipso::fem {
namespace {

// Corners of VTK_HEXAHEDRON in the order of VolumeMesh.
constexpr int kVtkCorner[8] = {0, 1, 3, 2, 4, 5, 7, 6};

VolumeMesh oneCell(const Eigen::MatrixXd& nodes) {
  VolumeMesh mesh;
  mesh.nodes = nodes;
  mesh.cells.resize(1, nodes.rows());
  for (int c = 0; c < nodes.rows(); ++c) mesh.cells(0, c) = nodes.rows() == 8 ? kVtkCorner[c] : c;
  mesh.fraction = Eigen::VectorXd::Ones(1);
  return mesh;
}

Eigen::VectorXd flatten(const Eigen::MatrixXd& m) {
  return Eigen::Map<const Eigen::VectorXd>(m.data(), m.size());
}

struct ElementCase {
  const CaseFile& file;
  VolumeMesh mesh;
  Vec x;
  Material material;
  ElementType element;
};

void show(const ElementCase& c, const std::string& model, const std::string& quantity,
          const Eigen::MatrixXd& value, const YAML::Node& expected) {
  if (!expected) return;
  const Eigen::MatrixXd reference =
      value.cols() == 1 ? Eigen::MatrixXd(readVector(expected)) : readMatrix(expected);
  if (reference.rows() != value.rows() || reference.cols() != value.cols())
    throw std::runtime_error(c.file.path + ": " + model + ": " + quantity + ": expected " +
                             std::to_string(value.rows()) + " x " + std::to_string(value.cols()) +
                             " numbers");
  ResultLine line =
      lineFor(c.file, "same_discretisation", c.element, MaterialModel::kLinear, c.mesh.nodeCount());
  line.material = model;
  line.solver = "none";
  line.steps = 0;
  line.quantity = quantity;
  line.value = flatten(value);
  line.reference = flatten(reference);
  print(line);
}

void checkModel(const ElementCase& c, const std::string& name, MaterialModel model,
                const YAML::Node& expected) {
  const ElasticModel elastic(c.mesh, c.material, model, c.element);
  const double rest = restEnergyDensity(model, lameParameters(c.material)) * elastic.totalMass() /
                      c.material.density;
  show(c, name, "energy", scalar(elastic.energy(c.x) + rest), expected["energy"]);
  Vec f;
  elastic.gradient(c.x, f);
  show(c, name, "force", f, expected["f"]);
  BlockMatrix K;
  elastic.hessian(c.x, Definiteness::kExact, K);
  show(c, name, "stiffness", Eigen::MatrixXd(K.toSparse()), expected["K"]);
}

// f = R_b K_rest (R_b^T x - X), R of F at the element's centre.
void checkWarped(const ElementCase& c, const YAML::Node& expected) {
  const ElasticModel elastic(c.mesh, c.material, MaterialModel::kLinear, c.element);
  const Eigen::MatrixXd K = Eigen::MatrixXd(elastic.linearStiffness());
  const Eigen::Matrix3d R = polarRotation(elastic.centerGradient(0, c.x));
  Eigen::MatrixXd Rb = Eigen::MatrixXd::Zero(K.rows(), K.cols());
  for (int i = 0; i < K.rows(); i += 3) Rb.block<3, 3>(i, i) = R;
  const std::string name = "corotated_warped_stiffness";
  show(c, name, "force", Rb * (K * (Rb.transpose() * c.x - restPositions(c.mesh))), expected["f"]);
  show(c, name, "stiffness", Rb * K * Rb.transpose(), expected["K_approx"]);
}

}  // namespace

void evaluateElements(const CaseFile& file) {
  const Eigen::MatrixXd nodes = readMatrix(file.at("nodes_X"));
  const Eigen::MatrixXd displacement = readMatrix(file.at("displacement_u"));
  if ((nodes.rows() != 8 && nodes.rows() != 4) || nodes.cols() != 3 ||
      displacement.rows() != nodes.rows() || displacement.cols() != 3)
    throw std::runtime_error(file.path +
                             ": nodes_X and displacement_u: expected 4 or 8 points each");
  const NodeMatrix moved = nodes + displacement;
  ElementCase c{file, oneCell(nodes), Eigen::Map<const Vec>(moved.data(), moved.size()),
                readMaterial(file), nodes.rows() == 8 ? ElementType::kHexQ1 : ElementType::kTetP1};
  for (const auto& entry : file.at("models"))
    attempt(file.path, [&] {
      const std::string name = entry.first.as<std::string>();
      if (name == "corotated_warped_stiffness") return checkWarped(c, entry.second);
      checkModel(
          c, name,
          name == "corotated_energy" ? MaterialModel::kCorotated : materialModelFromString(name),
          entry.second);
    });
  const ElasticModel elastic(c.mesh, c.material, MaterialModel::kLinear, c.element);
  show(c, "linear", "rest_stiffness", Eigen::MatrixXd(elastic.linearStiffness()),
       file.root["K_rest"]);
  show(c, "linear", "consistent_mass", Eigen::MatrixXd(elastic.consistentMass().toSparse()),
       file.root["M_consistent_rho"]);
}

}  // namespace calipso::fem
