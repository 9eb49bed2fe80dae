#include <algorithm>
#include <cmath>
#include <regex>

#include "mesh_probe.hpp"
#include "reference_cases.hpp"

namespace calipso::fem {
namespace {

// A quadrilateral panel in x-y, corners in the order (0,0), (1,0), (1,1), (0,1) of its parameters,
// extruded along z. Its first and third side run along y.
struct Panel {
  Eigen::Matrix<double, 4, 2> corners;
  double low = 0.0, high = 1.0;  // z
};

// Reads "corners (0,0),(48,44),(48,60),(0,44) in x-y, extruded z in [0,1]".
Panel readPanel(const CaseFile& file) {
  const std::string text = readText(file, file.root, "geometry");
  static const std::string kNumber = "\\s*([-+0-9.eE]+)\\s*";
  const std::regex pair("\\(" + kNumber + "," + kNumber + "\\)");
  const std::regex range("z\\s+in\\s+\\[" + kNumber + "," + kNumber + "\\]");
  Panel panel;
  std::sregex_iterator it(text.begin(), text.end(), pair), end;
  std::smatch z;
  for (int k = 0; k < 4; ++k, ++it) {
    if (it == end)
      throw std::runtime_error(file.path + ": geometry: expected four corners (x,y), found " +
                               std::to_string(k) + " in '" + text + "'");
    panel.corners.row(k) << std::stod((*it)[1]), std::stod((*it)[2]);
  }
  if (!std::regex_search(text, z, range))
    throw std::runtime_error(file.path + ": geometry: expected 'z in [low,high]' in '" + text +
                             "'");
  panel.low = std::stod(z[1]);
  panel.high = std::stod(z[2]);
  return panel;
}

VolumeMesh panelMesh(const Panel& panel, const Eigen::Vector3i& cells, bool graded) {
  VolumeMesh mesh = boxMesh({0, 0, panel.low}, {1, 1, panel.high}, cells);
  for (int axis = 0; graded && axis < 2; ++axis) gradeBox(axis, GradedEnds::kBoth, &mesh);
  for (int i = 0; i < mesh.nodeCount(); ++i) {
    const double xi = mesh.nodes(i, 0), eta = mesh.nodes(i, 1);
    const Eigen::Vector4d N((1 - xi) * (1 - eta), xi * (1 - eta), xi * eta, (1 - xi) * eta);
    mesh.nodes.row(i).head<2>() = (panel.corners.transpose() * N).transpose();
  }
  return mesh;
}

// Says "u_z=0 on z=0" or "u_z=0 on z=0 and z=1" which of the two faces slide in their planes.
void support(const CaseFile& file, const Panel& panel, DeformableBody* body) {
  const VolumeMesh& mesh = body->model().mesh();
  const std::string bc = readText(file, file.root, "bc");
  const std::size_t at = bc.find("u_z=0");
  const std::string rule =
      at == std::string::npos ? "" : bc.substr(at, bc.find_first_of(";,(", at) - at);
  const auto slide = [&](double z) {
    for (int node : nodesOnPlane(mesh, 2, z)) body->prescribe(node, 2, [](double) { return 0.0; });
  };
  if (rule.find("on z=0") != std::string::npos) slide(panel.low);
  if (rule.find("and z=") != std::string::npos) slide(panel.high);
  for (int node : nodesOnPlane(mesh, 0, panel.corners(0, 0))) body->fixNode(node);
}

// Graded: towards the four corners, all of which are singular points of the stress.
void runCook(const CaseFile& file, const std::string& kind, ElementType element,
             const Eigen::Vector3i& cells, const YAML::Node& reference, bool graded = false) {
  const Panel panel = readPanel(file);
  const double end = panel.corners(2, 0);
  DeformableBody body(panelMesh(panel, cells, graded), readMaterial(file),
                      exactOptions(readModel(file), element));
  const VolumeMesh& mesh = body.model().mesh();
  body.setGravity(readGravity(file));
  body.setNodalForces(planeTraction(
      mesh, 0, end, readVector3(require(file, file.at("traction"), "dead_traction"))));
  support(file, panel, &body);
  const StepReport report = body.solveStatic();

  ResultLine line = lineFor(file, kind, element, readModel(file), mesh.nodeCount());
  addReport(report, &line);
  // Keys of the finest solution carry the point's coordinates: u_top_right_48_60_0.
  const auto show = [&](const std::string& name, const Eigen::VectorXd& value) {
    for (const auto& entry : reference) {
      const std::string key = entry.first.as<std::string>();
      if (key == name || key.rfind(name + "_", 0) == 0)
        return printQuantity(line, name + (graded ? "@graded" : ""), value, entry.second);
    }
  };
  const double top = panel.corners(2, 1), middle = 0.5 * (panel.corners(1, 1) + top);
  const auto at = [&](double y) {
    return displacementAt(mesh, body.positions(), {end, y, panel.low});
  };
  show("u_top_right", at(top));
  show("u_mid_right", at(middle));
  show("energy", scalar(body.elasticEnergy()));
}

}  // namespace

void evaluateCook(const CaseFile& file) {
  for (const YAML::Node& r : sameDiscretisation(file))
    attempt(file.path, [&] {
      runCook(file, "same_discretisation", referenceElement(readText(file, r, "element")),
              readCells(file, r), r);
    });
  if (!converged(file).IsMap()) return;
  std::vector<Eigen::Vector3i> grids;
  for (const YAML::Node& r : sameDiscretisation(file)) {
    const Eigen::Vector3i cells = readCells(file, r);
    if (std::find(grids.begin(), grids.end(), cells) == grids.end()) grids.push_back(cells);
  }
  if (grids.empty()) grids = {{8, 8, 1}, {16, 16, 1}, {32, 32, 1}};
  for (const Eigen::Vector3i& cells : grids)
    for (const bool graded : {false, true})
      attempt(file.path, [&] {
        runCook(file, "default", FemOptions().element, cells, converged(file), graded);
      });
}

}  // namespace calipso::fem
