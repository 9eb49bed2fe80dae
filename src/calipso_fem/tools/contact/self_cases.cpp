#include <algorithm>
#include <cmath>
#include <memory>

#include "../../src/world/obstacle_query.hpp"
#include "../../src/world/self_proximity.hpp"
#include "contact_cases.hpp"

// Deformable objects that meet themselves, each with self-contact and without.
namespace calipso::fem {
namespace {

using test::boxSurface;
using test::horseshoe;
using test::movedMesh;
using test::SoftScene;

constexpr double kProximity = 5e-3;  // m, of SoftScene
constexpr double kStep = 1.0 / 60.0;

TriangleMesh turned(TriangleMesh mesh, double angle, const Eigen::Vector3d& axis) {
  mesh.vertices = mesh.vertices * Eigen::AngleAxisd(angle, axis).toRotationMatrix().transpose();
  return mesh;
}

// How much of a closed surface is inside of itself.
struct Overlap {
  double depth = 0.0;  // m, of the vertices that are
  int edges = 0;       // that go through faces
};

Overlap overlapOf(const TriangleMesh& mesh, const SelfProximity& self) {
  constexpr double kOutwards = 1e-6, kReach = 0.05;  // m
  Overlap overlap;
  const SurfaceTree tree(mesh);
  overlap.edges = self.crossings(tree, kProximity, 0.1 * kProximity);
  if (overlap.edges == 0) return overlap;
  for (int v = 0; v < mesh.vertexCount(); ++v) {
    const Eigen::Vector3d x = mesh.vertex(v);
    if (!encloses(mesh, x + kOutwards * tree.vertexNormal(v).normalized())) continue;
    if (const auto hit = self.nearest(tree, v, x, kReach, 0.0, kReach))
      overlap.depth = std::max(overlap.depth, -hit->distance);
  }
  return overlap;
}

// What happens to one body, looked at every few steps.
struct Course {
  Overlap worst, last;
  double growth = 0.0, lowest = 0.0, scale = 1.0;
  double driven = 0.0;  // s, until when something from outside does work
  bool finite = true;

  void play(SoftScene& scene, double seconds) {
    constexpr int kEvery = 4;
    SoftObject& soft = scene.soft(0);
    const TriangleMesh surface = soft.tree().mesh();
    const SelfProximity self(surface, soft.body().embedding());
    lowest = scene.energy();
    for (int k = 1; k <= std::lround(seconds / kStep) && finite; ++k) {
      scene.step(kStep);
      const double e = scene.energy();
      finite = std::isfinite(e);
      const bool left_alone = scene.time() > driven + 1.5 * kStep;
      if (left_alone) growth = std::max(growth, (e - lowest) / scale);
      lowest = left_alone ? std::min(lowest, e) : e;
      if (k % kEvery == 0) look(surface, soft.vertices(), self);
    }
  }
  void look(TriangleMesh surface, const decltype(TriangleMesh::vertices)& vertices,
            const SelfProximity& self) {
    surface.vertices = vertices;
    last = overlapOf(surface, self);
    worst = {std::max(worst.depth, last.depth), std::max(worst.edges, last.edges)};
  }
  std::vector<std::pair<std::string, double>> figures() const {
    return {{"depth of vertices inside of its own surface, largest, m, ", worst.depth},
            {"edges through its own faces between vertices, most at a time, ", worst.edges},
            {"the same at the end, ", last.edges}};
  }
};

std::vector<Result> resultsOf(const std::string& what, const Course& c, SoftScene& scene, bool on) {
  const std::string with = what + (on ? ", self-contact on" : ", self-contact off");
  const double ms = scene.cpuMs() * kFrame / scene.time(), ratio = c.worst.depth / kProximity;
  std::vector<Result> results;
  for (const auto& [quantity, value] : c.figures())
    results.push_back({quantity + with, c.finite ? value : NAN, 0.0, ratio, c.growth, ms});
  return results;
}

template <class Build>
std::vector<Result> offAndOn(const std::string& what, double seconds, const Build& build,
                             double driven = 0.0) {
  std::vector<Result> results;
  for (const bool on : {false, true}) {
    SoftScene scene;
    Course course;
    course.driven = driven;
    SoftObject& soft = build(scene);
    soft.setSelfContact(on);
    course.scale = soft.body().totalMass() * kG * 0.1;
    course.play(scene, seconds);
    const auto part = resultsOf(what, course, scene, on);
    results.insert(results.end(), part.begin(), part.end());
  }
  return results;
}

const Material kCloth{3e4, 0.3, 300.0, 0.02};

std::vector<Result> clothOverBar() {
  return offAndOn("cloth over a bar", 4.0, [](SoftScene& scene) -> SoftObject& {
    scene.surface.friction = 0.5;
    const TriangleMesh sheet = boxSurface({0.6, 0.3, 0.004}, Eigen::Vector3i(30, 15, 1));
    SoftObject& cloth =
        scene.addSoft(movedMesh(sheet, {0.01, 0, 0.004}), {5e3, 0.3, 300.0, 0.02}, 0.02);
    scene.addMoving(
        movedMesh(boxSurface({0.006, 0.5, 0.02}, Eigen::Vector3i(1, 25, 1)), {0, 0, -0.01}),
        [](double) { return Eigen::Isometry3d::Identity(); });
    return cloth;
  });
}

std::vector<Result> ribbonOnTable() {
  return offAndOn("ribbon set down on end", 3.0, [](SoftScene& scene) -> SoftObject& {
    scene.surface.friction = 0.4;
    scene.addPlane(Eigen::Vector3d::UnitZ(), 0.0);
    const TriangleMesh ribbon = turned(boxSurface({0.6, 0.2, 0.004}, Eigen::Vector3i(30, 10, 1)),
                                       -1.55, Eigen::Vector3d::UnitY());
    return scene.addSoft(movedMesh(ribbon, {0, 0, 0.31}), kCloth, 0.02);
  });
}

std::vector<Result> horseshoeSqueezed() {
  return offAndOn(
      "horseshoe squeezed between plates", 3.0,
      [](SoftScene& scene) -> SoftObject& {
        scene.gravity.setZero();
        scene.surface.friction = 0.3;
        SoftObject& soft =
            scene.addSoft(horseshoe(0.15, 0.05, 0.03, 0.06, Eigen::Vector3i(32, 4, 2)),
                          {1e5, 0.3, 1000.0, 0.02}, 0.015);
        for (const double side : {1.0, -1.0})
          scene.addMoving(movedMesh(boxSurface({0.02, 0.3, 0.12}, {1, 12, 6}), {0, 0, -0.12}),
                          [side](double t) {
                            const double close = std::min(1.0, t / 1.5);
                            return Eigen::Isometry3d(
                                Eigen::Translation3d(side * (0.0755 - 0.05 * close), 0, 0));
                          });
        return soft;
      },
      1.5);
}

// A flag whose middle line is held: wind folds its halves onto each other behind it.
std::vector<Result> flagInWind() {
  std::vector<Result> results;
  const double seconds = 3.0;
  TriangleMesh flag = boxSurface({0.6, 0.4, 0.004}, Eigen::Vector3i(30, 20, 1));
  flag.vertices.col(1).swap(flag.vertices.col(2));
  flag.triangles.col(1).swap(flag.triangles.col(2));
  for (const bool on : {false, true}) {
    WorldScene scene = test::sceneWith(flag, {0, 0, 1}, false);
    scene.objects[0].attachments.push_back({"pole", {-0.011, -0.1, 0.7}, {0.011, 0.1, 1.3}});
    WorldParams params;
    params.proximity = kProximity;
    params.defaults.youngs_modulus = 5e4;
    params.defaults.density = 300.0;
    params.defaults.cell_size = 0.02;
    params.defaults.self_contact = on;
    World world(scene, params);
    Edit wind = test::editOf(EditKind::kWind);
    wind.vector = {0.3, 9.0, 0.0};
    world.submit(wind);
    FemOptions options;
    options.cell_size = 0.02;
    const SelfProximity self(flag, DeformableBody(flag, kCloth, options).embedding());
    Course course;
    Run run;
    world.advanceTo(0.0);
    run.play(world, seconds, [&](const WorldState& state) {
      if (run.frames % 4 == 0) course.look(flag, state.objects[0].vertices, self);
    });
    const std::string with =
        std::string("flag folded by wind, self-contact ") + (on ? "on" : "off");
    for (const auto& [what, value] : course.figures())
      results.push_back(
          {what + with, value, 0.0, course.worst.depth / kProximity, NAN, run.msPerFrame()});
  }
  return results;
}

}  // namespace

Cases selfCases() {
  return {{"self_cloth_over_bar", clothOverBar},
          {"self_ribbon_on_table", ribbonOnTable},
          {"self_flag", flagInWind},
          {"self_horseshoe", horseshoeSqueezed}};
}

}  // namespace calipso::fem
