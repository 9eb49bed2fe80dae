#include <Eigen/Geometry>
#include <cmath>

#include "mesh_probe.hpp"
#include "reference_cases.hpp"

namespace calipso::fem {
namespace {

constexpr double kPi = 3.14159265358979323846;

struct TorsionRun {
  const CaseFile& file;
  std::string kind;
  ElementType element;
  Eigen::Vector3i cells;
};

void printTorsion(const TorsionRun& run, const DeformableBody& body, const std::vector<int>& end,
                  double degrees, const StepReport& report, const YAML::Node& reference) {
  const Box box = readBox(run.file);
  double torque = 0.0, axial = 0.0;
  for (int node : end) {
    const Eigen::Vector3d x = body.positions().segment<3>(3 * node), f = body.reaction(node);
    torque += x.cross(f).x();
    axial += f.x();
  }
  ResultLine line = lineFor(run.file, run.kind, run.element, readModel(run.file), body.nodeCount());
  addReport(report, &line);
  const std::string suffix = "@" + std::to_string(std::lround(degrees)) + "deg";
  const auto show = [&](const std::string& name, const Eigen::VectorXd& value,
                        const YAML::Node& expected) {
    if (expected) printQuantity(line, name + suffix, value, expected);
  };
  show("torque_x", scalar(torque), reference["torque_x"]);
  show("axial_force", scalar(axial), reference["axial_force"]);
  show("energy", scalar(body.elasticEnergy()), reference["energy"]);
  const Eigen::Vector3d corner(0.5 * (box.min.x() + box.max.x()), box.max.y(), box.max.z());
  const YAML::Node expected =
      reference["mid_corner"] ? reference["mid_corner"] : reference["mid_corner_displacement"];
  show("mid_corner", displacementAt(body.model().mesh(), body.positions(), corner), expected);
}

// Twists in equal parts of at most 15 degrees; a trial state turned by the whole angle at once
// would start inverted.
void runTorsion(const TorsionRun& run, const std::vector<YAML::Node>& references) {
  const Box box = readBox(run.file);
  DeformableBody body(boxMesh(box.min, box.max, run.cells), readMaterial(run.file),
                      exactOptions(readModel(run.file), run.element));
  const VolumeMesh& mesh = body.model().mesh();
  const std::vector<int> end = nodesOnPlane(mesh, 0, box.max.x());
  for (int node : nodesOnPlane(mesh, 0, box.min.x())) body.fixNode(node);
  double angle = 0.0;
  body.twist(end, Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitX(),
             [&angle](double) { return angle; });
  double degrees = 0.0;
  for (const YAML::Node& reference : references) {
    const double goal = readNumber(run.file, reference, "angle_deg");
    const int parts = std::max(1, static_cast<int>(std::ceil(std::abs(goal - degrees) / 15.0)));
    StepReport total;
    for (int k = 1; k <= parts; ++k) {
      // Every section starts from its share of the turn: the uniform twist.
      const double next = (degrees + (goal - degrees) * k / parts) * kPi / 180.0;
      Vec x = body.positions();
      for (int i = 0; i < mesh.nodeCount(); ++i) {
        const double share = (mesh.nodes(i, 0) - box.min.x()) / (box.max.x() - box.min.x());
        x.segment<3>(3 * i) = Eigen::AngleAxisd(share * (next - angle), Eigen::Vector3d::UnitX()) *
                              Eigen::Vector3d(x.segment<3>(3 * i));
      }
      angle = next;
      body.setState(x, Vec::Zero(x.size()));
      const StepReport part = body.solveStatic();
      total.newton_iterations += part.newton_iterations;
      total.linear_iterations += part.linear_iterations;
      total.milliseconds += part.milliseconds;
      total.solver = part.solver;
    }
    degrees = goal;
    printTorsion(run, body, end, degrees, total, reference);
  }
}

}  // namespace

void evaluateTorsion(const CaseFile& file) {
  std::map<std::array<int, 4>, std::vector<YAML::Node>> runs;
  for (const YAML::Node& r : sameDiscretisation(file))
    attempt(file.path, [&] {
      const Eigen::Vector3i cells = readCells(file, r);
      const auto element = referenceElement(readText(file, r, "element"));
      runs[{static_cast<int>(element), cells.x(), cells.y(), cells.z()}].push_back(r);
    });
  for (const auto& [key, results] : runs)
    attempt(file.path, [&, &k = key, &r = results] {
      runTorsion({file, "same_discretisation", static_cast<ElementType>(k[0]), {k[1], k[2], k[3]}},
                 r);
    });
  const YAML::Node list = converged(file)["results"];
  if (!list || !list.IsSequence()) return;
  const std::vector<YAML::Node> reference(list.begin(), list.end());
  for (const Eigen::Vector3i& cells : gridsOf(file))
    attempt(file.path, [&] {
      runTorsion({file, "default", FemOptions().element, cells}, reference);
    });
}

}  // namespace calipso::fem
