#include "hard_cases.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <ctime>
#include <functional>
#include <map>
#include <random>
#include <stdexcept>

namespace calipso::fem {
namespace {

constexpr double kPi = 3.14159265358979323846;

// One run: a clamped beam, what is done to it, and for how long.
struct Setup {
  explicit Setup(int across, double length = 1.0)
      : cells(4 * across, across, across),
        mesh(boxMesh({0, 0, 0}, length * Eigen::Vector3d(1.0, 0.25, 0.25), cells)) {}

  Eigen::Vector3i cells;
  VolumeMesh mesh;
  Material material{1e6, 0.3, 1000.0, 0.0};
  FemOptions options;
  double h = 1.0 / 30.0;
  int steps = 600, least_steps = 0;  // ends sooner when at rest
  bool clamped = true;
  std::function<void(DeformableBody*)> start = [](DeformableBody*) {};
  // May set `load`, the dead nodal forces (3n, N) the body is under from this step on.
  std::function<void(DeformableBody*, Vec* load, int)> before_step = [](DeformableBody*, Vec*,
                                                                        int) {};
};

double sizeOf(const VolumeMesh& mesh) {
  return (mesh.nodes.colwise().maxCoeff() - mesh.nodes.colwise().minCoeff()).norm();
}

// Moves every free node: rest position -> new position.
void deform(DeformableBody* body,
            const std::function<Eigen::Vector3d(const Eigen::Vector3d&)>& map) {
  Vec x = body->positions();
  for (int i = 0; i < body->nodeCount(); ++i)
    if (!body->isFixed(i)) x.segment<3>(3 * i) = map(body->model().mesh().node(i));
  body->setState(x, Vec::Zero(x.size()));
}

void stretch(DeformableBody* body) {
  deform(body, [](Eigen::Vector3d p) { return Eigen::Vector3d(3.0 * p.x(), p.y(), p.z()); });
}

void twist(DeformableBody* body) {
  const Eigen::Vector3d axis(0.0, 0.125, 0.125);
  deform(body, [axis](const Eigen::Vector3d& p) {
    return Eigen::Vector3d(
        Eigen::AngleAxisd(4.0 * kPi * p.x(), Eigen::Vector3d::UnitX()) * (p - axis) + axis);
  });
}

void squash(DeformableBody* body) {
  deform(body, [](Eigen::Vector3d p) { return Eigen::Vector3d(p.x(), 0.125, p.z()); });
}

// Every node anywhere in the body's box.
void scramble(DeformableBody* body) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  deform(body, [&](const Eigen::Vector3d&) {
    const double a = unit(random), b = unit(random), c = unit(random);
    return Eigen::Vector3d(a, 0.25 * b, 0.25 * c);
  });
}

// Every node off by up to one and a half cells along each axis: most cells are inside out.
void shake(DeformableBody* body, double cell) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> off(-1.5 * cell, 1.5 * cell);
  deform(body, [&](const Eigen::Vector3d& p) {
    const double x = off(random), y = off(random), z = off(random);
    return Eigen::Vector3d(p + Eigen::Vector3d(x, y, z));
  });
}

// The middle third is turned inside out along the beam.
void invert(DeformableBody* body) {
  deform(body, [](Eigen::Vector3d p) {
    if (p.x() > 0.34 && p.x() < 0.67) p.x() = 1.01 - p.x();
    return p;
  });
}

void stiffnessRatio(DeformableBody* body) {
  std::vector<Material> materials = body->model().cellMaterials();
  for (std::size_t c = 0; c < materials.size(); ++c)
    if (c / 4 % 2) materials[c].youngs_modulus *= 1e6;
  body->setCellMaterials(materials);
  deform(body, [](Eigen::Vector3d p) {
    return Eigen::Vector3d(p.x(), p.y() + 0.1 * p.x() * p.x(), p.z());
  });
}

void changeOnline(DeformableBody* body, Vec*, int step) {
  Material m{1e6, 0.3, 1000.0, 0.0};
  if (step == 20) body->setMaterial({1e3, 0.3, 1e6, 0.0});
  if (step == 40) body->setMaterial(m);
}

// At step 0 a dead load of 1000 times the weight on the end face, released at step 60.
void pullHard(DeformableBody* body, Vec* load, int step) {
  if (step != 0 && step != 60) return;
  Vec f = Vec::Zero(3 * body->nodeCount());
  std::vector<int> end;
  for (int i = 0; i < body->nodeCount(); ++i)
    if (body->model().mesh().nodes(i, 0) > 1.0 - 1e-9) end.push_back(i);
  for (int i : end) f[3 * i] = (step == 0 ? 1000.0 * 9.81 : 0.0) * body->totalMass() / end.size();
  body->setNodalForces(f);
  *load = f;
}

void bump(DeformableBody* body) {
  const double size = sizeOf(body->model().mesh());
  deform(body, [size](Eigen::Vector3d p) {
    p.y() += 0.3 * p.x() * p.x() / size;
    return p;
  });
}

// The time a body takes grows with its length: the same motion, at another scale.
Setup scaled(int across, double length) {
  Setup s(across, length);
  s.start = bump;
  s.h = length / 30.0;
  return s;
}

// Adrift and turning, without any force.
Setup adrift(int) {
  Setup s(1);
  s.mesh = boxMesh({0, 0, 0}, {0.3, 0.2, 0.1}, {3, 2, 1});
  s.clamped = false;
  s.steps = 10000;
  s.start = [](DeformableBody* body) {
    body->setTolerances(20, 1e-9, 1e-12);
    body->setRigidVelocity({0.1, -0.2, 0.05}, {0.0, 0.0, 1.0});
  };
  return s;
}

Setup almostEmptyCells(int across) {
  Setup s(across);
  for (int c = 0; c < s.mesh.cellCount(); ++c)
    if (c / s.cells.x() % across == across - 1) s.mesh.fraction[c] = 1e-4;
  s.start = stretch;
  return s;
}

const std::map<std::string, std::function<Setup(int)>>& setups() {
  static const auto with = [](auto change) {
    return [change](int across) {
      Setup s(across);
      change(&s);
      return s;
    };
  };
  static const std::map<std::string, std::function<Setup(int)>> kSetups = {
      {"stretched 3x", with([](Setup* s) { s->start = stretch; })},
      {"twisted by 720 degrees", with([](Setup* s) { s->start = twist; })},
      {"squashed flat", with([](Setup* s) { s->start = squash; })},
      {"every node off by 1.5 cells", with([](Setup* s) {
         s->start = [cell = 1.0 / s->cells.x()](DeformableBody* body) { shake(body, cell); };
       })},
      {"every node at random", with([](Setup* s) { s->start = scramble; })},
      {"inverted elements", with([](Setup* s) { s->start = invert; })},
      {"nu = 0.499", with([](Setup* s) {
         s->material.poissons_ratio = 0.499;
         s->start = stretch;
       })},
      {"stiffness ratio 1e6", with([](Setup* s) { s->start = stiffnessRatio; })},
      {"mass x 1000, E x 0.001 and back", with([](Setup* s) {
         s->start = bump;
         s->before_step = changeOnline;
         s->least_steps = 41;
       })},
      {"h = 0.2 s", with([](Setup* s) {
         s->h = 0.2;
         s->start = stretch;
       })},
      {"pulled by 1000 times its weight", with([](Setup* s) {
         s->before_step = pullHard;
         s->least_steps = 61;
       })},
      {"filled fraction 1e-4", almostEmptyCells},
      {"1 mm object", [](int across) { return scaled(across, 1e-3); }},
      {"100 m object", [](int across) { return scaled(across, 100.0); }},
      {"unconstrained for 10,000 steps", adrift},
  };
  return kSetups;
}

double largestDistance(const Vec& a, const Vec& b) {
  double largest = 0.0;
  for (Eigen::Index k = 0; k < a.size(); k += 3)
    largest = std::max(largest, (a.segment<3>(k) - b.segment<3>(k)).norm());
  return largest;
}

bool isAtRest(const DeformableBody& body, double h) {
  const VolumeMesh& mesh = body.model().mesh();
  const double near = 1e-4 * sizeOf(mesh);
  return largestDistance(body.positions(), restPositions(mesh)) < near &&
         body.isAtRest(near / (30.0 * h));
}

// Kinetic, elastic, and that of a dead load.
double totalEnergy(const DeformableBody& body, const Vec& load) {
  return body.kineticEnergy() + body.elasticEnergy() - load.dot(body.positions());
}

}  // namespace

std::vector<std::string> hardCaseNames() {
  std::vector<std::string> names;
  for (const auto& entry : setups()) names.push_back(entry.first);
  return names;
}

HardCaseResult runHardCase(const std::string& name, MaterialModel material, int across,
                           double most_cpu_seconds) {
  const auto it = setups().find(name);
  if (it == setups().end()) throw std::invalid_argument("hard case '" + name + "' is unknown");
  Setup s = it->second(across);
  s.options.material_model = material;
  DeformableBody body(s.mesh, s.material, s.options);
  for (int i = 0; s.clamped && i < body.nodeCount(); ++i)
    if (s.mesh.nodes(i, 0) == 0.0) body.fixNode(i);
  s.start(&body);
  HardCaseResult r;
  r.name = name;
  r.nodes = body.nodeCount();
  r.material = toString(material);
  r.h = s.h;
  Vec load = Vec::Zero(3 * body.nodeCount());
  const Momentum start = body.momentum();
  double largest = 0.0;
  const std::clock_t begin = std::clock();
  const auto seconds = [begin] {
    return static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  };
  for (; r.steps < s.steps && r.finite && seconds() < most_cpu_seconds; ++r.steps) {
    // What changes between two steps may change the energy; the step itself may not add any.
    s.before_step(&body, &load, r.steps);
    const double before = totalEnergy(body, load);
    const StepReport report = body.step(s.h);
    const double after = totalEnergy(body, load);
    r.finite = std::isfinite(after) && body.positions().allFinite();
    r.recovering_steps += report.recovering;
    r.unconverged_steps += !report.converged;
    largest = std::max({largest, std::abs(before), std::abs(after)});
    r.energy_growth = std::max(r.energy_growth, (after - before) / largest);
    if (s.clamped && r.steps >= s.least_steps && isAtRest(body, s.h)) break;
  }
  const double size = sizeOf(s.mesh);
  if (s.clamped) {
    r.displacement = largestDistance(body.positions(), restPositions(s.mesh)) / size;
  } else {
    const Momentum end = body.momentum();
    const double duration = r.steps * s.h;
    r.displacement =
        (end.center - start.center - duration * start.linear / body.totalMass()).norm() /
        (duration * start.linear.norm() / body.totalMass());
    r.momentum_error = std::max((end.linear - start.linear).norm() / start.linear.norm(),
                                (end.angular - start.angular).norm() / start.angular.norm());
  }
  r.recovered = r.finite && r.displacement < 1e-3 && r.momentum_error < 1e-6;
  return r;
}

}  // namespace calipso::fem
