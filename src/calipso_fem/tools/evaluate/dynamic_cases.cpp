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

Scheme parseScheme(const std::string& key, MaterialModel model) {
  const auto has = [&key](const char* word) { return key.find(word) != std::string::npos; };
  Scheme s;
  s.options = exactOptions(model, referenceElement(key.substr(0, 2)));
  s.options.lumped_mass = has("_lumped");
  s.options.linearised = has("one_linearised_step");
  if (has("trapezoidal")) s.options.scheme = TimeScheme::kTrapezoidal;
  s.steps_per_second = std::stoi(key.substr(key.find("1/") + 2));
  return s;
}

struct Trajectory {
  NodeMatrix center, corner;   // samples x 3, m
  ResultLine line;
};

Trajectory simulate(const CaseFile& file, const Scheme& scheme, int samples) {
  const Box box = readBox(file);
  const YAML::Node grid = file.at("grid");
  DeformableBody body(boxMesh(box.min, box.max, {grid["nx"].as<int>(), grid["ny"].as<int>(),
                                                 grid["nz"].as<int>()}),
                      readMaterial(file), scheme.options);
  const VolumeMesh& mesh = body.model().mesh();
  body.setGravity(readGravity(file));
  for (int node : nodesOnPlane(mesh, 0, box.min.x())) body.fixNode(node);
  const Eigen::Vector3d center(box.max.x(), 0.5 * (box.min.y() + box.max.y()),
                               0.5 * (box.min.z() + box.max.z()));
  Trajectory t;
  t.center.setZero(samples, 3);
  t.corner.setZero(samples, 3);
  const int substeps = scheme.steps_per_second / 30;
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
  return t;
}

// Error: largest distance over all samples, relative to the largest displacement.
void printTrajectory(ResultLine line, const NodeMatrix& value, const YAML::Node& expected) {
  const NodeMatrix reference = readMatrix(expected);
  line.value = value.row(value.rows() - 1).transpose();
  line.reference = reference.row(reference.rows() - 1).transpose();
  line.error = (value - reference).rowwise().norm().maxCoeff() /
               reference.rowwise().norm().maxCoeff();
  print(line);
}

void runScheme(const CaseFile& file, const std::string& key, const std::string& kind,
               const Scheme& scheme, const YAML::Node& expected) {
  const int samples = static_cast<int>(expected["tip_center"].size());
  Trajectory t = simulate(file, scheme, samples);
  const ResultLine head =
      lineFor(file, kind, scheme.options.element, readModel(file), t.line.nodes);
  t.line.case_name = head.case_name;
  t.line.kind = kind;
  t.line.element = head.element;
  t.line.material = head.material;
  t.line.quantity = "tip_center:" + key;
  printTrajectory(t.line, t.center, expected["tip_center"]);
  if (!expected["tip_corner_ypzp"]) return;
  t.line.quantity = "tip_corner:" + key;
  printTrajectory(t.line, t.corner, expected["tip_corner_ypzp"]);
}

}  // namespace

void evaluateDynamics(const CaseFile& file) {
  for (const auto& entry : file.at("same_discretisation")) {
    const std::string key = entry.first.as<std::string>();
    if (key[0] != 'Q' && key[0] != 'P') continue;
    runScheme(file, key, "same_discretisation", parseScheme(key, readModel(file)), entry.second);
  }
  const YAML::Node reference = file.at("reference");
  if (!reference["space_time_converged"]) return;
  for (const char* key : {"Q1_lumped_IE_h1/30_newton", "Q1_lumped_IE_h1/120_newton",
                          "Q1_lumped_trapezoidal_dt1/120", "Q1_lumped_trapezoidal_dt1/480"}) {
    Scheme scheme = parseScheme(key, readModel(file));
    scheme.options.element = FemOptions().element;
    runScheme(file, std::string(key).substr(3), "default", scheme,
              reference["space_time_converged"]);
  }
}

}  // namespace calipso::fem
