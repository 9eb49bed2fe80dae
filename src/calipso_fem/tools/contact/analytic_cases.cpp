#include <cmath>

#include "contact_cases.hpp"

// Answers known in closed form.
namespace calipso::fem {
namespace {

using test::boxSurface;
using test::editOf;
using test::sceneWith;
using test::SoftScene;
using test::sphereSurface;

constexpr double kFriction = 0.5;

// Way a rigid block travels in one second on a slope of `angle` (rad).
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

// The same for a deformable block, stiff enough to slide like a rigid one.
double slideSoftly(double angle, Run& run) {
  const Eigen::Vector3d normal(std::sin(angle), 0.0, std::cos(angle));
  SoftScene scene;
  scene.surface.friction = kFriction;
  scene.addPlane(normal, 0.0);
  TriangleMesh block = boxSurface({0.2, 0.2, 0.1}, 4);
  block.vertices =
      block.vertices *
      Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitY()).toRotationMatrix().transpose();
  block.vertices.rowwise() += 0.05 * normal.transpose();
  SoftObject& soft = scene.addSoft(block, {1e7, 0.3, 1000.0, 0.01}, 0.05);
  const Eigen::Vector3d start = soft.body().momentum().center;
  const int steps = 60;
  for (int k = 0; k < steps; ++k) scene.step(1.0 / steps);
  run.deepest = scene.deepest();
  run.ms = scene.cpuMs();
  run.frames = 30;
  return (soft.body().momentum().center - start).norm();
}

std::vector<Result> slope(double (*slide)(double, Run&)) {
  std::vector<Result> results;
  for (const double factor : {0.99, 1.01, 1.3}) {
    Run run;
    const double angle = factor * std::atan(kFriction);
    Result r;
    r.quantity = "way in 1 s at " + std::to_string(factor) + " of the friction angle, m";
    r.reference = std::max(0.0, 0.5 * kG * (std::sin(angle) - kFriction * std::cos(angle)));
    r.value = slide(angle, run);
    r.ms_per_frame = run.msPerFrame();
    results.push_back(r);
  }
  return results;
}

// A block pushed along a plane at 2 m/s: way v^2 / 2 mu g and time v / mu g until it stands.
std::vector<Result> sliding() {
  const double v = 2.0;
  WorldScene scene = sceneWith(boxSurface({0.2, 0.2, 0.1}, 2), {0, 0, 0.05});
  Run run;
  run.period = 1.0 / 240.0;  // with which the stop is seen
  WorldParams params;
  params.frame_period = run.period;
  World world(scene, params);
  Edit push = editOf(EditKind::kVelocity);
  push.vector = {v, 0, 0};
  world.submit(push);
  world.advanceTo(0.0);
  double stopped = 0.0;
  run.play(world, 1.5, [&](const WorldState& s) {
    if (s.objects[0].kinetic_energy > 1e-6) stopped = s.time;
  });
  const double way = world.state().objects[0].world_from_object.translation().x();
  return {{"way of a block pushed at 2 m/s, m", way, v * v / (2 * kFriction * kG), 0, 0,
           run.msPerFrame()},
          {"time until it stands, s", stopped + 0.5 * run.period, v / (kFriction * kG), 0, 0,
           run.msPerFrame()}};
}

std::vector<Result> bounce() {
  std::vector<Result> results;
  for (const double e : {0.0, 0.3, 0.6, 0.9}) {
    WorldParams params;
    params.support.restitution = params.defaults.surface.restitution = e;
    World world(sceneWith(sphereSurface(0.1, 12, 16), {0, 0, 1.1}), params);
    const Eigen::Isometry3d pose(Eigen::Translation3d(0, 0, 1.1));
    world.addObservedMotion("thing",
                            {0.0, true, pose, {0, 0, 1.1}, {0, 0, 0}, {0, 0, 0}, {0, 0, -kG}});
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
  SoftScene scene;
  scene.addPlane(Eigen::Vector3d::UnitZ(), 0.0);
  SoftObject& soft = scene.addSoft(test::movedMesh(boxSurface({0.5, 0.5, 0.5}, 7), {0, 0, 0.251}),
                                   {1e5, 0.3, 1000.0, 0.02}, 0.5 / 7.0);
  for (int k = 0; k < 150; ++k) scene.step(kFrame);
  double sum = 0.0, depth = 0.0;
  for (const ContactPoint& c : scene.contacts().contacts()) {
    sum += c.force.z();
    depth = std::max(depth, c.depth);
  }
  return {{"sum of the contact forces of a block at rest, N", sum, soft.body().totalMass() * kG,
           depth / 5e-3, 0.0, scene.cpuMs() / 150}};
}

// Boussinesq: displacement at x (z into the half-space) by a normal force P at the origin.
Eigen::Vector3d boussinesq(const Eigen::Vector3d& x, double P, double E, double nu) {
  const double G = E / (2.0 * (1.0 + nu)), R = x.norm(), r = std::hypot(x.x(), x.y());
  const double c = P / (4.0 * M_PI * G);
  const double radial = c * (r * x.z() / (R * R * R) - (1.0 - 2.0 * nu) * r / (R * (R + x.z())));
  const double down = c * (x.z() * x.z() / (R * R * R) + 2.0 * (1.0 - nu) / R);
  return r > 0.0 ? Eigen::Vector3d(radial * x.x() / r, radial * x.y() / r, down)
                 : Eigen::Vector3d(0, 0, down);
}

// Paraboloid of a sphere's radius, open upwards, lowest point at the origin, outwards is down.
TriangleMesh sphereCap(double radius, double extent, int n) {
  TriangleMesh cap;
  cap.vertices.resize((n + 1) * (n + 1), 3);
  cap.triangles.resize(2 * n * n, 3);
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n; ++j) {
      const double x = extent * (2.0 * i / n - 1.0), y = extent * (2.0 * j / n - 1.0);
      cap.vertices.row(i * (n + 1) + j) << x, y,
          radius - std::sqrt(radius * radius - x * x - y * y);
    }
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const int a = i * (n + 1) + j, b = a + n + 1;
      cap.triangles.row(2 * (i * n + j)) << a, b + 1, b;
      cap.triangles.row(2 * (i * n + j) + 1) << a, a + 1, b + 1;
    }
  return cap;
}

// A rigid sphere pressed into a block whose sides follow the far field of an elastic half-space.
Result hertzWith(int cells) {
  const double L = 0.4, R = 0.5, depth = 4e-3, E = 1e5, nu = 0.3;
  const double force = 4.0 / 3.0 * E / (1.0 - nu * nu) * std::sqrt(R) * std::pow(depth, 1.5);
  SoftScene scene({5e-3, 200, 1e-8, 12, 1e-7});
  scene.gravity.setZero();
  scene.surface.friction = 0.0;
  SoftObject& soft = scene.addSoft(test::movedMesh(boxSurface({L, L, L}, cells), {0, 0, -0.5 * L}),
                                   {E, nu, 1000.0, 0.0}, L / cells);
  DeformableBody& body = soft.body();
  const double start = body.time(), press = 5.0;  // s
  for (int i = 0; i < body.nodeCount(); ++i) {
    const Eigen::Vector3d X = body.model().mesh().node(i);
    const double side = std::max({std::abs(X.x()), std::abs(X.y()), -0.5 * L - X.z()});
    if (side < 0.5 * L - 1e-9) continue;
    const Eigen::Vector3d u = boussinesq({X.x(), X.y(), -X.z()}, force, E, nu);
    for (int axis = 0; axis < 3; ++axis)
      body.prescribe(i, axis, [=](double t) {
        const double s = std::pow(std::min(1.0, (t - start) / press), 1.5);
        return s * (axis == 2 ? -u.z() : u[axis]);
      });
  }
  scene.addMoving(sphereCap(R, 0.08, 48), [&](double t) {
    return Eigen::Isometry3d(Eigen::Translation3d(0, 0, -depth * std::min(1.0, t / press)));
  });
  const int steps = 8;
  for (int k = 0; k < steps; ++k) scene.step(1.0);
  double sum = 0.0;
  for (const ContactPoint& c : scene.contacts().contacts()) sum -= c.force.z();
  return {"force on a sphere pressed 4 mm into a half-space, " + std::to_string(cells) +
              " cells a side, N",
          sum,
          force,
          scene.deepest() / 5e-3,
          0.0,
          scene.cpuMs() / steps};
}

std::vector<Result> hertz() { return {hertzWith(8), hertzWith(14), hertzWith(22)}; }

}  // namespace

Cases analyticCases() {
  return {{"slope", [] { return slope(slideOn); }},
          {"slope_soft", [] { return slope(slideSoftly); }},
          {"sliding", sliding},
          {"bounce", bounce},
          {"resting_block", restingBlock},
          {"hertz", hertz}};
}

}  // namespace calipso::fem
