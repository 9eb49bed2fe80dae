// Contact cases with known answers, on the simulator's own code. Without arguments all of them run;
// with arguments, those named. Prints one JSON object per result.
#include <chrono>
#include <cmath>
#include <functional>
#include <iostream>
#include <map>
#include <sstream>
#include <stdexcept>

#include "../test/world_fixtures.hpp"
#include "calipso_fem/world/soft_contacts.hpp"

namespace calipso::fem {
namespace {

using test::boxSurface;
using test::editOf;
using test::sceneWith;
using test::sphereSurface;

constexpr double kG = 9.81;
constexpr double kFrame = 1.0 / 30.0;  // s

struct Result {
  std::string quantity;
  double value = 0.0, reference = 0.0;
  double penetration_ratio = 0.0;  // largest depth over the minimal proximity distance
  double energy_growth = 0.0;      // of the total energy over its start
  double ms_per_frame = 0.0;
};

void print(const std::string& name, const Result& r) {
  const double scale = std::abs(r.reference) > 0.0 ? std::abs(r.reference) : 1.0;
  std::cout << "{\"case\": \"" << name << "\", \"quantity\": \"" << r.quantity
            << "\", \"value\": " << r.value << ", \"reference\": " << r.reference
            << ", \"rel_error\": " << std::abs(r.value - r.reference) / scale
            << ", \"max_penetration_ratio\": " << r.penetration_ratio
            << ", \"energy_growth\": " << r.energy_growth
            << ", \"ms_per_frame\": " << r.ms_per_frame << "}" << std::endl;
}

// Plays a world and keeps what every case wants to know.
struct Run {
  double deepest = 0.0, ms = 0.0;
  int frames = 0;
  void play(World& world, double seconds, const std::function<void(const WorldState&)>& look = {}) {
    const double start = world.time();
    for (int k = 1; k <= std::lround(seconds / kFrame); ++k) {
      world.advanceTo(start + k * kFrame);
      const WorldState state = world.state();
      for (const ContactPoint& c : state.contacts) deepest = std::max(deepest, c.depth);
      ms += state.step_ms;
      ++frames;
      if (look) look(state);
    }
  }
  double msPerFrame() const { return frames ? ms / frames : 0.0; }
};

// Way a block travels in one second on a slope of `angle` (rad) with friction 0.5.
double slideOn(double angle, Run& run) {
  const Eigen::Vector3d normal(std::sin(angle), 0.0, std::cos(angle));
  WorldScene scene = sceneWith(boxSurface({0.2, 0.2, 0.1}, 2), 0.05 * normal, false);
  scene.planes.push_back({"slope", normal, 0.0, std::nullopt});
  scene.objects[0].world_from_object.linear() =
      Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()).toRotationMatrix();
  World world(scene, {});
  world.submit(editOf(EditKind::kVelocity));
  world.advanceTo(0.0);
  const Eigen::Vector3d start = world.state().objects[0].world_from_object.translation();
  run.play(world, 1.0);
  return (world.state().objects[0].world_from_object.translation() - start).norm();
}

std::vector<Result> slope() {
  const double limit = std::atan(0.5);
  std::vector<Result> results;
  for (const double factor : {0.99, 1.01, 1.3}) {
    Run run;
    const double angle = factor * limit;
    Result r;
    r.quantity = "way in 1 s at " + std::to_string(factor) + " of the friction angle, m";
    r.reference = std::max(0.0, 0.5 * kG * (std::sin(angle) - 0.5 * std::cos(angle)));
    r.value = slideOn(angle, run);
    r.ms_per_frame = run.msPerFrame();
    results.push_back(r);
  }
  return results;
}

std::vector<Result> bounce() {
  std::vector<Result> results;
  for (const double e : {0.0, 0.3, 0.6, 0.9}) {
    WorldParams params;
    params.support.restitution = params.defaults.surface.restitution = e;
    World world(sceneWith(sphereSurface(0.1, 12, 16), {0, 0, 1.1}), params);
    world.addObservedMotion("thing", {0.0,
                                      true,
                                      Eigen::Isometry3d(Eigen::Translation3d(0, 0, 1.1)),
                                      {0, 0, 1.1},
                                      {0, 0, 0},
                                      {0, 0, 0},
                                      {0, 0, -kG}});
    world.submit(editOf(EditKind::kVelocity, EditMode::kEstimated));
    world.advanceTo(0.0);
    Run run;
    double highest = 0.0, before = 1.1;
    bool rising = false;
    run.play(world, 1.2, [&](const WorldState& s) {
      const double z = s.objects[0].world_from_object.translation().z();
      rising = rising || z > before;
      if (rising) highest = std::max(highest, z - 0.1);
      before = z;
    });
    // A parabola sampled 30 times a second misses its top by at most g (1/60)^2 / 2 = 1.4 mm.
    results.push_back({"height of the first bounce, e = " + std::to_string(e) + ", m", highest,
                       e * e, 0.0, 0.0, run.msPerFrame()});
  }
  return results;
}

std::vector<Result> restingBlock() {
  WorldParams params;
  params.max_nodes = 512;
  params.defaults.youngs_modulus = 1e5;
  World world(sceneWith(boxSurface({0.5, 0.5, 0.5}, 7), {0, 0, 0.251}), params);
  Edit softer = editOf(EditKind::kMaterial, EditMode::kFactor);
  softer.youngs_modulus = 0.5;
  world.submit(softer);
  world.advanceTo(0.0);
  Run run;
  run.play(world, 4.0);
  double sum = 0.0, depth = 0.0;
  const WorldState state = world.state();
  for (const ContactPoint& c : state.contacts) {
    sum += c.force.z();
    depth = std::max(depth, c.depth);
  }
  const double weight = world.plan()[0].mass * kG;
  return {{"sum of the contact forces of a block at rest, N", sum, weight, depth / 5e-3, 0.0,
           run.msPerFrame()}};
}

// Two soft cubes of 512 nodes fall on a plane and on each other.
std::vector<Result> twoCubes() {
  WorldParams params;
  params.max_nodes = 512;
  params.max_substeps = 1;
  params.proximity = 5e-3;
  params.defaults.youngs_modulus = 1e5;
  params.defaults.kind = ObjectKind::kDeformable;
  params.defaults.cell_size = 0.5 / 7.0;
  params.defaults.surface.friction = params.support.friction = 0.1;
  WorldScene scene = sceneWith(boxSurface({0.5, 0.5, 0.5}, 7), {0, 0, 0.5});
  scene.objects.push_back(scene.objects.front());
  scene.objects[1].name = "upper";
  scene.objects[1].world_from_object.translation() = Eigen::Vector3d(0.03, 0.02, 1.2);
  World world(scene, params);
  for (const std::string name : {"thing", "upper"}) {
    Edit heavy = editOf(EditKind::kGravity, EditMode::kFactor);
    heavy.object = name;
    heavy.factor = 2.0;  // both are afloat until gravity doubles: they fall with 1 g
    world.submit(heavy);
  }
  world.advanceTo(0.0);
  Run run;
  double lowest = 1.0, energy = 0.0, start = 0.0;
  run.play(world, 3.0, [&](const WorldState& s) {
    double total = 0.0;
    for (const ObjectSnapshot& o : s.objects) {
      lowest = std::min(lowest, o.vertices.col(2).minCoeff());
      total += o.kinetic_energy + o.elastic_energy + 125.0 * kG * o.vertices.col(2).mean();
    }
    if (start == 0.0) start = total;
    energy = std::max(energy, total / start - 1.0);
  });
  return {{"lowest vertex of two soft cubes, m", lowest, 0.0, run.deepest / params.proximity,
           energy, run.msPerFrame()}};
}

// A deformable block flying into another body, without gravity.
struct Collision {
  SoftObject a;
  SoftContacts contacts{{5e-3, 100, 1e-9, 4, 1e-6}};
  RigidWorld rigid;

  explicit Collision(const Eigen::Vector3d& velocity, const Eigen::Vector3d& position,
                     int cells = 4)
      : a(moved(boxSurface({0.2, 0.2, 0.2}, cells), position), {1e5, 0.3, 1000.0, 0.005},
          options(cells)) {
    a.body().setRigidVelocity(velocity, {0.0, 0.5, 0.2});
    a.changed();
  }
  static TriangleMesh moved(TriangleMesh mesh, const Eigen::Vector3d& by) {
    mesh.vertices.rowwise() += by.transpose();
    return mesh;
  }
  static FemOptions options(int cells) {
    FemOptions o;
    o.cell_size = 0.2 / cells;
    o.newton_tolerance = 1e-8;
    o.linear_tolerance = 1e-10;
    return o;
  }
};

std::vector<Result> softMeetsSoft() {
  Collision c({1.0, 0.0, 0.0}, {0, 0, 0});
  SoftObject b(Collision::moved(boxSurface({0.2, 0.2, 0.2}, 4), {0.25, 0.05, 0.03}),
               {1e5, 0.3, 1000.0, 0.005}, Collision::options(4));
  const std::vector<SoftEntry> softs = {{0, "a", {}, &c.a, false}, {1, "b", {}, &b, false}};
  const auto total = [&] {
    const Momentum p = c.a.body().momentum(), q = b.body().momentum();
    Eigen::Matrix<double, 6, 1> m;
    m << p.linear + q.linear,
        p.angular + q.angular + p.center.cross(p.linear) + q.center.cross(q.linear);
    return m;
  };
  const auto energy = [&] {
    return c.a.body().kineticEnergy() + c.a.body().elasticEnergy() + b.body().kineticEnergy() +
           b.body().elasticEnergy();
  };
  const auto before = total();
  const double e0 = energy();
  double growth = 0.0;
  int touches = 0;
  for (int k = 0; k < 60; ++k) {
    const auto obstacles = [&] {
      Obstacle oa, ob;
      oa.id = 0, oa.name = "a", oa.soft = &c.a, oa.tree = &c.a.tree();
      ob.id = 1, ob.name = "b", ob.soft = &b, ob.tree = &b.tree();
      return std::vector<Obstacle>{oa, ob};
    };
    c.contacts.pushOn(softs, obstacles(), c.rigid, 1.0 / 120.0);
    c.a.step(1.0 / 120.0);
    b.step(1.0 / 120.0);
    c.contacts.solve(softs, obstacles(), c.rigid, 1.0 / 120.0);
    touches += static_cast<int>(c.contacts.contacts().size());
    growth = std::max(growth, energy() / e0 - 1.0);
  }
  const auto after = total();
  if (touches == 0) throw std::runtime_error("the two blocks did not meet");
  return {{"linear momentum after two soft blocks collided, N s", after.head<3>().norm(),
           before.head<3>().norm(), 0, growth, 0},
          {"angular momentum after two soft blocks collided, N m s", after.tail<3>().norm(),
           before.tail<3>().norm(), 0, growth, 0}};
}

std::vector<Result> fastBlockOnThinPlate() {
  Collision c({0.0, 0.0, -50.0}, {0, 0, 0.5}, 11);
  const SurfaceTree plate(boxSurface({1.0, 1.0, 0.002}, 8));
  const std::vector<SoftEntry> softs = {{0, "block", {}, &c.a, false}};
  Obstacle o;
  o.id = 1, o.name = "plate", o.tree = &plate;
  double lowest = 1.0, ms = 0.0;
  for (int k = 0; k < 30; ++k) {
    const auto start = std::chrono::steady_clock::now();
    c.contacts.pushOn(softs, {o}, c.rigid, kFrame / 2);
    c.a.step(kFrame / 2);
    c.contacts.solve(softs, {o}, c.rigid, kFrame / 2);
    ms += std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
              .count() /
          15.0;
    lowest = std::min(lowest, c.a.vertices().col(2).mean());
  }
  return {{"lowest centre of a block dropped at 50 m/s on a plate at z = 0, above it, m",
           lowest > 0.0 ? 1.0 : 0.0, 1.0, 0, 0, ms}};
}

std::vector<Result> pileOfRigid() {
  WorldScene scene = sceneWith(boxSurface({0.1, 0.1, 0.1}, 1), {0, 0, 0.0505});
  const WorldObject first = scene.objects.front();
  scene.objects.clear();
  int id = 0;
  for (int row = 0; row < 10; ++row)
    for (int i = 0; i < 10 - row; ++i) {
      WorldObject o = first;
      o.name = "box" + std::to_string(id++);
      o.world_from_object.translation() =
          Eigen::Vector3d(0.12 * (i + 0.5 * row), 0, 0.06 + 0.11 * row);
      scene.objects.push_back(o);
    }
  World world(scene, {});
  for (const WorldObject& o : scene.objects) {
    Edit edit = editOf(EditKind::kGravity, EditMode::kFactor);
    edit.object = o.name;
    edit.factor = 2.0;
    world.submit(edit);
  }
  world.advanceTo(0.0);
  Run falling, resting;
  falling.play(world, 1.0);
  Run settle;
  settle.play(world, 6.0);
  resting.play(world, 0.5);
  return {
      {"55 boxes falling as a pyramid, ms per frame", falling.msPerFrame(), 15.0, 0, 0,
       falling.msPerFrame()},
      {"the same at rest, ms per frame", resting.msPerFrame(), 0.3, 0, 0, resting.msPerFrame()}};
}

const std::map<std::string, std::function<std::vector<Result>()>>& cases() {
  static const std::map<std::string, std::function<std::vector<Result>()>> all = {
      {"slope", slope},
      {"bounce", bounce},
      {"resting_block", restingBlock},
      {"two_cubes", twoCubes},
      {"soft_soft_momentum", softMeetsSoft},
      {"fast_block_thin_plate", fastBlockOnThinPlate},
      {"pyramid", pileOfRigid}};
  return all;
}

}  // namespace
}  // namespace calipso::fem

int main(int argc, char** argv) {
  using calipso::fem::cases;
  std::vector<std::string> names(argv + 1, argv + argc);
  if (names.empty())
    for (const auto& entry : cases()) names.push_back(entry.first);
  try {
    for (const std::string& name : names) {
      const auto found = cases().find(name);
      if (found == cases().end()) {
        std::string known;
        for (const auto& entry : cases()) known += " " + entry.first;
        throw std::invalid_argument("no contact case '" + name + "'; there are:" + known);
      }
      for (const auto& result : found->second()) calipso::fem::print(name, result);
    }
    return 0;
  } catch (const std::exception& error) {
    std::cerr << "evaluate_contact: " << error.what() << std::endl;
    return 1;
  }
}
