#include <algorithm>
#include <sstream>

#include "contact_cases.hpp"

// Time per frame (process CPU time, both threads together).
namespace calipso::fem {
namespace {

using test::beaker;
using test::boxSurface;
using test::editOf;
using test::movedMesh;
using test::sceneWith;
using test::SoftScene;

void addCubes(SoftScene& scene, int count) {
  scene.surface.friction = 0.1;
  scene.addPlane(Eigen::Vector3d::UnitZ(), 0.0);
  for (int i = 0; i < count; ++i)
    scene.addSoft(movedMesh(boxSurface({0.5, 0.5, 0.5}, 7),
                            i == 0 ? Eigen::Vector3d(0, 0, 0.5) : Eigen::Vector3d(0.03, 0.02, 1.2)),
                  {1e5, 0.3, 1000.0, 0.01}, 0.5 / 7);
}

// Soft cubes of 512 nodes fall on a plane and on each other.
std::vector<Result> cubesAt(int count, int rate, int frames, const ContactParams& params,
                            const std::string& how = "") {
  SoftScene scene(params);
  addCubes(scene, count);
  const double start = scene.energy();
  double lowest = 1.0, growth = 0.0, slowest = 0.0, wall = 0.0, slowest_wall = 0.0, overlap = 0.0;
  for (int k = 0; k < frames; ++k) {
    const double before = scene.cpuMs(), wall_before = wallMs();
    for (int p = 0; p < rate / 30; ++p) scene.step(1.0 / rate);
    slowest = std::max(slowest, scene.cpuMs() - before);
    slowest_wall = std::max(slowest_wall, wallMs() - wall_before);
    wall += wallMs() - wall_before;
    std::vector<TriangleMesh> surfaces;
    for (int i = 0; i < count; ++i) {
      lowest = std::min(lowest, scene.soft(i).vertices().col(2).minCoeff());
      surfaces.push_back({scene.soft(i).vertices(), scene.soft(i).tree().mesh().triangles});
    }
    overlap = std::max(overlap, deepestOverlap(surfaces));
    growth = std::max(growth, scene.energy() / start - 1.0);
  }
  const std::string what = cubes(count) + ", " + std::to_string(rate) + " steps a second" + how;
  const double depth = overlap / params.proximity, ms = scene.cpuMs() / frames;
  return {{"lowest vertex of " + what + ", m", lowest, 0.0, depth, growth, ms},
          {"wall time of a frame of " + what + ", ms", wall / frames, 10.0, depth, growth, ms},
          {"wall time of the slowest frame of " + what + ", ms", slowest_wall, 10.0, depth, growth,
           slowest}};
}

std::vector<Result> twoCubes() {
  std::vector<Result> results;
  for (const int rate : {30, 60})
    for (const Result& r : cubesAt(2, rate, 90, {})) results.push_back(r);
  return results;
}

// Error against time: a second with several steps and tolerances, to be compared with Bullet's.
std::vector<Result> fallingCubes() {
  std::vector<Result> results;
  for (const int count : {1, 2})
    for (const int rate : {30, 60, 120})
      for (const double tolerance : {1e-2, 1e-3}) {
        ContactParams params;
        params.residual = tolerance;
        std::ostringstream how;
        how << ", to " << tolerance;
        results.push_back(cubesAt(count, rate, 30, params, how.str()).front());
      }
  return results;
}

// Two bodies of 1,000 nodes each, one lying on the other, at h = 1/60.
std::vector<Result> twoBodies() {
  SoftScene scene;
  scene.surface.friction = 0.5;
  scene.addPlane(Eigen::Vector3d::UnitZ(), 0.0);
  for (const double z : {0.101, 0.303})
    scene.addSoft(movedMesh(boxSurface({0.2, 0.2, 0.2}, 9), {0.1 * z, 0, z}),
                  {1e5, 0.3, 1000.0, 0.01}, 0.2 / 9);
  for (int k = 0; k < 20; ++k) scene.step(1.0 / 60.0);
  const double before = scene.cpuMs(), wall_before = wallMs();
  const int frames = 60;
  for (int k = 0; k < frames; ++k) scene.step(1.0 / 60.0);
  const double ms = (scene.cpuMs() - before) / frames;
  return {{"wall time of a frame of two deformable bodies of 1000 nodes in contact, ms",
           (wallMs() - wall_before) / frames, 10.0, scene.deepest() / 5e-3, 0.0, ms}};
}

WorldScene pyramidOf(const TriangleMesh& mesh, double pitch) {
  const Eigen::Vector3d size =
      (mesh.vertices.colwise().maxCoeff() - mesh.vertices.colwise().minCoeff()).transpose();
  WorldScene scene = sceneWith(mesh, {0, 0, 0.5 * size.z()});
  const WorldObject first = scene.objects.front();
  scene.objects.clear();
  int id = 0;
  for (int row = 0; row < 10; ++row)
    for (int i = 0; i < 10 - row; ++i) {
      WorldObject o = first;
      o.name = "cup" + std::to_string(id++);
      o.world_from_object.translation() = Eigen::Vector3d(pitch * size.x() * (i + 0.5 * row), 0,
                                                          0.6 * size.z() + 1.1 * size.z() * row);
      scene.objects.push_back(o);
    }
  return scene;
}

// Afloat before: with twice the gravity they fall with 1 g.
void letFall(const WorldScene& scene, World& world) {
  for (const WorldObject& o : scene.objects) {
    Edit edit = editOf(EditKind::kGravity, EditMode::kFactor);
    edit.object = o.name;
    edit.factor = 2.0;
    world.submit(edit);
  }
  world.advanceTo(0.0);
}

// A second of falling and five of settling, in frames of a video at `rate`.
std::vector<Result> pyramidAt(double rate) {
  const WorldScene scene = pyramidOf(beaker(), 1.2);
  WorldParams params;
  params.frame_period = 1.0 / rate;
  World world(scene, params);
  letFall(scene, world);
  Run falling, settling;
  falling.period = settling.period = params.frame_period;
  falling.play(world, 1.0);
  settling.play(world, 5.0);
  double lowest = 1.0;
  for (const ObjectSnapshot& o : world.state().objects)
    lowest = std::min(lowest, o.vertices.col(2).minCoeff());
  const std::string h = ", h = 1/" + std::to_string(std::lround(rate)) + ", ms";
  return {{"55 cups falling as a pyramid, wall time per frame" + h, falling.wallMsPerFrame(), 15.0,
           0, 0, falling.msPerFrame()},
          {"slowest frame of it" + h, falling.slowest_wall_ms, 15.0, 0, 0, falling.slowest_ms},
          {"lowest point of the cups after 6 s, m", lowest, 0.0, 0, 0, settling.msPerFrame()}};
}

std::vector<Result> pyramid() {
  std::vector<Result> results;
  for (const double rate : {60.0, 30.0})
    for (const Result& r : pyramidAt(rate)) results.push_back(r);
  return results;
}

// 100 rigid bodies that have come to rest.
std::vector<Result> asleep() {
  WorldScene scene = sceneWith(boxSurface({0.1, 0.1, 0.1}, 1), {0, 0, 0.0501});
  const WorldObject first = scene.objects.front();
  scene.objects.clear();
  for (int i = 0; i < 100; ++i) {
    WorldObject o = first;
    o.name = "box" + std::to_string(i);
    o.world_from_object.translation() = Eigen::Vector3d(0.15 * (i % 10), 0.15 * (i / 10), 0.06);
    scene.objects.push_back(o);
  }
  World world(scene, {});
  letFall(scene, world);
  Run settling, resting;
  settling.play(world, 5.0);
  resting.play(world, 2.0);
  int awake = 0;
  for (const ObjectSnapshot& o : world.state().objects) awake += !o.sleeping;
  return {
      {"100 sleeping bodies, ms per frame", resting.msPerFrame(), 0.3, 0, 0, resting.msPerFrame()},
      {"of them awake", static_cast<double>(awake), 0.0, 0, 0, resting.msPerFrame()}};
}

}  // namespace

Cases speedCases() {
  return {{"two_cubes", twoCubes},
          {"falling_cubes", fallingCubes},
          {"two_bodies", twoBodies},
          {"pyramid", pyramid},
          {"asleep", asleep}};
}

}  // namespace calipso::fem
