#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "calipso_scene/scene.hpp"
#include "contact_cases.hpp"

// A scene folder whose truth is known: shapes, poses and, of thrown objects, motion are the true
// ones.
namespace calipso::fem {
namespace {

using test::editOf;

Eigen::Isometry3d poseOf(const YAML::Node& node) {
  Eigen::Matrix4d m;
  for (int r = 0; r < 4; ++r)
    for (int c = 0; c < 4; ++c) m(r, c) = node[r][c].as<double>();
  return Eigen::Isometry3d(m);
}

Eigen::Vector3d vectorOf(const YAML::Node& node) {
  return {node[0].as<double>(), node[1].as<double>(), node[2].as<double>()};
}

WorldScene trueScene(const Scene& scene, const YAML::Node& truth) {
  WorldScene world;
  world.camera = scene.camera;
  world.gravity = scene.gravity;
  world.planes = scene.planes;
  for (const std::string& path : scene.support_meshes)
    world.support_meshes.push_back({path, loadMesh(path)});
  for (size_t k = 0; k < scene.objects.size(); ++k) {
    const YAML::Node t = truth["objects"][k];
    WorldObject o;
    o.name = scene.objects[k].name;
    o.index = scene.objects[k].index;
    o.mesh = loadMesh(scene.directory + "/" + t["true_mesh"].as<std::string>());
    o.world_from_object = poseOf(t["world_T_object"][0]);
    o.attachments = scene.objects[k].attachments;
    world.objects.push_back(o);
  }
  return world;
}

double meanPixelError(const Camera& camera, const decltype(TriangleMesh::vertices)& vertices,
                      const TriangleMesh& mesh, const Eigen::Isometry3d& pose) {
  double sum = 0.0;
  for (int v = 0; v < mesh.vertexCount(); ++v)
    sum += (camera.projectWorld(vertices.row(v).transpose()) -
            camera.projectWorld(pose * mesh.vertex(v)))
               .norm();
  return sum / mesh.vertexCount();
}

// A thrown object is simulated from its true start on.
std::vector<Result> follow(const Scene& scene, const YAML::Node& truth, size_t k) {
  const YAML::Node t = truth["objects"][k];
  const WorldScene start = trueScene(scene, truth);
  WorldParams params;
  params.frame_period = 1.0 / scene.fps;
  const double friction = t["friction"].as<double>(), restitution = t["restitution"].as<double>();
  params.support.friction = params.defaults.surface.friction = friction;
  params.support.restitution = params.defaults.surface.restitution = restitution;
  World world(start, params);
  const std::string name = start.objects[k].name;
  world.addObservedMotion(
      name, {0.0, true, start.objects[k].world_from_object, vectorOf(t["com_position_world"][0]),
             vectorOf(t["linear_velocity_com"][0]), vectorOf(t["angular_velocity_world"][0]),
             scene.gravity});
  Edit simulate = editOf(EditKind::kVelocity, EditMode::kEstimated);
  simulate.object = name;
  world.submit(simulate);
  world.advanceTo(0.0);
  const double impact = t["first_collision_time_s"].as<double>();
  Run run;
  run.period = params.frame_period;
  double worst = 0.0, touched = NAN, late = 0.0;
  int frame = 0;
  run.play(world, (scene.frame_count - 1) / scene.fps, [&](const WorldState& s) {
    const double error = meanPixelError(scene.camera, s.objects[k].vertices, start.objects[k].mesh,
                                        poseOf(t["world_T_object"][++frame]));
    (s.time < impact ? worst : late) = std::max(s.time < impact ? worst : late, error);
    if (std::isnan(touched) && !s.first_touches.empty()) touched = s.first_touches.front().time;
  });
  const double ratio = run.deepest / 5e-3, ms = run.msPerFrame();
  return {{name + ": largest mean error until the first impact, px", worst, 0.0, ratio, 0, ms},
          {name + ": instant of the first impact, frames", touched * scene.fps, impact * scene.fps,
           ratio, 0, ms},
          {name + ": largest mean error after it, px", late, 0.0, ratio, 0, ms}};
}

// Makes both objects deformable and lifts the first over the second.
void liftFirstOverSecond(const WorldScene& start, const Eigen::Vector3d& up, World& world) {
  const auto middle = [&](int k) {
    return start.objects[k].world_from_object *
           Eigen::Vector3d(start.objects[k].mesh.vertices.colwise().mean().transpose());
  };
  for (const int k : {0, 1}) {
    Edit soft = editOf(EditKind::kObjectKind);
    soft.object = start.objects[k].name;
    soft.object_kind = ObjectKind::kDeformable;
    world.submit(soft);
  }
  Edit lift = editOf(EditKind::kTransform);
  lift.object = start.objects[0].name;
  lift.translation = middle(1) - middle(0) + up * 0.5 * boundingDiagonal(start.objects[0].mesh);
  world.submit(lift);
}

double depthOfFirstInSecond(const WorldScene& start, const WorldState& state) {
  TriangleMesh under = start.objects[1].mesh;
  under.vertices = state.objects[1].vertices;
  const SurfaceTree tree(under);
  double depth = 0.0;
  for (const auto& vertex : state.objects[0].vertices.rowwise())
    if (const auto hit = tree.nearest(vertex.transpose(), 0.02))
      depth = std::max(depth, -hit->distance);
  return depth;
}

double lowestOver(const std::vector<SupportPlane>& planes, const WorldState& state) {
  double lowest = 1.0;
  for (const int k : {0, 1})
    for (const SupportPlane& plane : planes)
      lowest = std::min(
          lowest, ((state.objects[k].vertices * plane.normal).array() - plane.offset).minCoeff());
  return lowest;
}

double fastestBetween(const WorldState& before, const WorldState& after, double seconds) {
  double fastest = 0.0;
  for (const int k : {0, 1})
    fastest = std::max(
        fastest,
        (after.objects[k].vertices - before.objects[k].vertices).rowwise().norm().maxCoeff() /
            seconds);
  return fastest;
}

// The first object is let go over the second, both deformable.
std::vector<Result> drop(const Scene& scene, const YAML::Node& truth) {
  const WorldScene start = trueScene(scene, truth);
  WorldParams params;
  params.frame_period = 1.0 / scene.fps;
  World world(start, params);
  liftFirstOverSecond(start, -scene.gravity.normalized(), world);
  world.advanceTo(0.0);
  Run run;
  run.period = params.frame_period;
  run.play(world, 6.0);
  const WorldState end = world.state();
  run.play(world, params.frame_period);
  const double fastest = fastestBetween(end, world.state(), params.frame_period);
  const double depth = depthOfFirstInSecond(start, end);
  const double proximity = 0.02 * boundingDiagonal(start.objects[0].mesh);
  const double ratio = run.deepest / proximity, ms = run.msPerFrame();
  return {{"fastest vertex 6 s after " + start.objects[0].name + " was dropped on " +
               start.objects[1].name + ", m/s",
           fastest, 0.0, ratio, 0, ms},
          {"lowest vertex over the support, m", lowestOver(scene.planes, end), 0.0, ratio, 0, ms},
          {"depth of one in the other, m", depth, 0.0, depth / proximity, 0, ms}};
}

}  // namespace

std::vector<Result> sceneCase(const std::string& directory) {
  const Scene scene = loadScene(directory);
  const YAML::Node truth = YAML::LoadFile(directory + "/scene.yaml");
  std::vector<Result> results;
  for (size_t k = 0; k < scene.objects.size(); ++k)
    if (truth["objects"][k]["linear_velocity_com"]) {
      const auto part = follow(scene, truth, k);
      results.insert(results.end(), part.begin(), part.end());
    }
  if (results.empty() && scene.objects.size() >= 2) results = drop(scene, truth);
  if (results.empty())
    throw std::invalid_argument(directory +
                                ": nothing in it is thrown, and there are no two objects");
  return results;
}

}  // namespace calipso::fem
