#include <algorithm>
#include <cmath>

#include "mesh_probe.hpp"
#include "reference_cases.hpp"

namespace calipso::fem {
namespace {

// What a key such as "Q1_lumped_IE_h1/30_newton" or "P1_consistent_trapezoidal_dt1/480" asks for.
struct Scheme {
  FemOptions options;
  int steps_per_second = 30;
};

constexpr int kSamplesPerSecond = 30;

Scheme parseScheme(const std::string& key, MaterialModel model) {
  const auto has = [&key](const char* word) { return key.find(word) != std::string::npos; };
  Scheme s;
  s.options = exactOptions(model, referenceElement(key.substr(0, 2)));
  s.options.lumped_mass = has("_lumped");
  s.options.linearised = has("one_linearised_step");
  if (has("trapezoidal")) s.options.scheme = TimeScheme::kTrapezoidal;
  const std::size_t slash = key.find("1/");
  const int rate = slash == std::string::npos ? 0 : std::atoi(key.c_str() + slash + 2);
  if (rate <= 0 || rate % kSamplesPerSecond != 0)
    throw std::runtime_error("scheme '" + key + "': expected a step 1/N s with N a multiple of " +
                             std::to_string(kSamplesPerSecond));
  s.steps_per_second = rate;
  return s;
}

struct Trajectory {
  NodeMatrix center, corner;            // samples x 3, m
  double kinetic = 0.0, elastic = 0.0;  // at the end, J
  ResultLine line;
};

Trajectory simulate(const CaseFile& file, const Scheme& scheme, int samples) {
  const Box box = readBox(file);
  DeformableBody body(boxMesh(box.min, box.max, readCells(file, file.at("grid"))),
                      readMaterial(file), scheme.options);
  const VolumeMesh& mesh = body.model().mesh();
  body.setGravity(readGravity(file));
  for (int node : nodesOnPlane(mesh, 0, box.min.x())) body.fixNode(node);
  const Eigen::Vector3d center(box.max.x(), 0.5 * (box.min.y() + box.max.y()),
                               0.5 * (box.min.z() + box.max.z()));
  Trajectory t;
  t.center.setZero(samples, 3);
  t.corner.setZero(samples, 3);
  const int substeps = scheme.steps_per_second / kSamplesPerSecond;
  t.line.nodes = mesh.nodeCount();
  t.line.steps = 0;
  for (int k = 1; k < samples; ++k) {
    for (int s = 0; s < substeps; ++s) {
      const StepReport report = body.step(1.0 / scheme.steps_per_second);
      addReport(report, &t.line);
    }
    t.center.row(k) = displacementAt(mesh, body.positions(), center);
    t.corner.row(k) = displacementAt(mesh, body.positions(), box.max);
  }
  t.line.ms_per_step /= std::max(1, t.line.steps);
  t.kinetic = body.kineticEnergy();
  t.elastic = body.elasticEnergy();
  return t;
}

// Error: largest distance over all samples, relative to the largest displacement.
void printTrajectory(ResultLine line, const NodeMatrix& value, const YAML::Node& expected) {
  const NodeMatrix reference = readMatrix(expected);
  if (reference.rows() != value.rows() || reference.cols() != 3)
    throw std::runtime_error(line.case_name + ": " + line.quantity + ": expected " +
                             std::to_string(value.rows()) + " samples of three numbers");
  line.value = value.row(value.rows() - 1).transpose();
  line.reference = reference.row(reference.rows() - 1).transpose();
  line.error =
      (value - reference).rowwise().norm().maxCoeff() / reference.rowwise().norm().maxCoeff();
  print(line);
}

void runScheme(const CaseFile& file, const std::string& key, const std::string& kind,
               const Scheme& scheme, const YAML::Node& expected) {
  const int samples = static_cast<int>(require(file, expected, "tip_center").size());
  Trajectory t = simulate(file, scheme, samples);
  const ResultLine head =
      lineFor(file, kind, scheme.options.element, readModel(file), t.line.nodes);
  t.line.case_name = head.case_name;
  t.line.kind = kind;
  t.line.element = head.element;
  t.line.material = head.material;
  t.line.quantity = "tip_center:" + key;
  printTrajectory(t.line, t.center, expected["tip_center"]);
  t.line.quantity = "tip_corner:" + key;
  if (expected["tip_corner_ypzp"]) printTrajectory(t.line, t.corner, expected["tip_corner_ypzp"]);
  if (expected["final_kinetic"])
    printQuantity(t.line, "final_kinetic:" + key, scalar(t.kinetic), expected["final_kinetic"]);
  if (expected["final_elastic"])
    printQuantity(t.line, "final_elastic:" + key, scalar(t.elastic), expected["final_elastic"]);
}

// The default element by a scheme of the tables, against one of the finest solutions.
void runDefault(const CaseFile& file, const std::string& key, const std::string& reference) {
  const YAML::Node expected = converged(file)[reference];
  if (!expected) return;
  Scheme scheme = parseScheme("Q1_" + key, readModel(file));
  scheme.options.element = FemOptions().element;
  runScheme(file, key + "|" + reference, "default", scheme, expected);
}

}  // namespace

void evaluateDynamics(const CaseFile& file) {
  const YAML::Node tables = file.root["same_discretisation"];
  for (const auto& entry : tables ? tables : YAML::Node(YAML::NodeType::Map)) {
    const std::string key = entry.first.as<std::string>();
    if (key.rfind("Q1_", 0) != 0 && key.rfind("P1_", 0) != 0) continue;
    attempt(file.path, [&] {
      runScheme(file, key, "same_discretisation", parseScheme(key, readModel(file)), entry.second);
    });
  }
  if (!converged(file).IsMap()) return;
  for (const char* key :
       {"lumped_IE_h1/30_newton", "lumped_IE_h1/120_newton", "lumped_trapezoidal_dt1/120",
        "consistent_trapezoidal_dt1/120", "lumped_trapezoidal_dt1/480"})
    attempt(file.path, [&] { runDefault(file, key, "space_time_converged"); });
  for (const char* step : {"h1/30", "h1/120"})
    attempt(file.path, [&] {
      runDefault(file, std::string("consistent_IE_") + step, std::string("fine_space_IE_") + step);
    });
}

}  // namespace calipso::fem
