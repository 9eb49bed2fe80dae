#include <Eigen/Geometry>
#include <cmath>
#include <filesystem>

#include "reference_cases.hpp"

namespace calipso::fem {
namespace {

constexpr double kPi = 3.14159265358979323846;

// A shape in the world, and where it is held and looked at.
struct EmbeddedShape {
  TriangleMesh surface;
  std::function<double(const Eigen::Vector3d&)> beyond_clamp;  // <= 0: held
  Eigen::Vector3d clamp_point, clamp_normal;                   // of the clamped face
  bool clamp_on_lattice = false;                               // the face lies in a lattice plane
  Eigen::Vector3d tip;
};

void addQuad(int a, int b, int c, int d, std::vector<Eigen::Vector3i>* faces) {
  faces->emplace_back(a, b, c);
  faces->emplace_back(a, c, d);
}

TriangleMesh makeMesh(const std::vector<Eigen::Vector3d>& vertices,
                      const std::vector<Eigen::Vector3i>& faces) {
  TriangleMesh mesh;
  mesh.vertices.resize(vertices.size(), 3);
  mesh.triangles.resize(faces.size(), 3);
  for (std::size_t i = 0; i < vertices.size(); ++i) mesh.vertices.row(i) = vertices[i];
  for (std::size_t i = 0; i < faces.size(); ++i) mesh.triangles.row(i) = faces[i];
  if (signedVolume(mesh) < 0.0) mesh.triangles.col(1).swap(mesh.triangles.col(2));
  return mesh;
}

// A bar of circular section, radius a, bent on an arc of radius R and angle Phi.
EmbeddedShape bentBar(const CaseFile& file, const YAML::Node& g) {
  const double R = readNumber(file, g, "R"), a = readNumber(file, g, "a");
  const double Phi = readNumber(file, g, "Phi_deg") * kPi / 180.0;
  const Eigen::Vector3d d = readVector3(require(file, g, "arc_plane_d"));
  const Eigen::Vector3d C = readVector3(require(file, g, "arc_center_C"));
  const Eigen::Vector3d ex = Eigen::Vector3d::UnitX(), n = ex.cross(d);
  constexpr int kRings = 240, kSides = 96;
  // Radius of a polygon with the circle's area, so that the volume is right.
  const double radius = a * std::sqrt(2.0 * kPi / kSides / std::sin(2.0 * kPi / kSides));
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Eigen::Vector3i> faces;
  for (int i = 0; i <= kRings; ++i) {
    const double phi = Phi * i / kRings;
    const Eigen::Vector3d out = std::sin(phi) * ex - std::cos(phi) * d;
    for (int k = 0; k < kSides; ++k) {
      const double t = 2.0 * kPi * k / kSides;
      vertices.push_back(C + (R + radius * std::cos(t)) * out + radius * std::sin(t) * n);
    }
  }
  for (int i = 0; i < kRings; ++i)
    for (int k = 0; k < kSides; ++k) {
      const int l = (k + 1) % kSides;
      addQuad(i * kSides + k, (i + 1) * kSides + k, (i + 1) * kSides + l, i * kSides + l, &faces);
    }
  for (int k = 1; k + 1 < kSides; ++k) {
    faces.emplace_back(0, k, k + 1);
    faces.emplace_back(kRings * kSides, kRings * kSides + k + 1, kRings * kSides + k);
  }
  EmbeddedShape shape;
  shape.surface = makeMesh(vertices, faces);
  shape.beyond_clamp = [](const Eigen::Vector3d& p) { return p.x(); };
  shape.clamp_point = C - R * d;
  shape.clamp_normal = ex;
  shape.clamp_on_lattice = true;
  shape.tip = readVector3(require(file, g, "tip_material_point"));
  return shape;
}

// A rotated box, extended backwards by a fifth of its length; held behind x' = 0.
EmbeddedShape rotatedBox(const CaseFile& file, const YAML::Node& g) {
  const YAML::Node b = require(file, g, "local_box");
  const Eigen::Matrix3d Q = readMatrix(require(file, g, "rotation_Q"));
  Eigen::Vector3d low, high;
  const char* axes[] = {"x", "y", "z"};
  for (int a = 0; a < 3; ++a) {
    const Eigen::VectorXd range = readVector(require(file, b, axes[a]));
    if (range.size() != 2)
      throw std::runtime_error(file.path + ": local_box: expected [low, high]");
    low[a] = range[0];
    high[a] = range[1];
  }
  const double start = low.x();
  low.x() -= 0.2 * (high.x() - low.x());
  std::vector<Eigen::Vector3d> vertices;
  for (int c = 0; c < 8; ++c)
    vertices.push_back(Q * Eigen::Vector3d(c & 1 ? high.x() : low.x(), c & 2 ? high.y() : low.y(),
                                           c & 4 ? high.z() : low.z()));
  std::vector<Eigen::Vector3i> faces;
  addQuad(0, 4, 6, 2, &faces);
  addQuad(1, 3, 7, 5, &faces);
  addQuad(0, 1, 5, 4, &faces);
  addQuad(2, 6, 7, 3, &faces);
  addQuad(0, 2, 3, 1, &faces);
  addQuad(4, 5, 7, 6, &faces);
  EmbeddedShape shape;
  shape.surface = makeMesh(vertices, faces);
  shape.beyond_clamp = [Q, start](const Eigen::Vector3d& p) {
    return (Q.transpose() * p).x() - start;
  };
  shape.clamp_point = Q * Eigen::Vector3d(start, 0.0, 0.0);
  shape.clamp_normal = Q.col(0);
  shape.tip = readVector3(require(file, g, "tip_material_point"));
  return shape;
}

// Any other shape: the surface file, held where x <= 0.
EmbeddedShape surfaceFile(const CaseFile& file, const YAML::Node& g) {
  EmbeddedShape shape;
  const std::filesystem::path folder = std::filesystem::path(file.path).parent_path();
  shape.surface = loadMesh((folder / readText(file, g, "surface_obj")).string());
  shape.beyond_clamp = [](const Eigen::Vector3d& p) { return p.x(); };
  shape.clamp_normal = Eigen::Vector3d::UnitX();
  shape.clamp_point = Eigen::Vector3d::Zero();
  shape.clamp_on_lattice = true;
  shape.tip = readVector3(require(file, g, "tip_material_point"));
  return shape;
}

// A node belongs to the clamped face when the face lies nearer to it than to the next node along
// the lattice axis closest to the face's normal: held nodes end on average in the face, not before
// it.
void holdClamp(const EmbeddedShape& shape, DeformableBody* body) {
  const VolumeMesh& mesh = body->model().mesh();
  const double half =
      0.5 * body->grid().cell_size * shape.clamp_normal.cwiseAbs().maxCoeff() * (1.0 - 1e-6);
  for (int i = 0; i < mesh.nodeCount(); ++i)
    if (shape.beyond_clamp(mesh.node(i)) <= half) body->fixNode(i);
}

void runShape(const CaseFile& file, const EmbeddedShape& shape, int target_nodes) {
  FemOptions options = exactOptions(readModel(file), FemOptions().element);
  options.target_nodes = target_nodes;
  options.has_anchor = shape.clamp_on_lattice;
  options.anchor = shape.clamp_point;
  DeformableBody body(shape.surface, readMaterial(file), options);
  body.setGravity(readGravity(file));
  holdClamp(shape, &body);
  const StepReport report = body.solveStatic();
  NodeMatrix tip(1, 3);
  tip.row(0) = shape.tip.transpose();
  const Embedding probe = embed(tip, body.grid());
  ResultLine line =
      lineFor(file, "default", options.element, options.material_model, body.nodeCount());
  addReport(report, &line);
  const YAML::Node reference = file.at("reference");
  if (reference["tip"])
    printQuantity(line, "tip", probe.apply(body.positions()) - shape.tip, reference["tip"]);
  if (reference["energy"])
    printQuantity(line, "energy", scalar(body.elasticEnergy()), reference["energy"]);
}

}  // namespace

void evaluateShapes(const CaseFile& file) {
  const YAML::Node g = file.at("geometry");
  if (!g["arc_plane_d"] && !g["local_box"] && !g["surface_obj"])
    throw std::runtime_error(file.path +
                             ": geometry is no bent bar, no rotated box, and names no surface_obj");
  const EmbeddedShape shape = g["arc_plane_d"] ? bentBar(file, g)
                              : g["local_box"] ? rotatedBox(file, g)
                                               : surfaceFile(file, g);
  for (int nodes : {600, 1200, 2400, 6000})
    attempt(file.path, [&] { runShape(file, shape, nodes); });
}

}  // namespace calipso::fem
