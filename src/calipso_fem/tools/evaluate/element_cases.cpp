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
          const Eigen::VectorXd& value, const Eigen::VectorXd& reference) {
  ResultLine line = lineFor(c.file, "same_discretisation", c.element, MaterialModel::kLinear,
                            c.mesh.nodeCount());
  line.material = model;
  line.solver = "none";
  line.steps = 0;
  line.quantity = quantity;
  line.value = value;
  line.reference = reference;
  print(line);
}

void checkModel(const ElementCase& c, const std::string& name, MaterialModel model,
                const YAML::Node& expected) {
  const ElasticModel elastic(c.mesh, c.material, model, c.element);
  const double rest =
      restEnergyDensity(model, lameParameters(c.material)) * elastic.totalMass() /
      c.material.density;
  show(c, name, "energy", scalar(elastic.energy(c.x) + rest), readVector(expected["energy"]));
  Vec f;
  elastic.gradient(c.x, f);
  show(c, name, "force", f, readVector(expected["f"]));
  BlockMatrix K;
  elastic.hessian(c.x, Definiteness::kExact, K);
  show(c, name, "stiffness", flatten(Eigen::MatrixXd(K.toSparse())),
       flatten(readMatrix(expected["K"])));
}

// f = R_b K_rest (R_b^T x - X), R of F at the element's centre.
void checkWarped(const ElementCase& c, const YAML::Node& expected) {
  const ElasticModel elastic(c.mesh, c.material, MaterialModel::kLinear, c.element);
  const Eigen::MatrixXd K = Eigen::MatrixXd(elastic.linearStiffness());
  const Eigen::Matrix3d R = polarRotation(elastic.centerGradient(0, c.x));
  Eigen::MatrixXd Rb = Eigen::MatrixXd::Zero(K.rows(), K.cols());
  for (int i = 0; i < K.rows(); i += 3) Rb.block<3, 3>(i, i) = R;
  show(c, "corotated_warped_stiffness", "force",
       Rb * (K * (Rb.transpose() * c.x - restPositions(c.mesh))), readVector(expected["f"]));
  show(c, "corotated_warped_stiffness", "stiffness", flatten(Rb * K * Rb.transpose()),
       flatten(readMatrix(expected["K_approx"])));
}

}  // namespace

void evaluateElements(const CaseFile& file) {
  const Eigen::MatrixXd nodes = readMatrix(file.at("nodes_X"));
  const NodeMatrix moved = nodes + readMatrix(file.at("displacement_u"));
  ElementCase c{file, oneCell(nodes), Eigen::Map<const Vec>(moved.data(), moved.size()),
                readMaterial(file),
                nodes.rows() == 8 ? ElementType::kHexQ1 : ElementType::kTetP1};
  for (const auto& entry : file.at("models")) {
    const std::string name = entry.first.as<std::string>();
    if (name == "corotated_warped_stiffness")
      checkWarped(c, entry.second);
    else
      checkModel(c, name,
                 name == "corotated_energy" ? MaterialModel::kCorotated
                                            : materialModelFromString(name),
                 entry.second);
  }
  const ElasticModel elastic(c.mesh, c.material, MaterialModel::kLinear, c.element);
  show(c, "linear", "rest_stiffness", flatten(Eigen::MatrixXd(elastic.linearStiffness())),
       flatten(readMatrix(file.at("K_rest"))));
  show(c, "linear", "consistent_mass", flatten(Eigen::MatrixXd(elastic.consistentMass().toSparse())),
       flatten(readMatrix(file.at("M_consistent_rho"))));
}

}  // namespace calipso::fem
