#include <algorithm>
#include <cmath>
#include <sstream>

#include "contact_cases.hpp"

// What makes contact fail: speed, thinness, stacks, mass ratios, friction, overlap.
namespace calipso::fem {
namespace {

using test::boxSurface;
using test::movedMesh;
using test::SoftScene;

constexpr double kProximity = 5e-3;

// Steps a scene and keeps the largest gain of energy after `from` seconds over `scale` (J).
struct Watch {
  double scale = 1.0, from = 0.0;
  double highest_growth = 0.0, lowest_energy = 0.0;
  bool finite = true, started = false;

  void play(SoftScene& scene, double seconds, double h,
            const std::function<void(double)>& look = {}) {
    const int steps = static_cast<int>(std::lround(seconds / h));
    for (int k = 0; k < steps && finite; ++k) {
      scene.step(h);
      const double e = scene.energy();
      finite = std::isfinite(e);
      if (scene.time() >= from) {
        if (!started) lowest_energy = e;
        started = true;
        highest_growth = std::max(highest_growth, (e - lowest_energy) / scale);
        lowest_energy = std::min(lowest_energy, e);
      }
      if (look) look(scene.time());
    }
  }
};

Result resultOf(const std::string& quantity, double value, double reference, SoftScene& scene,
                const Watch& watch, double seconds) {
  return {quantity,
          watch.finite ? value : NAN,
          reference,
          scene.deepest() / kProximity,
          watch.highest_growth,
          scene.cpuMs() / (seconds / kFrame)};
}

double lowestVertex(SoftObject& soft) { return soft.vertices().col(2).minCoeff(); }

std::vector<Result> fastBlockOnThinPlate() {
  SoftScene scene;
  SoftObject& block = scene.addSoft(movedMesh(boxSurface({0.2, 0.2, 0.2}, 12), {0, 0, 0.5}),
                                    {1e5, 0.3, 1000.0, 0.005}, 0.2 / 12, {0, 0, -50});
  scene.addMoving(boxSurface({1.0, 1.0, 0.002}, 8),
                  [](double) { return Eigen::Isometry3d(Eigen::Translation3d(0, 0, -0.001)); });
  Watch watch;
  watch.scale = scene.energy();
  double lowest = 1.0;
  const double seconds = 0.1;  // it is there after 10 ms, and flattened in 20
  watch.play(scene, seconds, 1.0 / 60.0,
             [&](double) { lowest = std::min(lowest, lowestVertex(block)); });
  return {resultOf("lowest vertex of a block dropped at 50 m/s on a plate at z = 0, m", lowest, 0.0,
                   scene, watch, seconds)};
}

std::vector<Result> clothOnEdge() {
  SoftScene scene;
  scene.surface.friction = 0.6;
  TriangleMesh cloth = boxSurface({0.4, 0.4, 0.4}, 16);
  cloth.vertices.col(2) *= 0.01;
  SoftObject& soft =
      scene.addSoft(movedMesh(cloth, {0.02, 0, 0.006}), {2e5, 0.3, 300.0, 0.02}, 0.025);
  // A wedge whose edge carries it, along y.
  TriangleMesh box = boxSurface({0.2, 0.6, 0.2}, 6);
  box.vertices =
      box.vertices *
      Eigen::AngleAxisd(M_PI / 4, Eigen::Vector3d::UnitY()).toRotationMatrix().transpose();
  scene.addMoving(movedMesh(box, {0, 0, -0.1 * std::sqrt(2.0)}),
                  [](double) { return Eigen::Isometry3d::Identity(); });
  Watch watch;
  watch.scale = soft.body().totalMass() * kG * 0.1;
  watch.play(scene, 3.0, 1.0 / 60.0);
  // Nothing of it is inside the wedge |x| < -z.
  double deepest = 0.0;
  for (int v = 0; v < soft.vertices().rows(); ++v)
    deepest = std::max(deepest,
                       (-soft.vertices()(v, 2) - std::abs(soft.vertices()(v, 0))) / std::sqrt(2.0));
  return {
      resultOf("depth of a cloth in the edge it hangs over, m", deepest, 0.0, scene, watch, 3.0)};
}

// NOTE: a column of one piece buckles under its own weight above (7.84 E I / q)^(1/3): 1.4 m for
// these.
std::vector<Result> stackOfFive() {
  SoftScene scene;
  scene.surface.friction = 0.5;
  scene.addPlane(Eigen::Vector3d::UnitZ(), 0.0);
  for (int i = 0; i < 5; ++i)
    scene.addSoft(
        movedMesh(boxSurface({0.2, 0.2, 0.2}, 4), {0.005 * (i % 2), 0, 0.101 + 0.201 * i}),
        {5e5, 0.3, 500.0, 0.02}, 0.05);
  Watch watch;
  watch.scale = 5 * 4.0 * kG * 0.5;
  watch.play(scene, 60.0, kFrame);
  double leaning = 0.0, slowest = 0.0;
  for (int i = 0; i < 5; ++i) {
    const Eigen::Vector3d c = scene.soft(i).body().momentum().center;
    leaning = std::max(leaning, std::hypot(c.x() - 0.005 * (i % 2), c.y()));
    slowest = std::max(slowest, scene.soft(i).fastest());
  }
  return {resultOf("sideways way of five stacked soft blocks after 60 s, m", leaning, 0.0, scene,
                   watch, 60.0),
          resultOf("speed of the fastest of them then, m/s", slowest, 0.0, scene, watch, 60.0)};
}

// A heavy block lies on a light one of a thousandth of its density, both as stiff as needed to
// carry it. NOTE: with E = 2e5 the light one would buckle: a column of length L that carries its
// load P half as far again above its end holds up to P = z^2 E I / L^2, z tan z = 2, z = 1.077,
// less for its shearing: 620 N of the 785 N.
std::vector<Result> heavyOnLight() {
  constexpr double kLight = 1e6;  // Pa
  std::vector<Result> results;
  for (const bool rigid : {false, true}) {
    SoftScene scene;
    scene.addPlane(Eigen::Vector3d::UnitZ(), 0.0);
    SoftObject& light = scene.addSoft(movedMesh(boxSurface({0.2, 0.2, 0.2}, 4), {0, 0, 0.101}),
                                      {kLight, 0.3, 10.0, 0.02}, 0.05);
    const TriangleMesh heavy = boxSurface({0.2, 0.2, 0.2}, 4);
    if (rigid)
      scene.addRigid(heavy, 1e4, Eigen::Isometry3d(Eigen::Translation3d(0, 0, 0.303)));
    else
      scene.addSoft(movedMesh(heavy, {0, 0, 0.303}), {10.0 * kLight, 0.3, 1e4, 0.02}, 0.05);
    Watch watch;
    watch.scale = 80.0 * kG * 0.2;
    watch.play(scene, 4.0, 1.0 / 60.0);
    // Weight over area shortens the light one by m g / (E A) of its height, more where it bulges.
    const double height = light.vertices().col(2).maxCoeff() - lowestVertex(light);
    const double expected = 0.2 * (1.0 - 80.0 * kG / (kLight * 0.04));
    results.push_back(resultOf(std::string("height of a block under a thousandfold heavier ") +
                                   (rigid ? "rigid" : "soft") + " one, m",
                               height, expected, scene, watch, 4.0));
  }
  return results;
}

std::vector<Result> frictionExtremes() {
  struct Case {
    double mu, youngs_modulus, rate;  // Pa, 1/s
  };
  std::vector<Result> results;
  // The way of a soft block comes near the rigid one's as it becomes stiff.
  for (const auto& [mu, youngs_modulus, rate] : {Case{0.0, 1e6, 480.0}, Case{2.0, 1e6, 480.0},
                                                 Case{2.0, 1e7, 1920.0}, Case{2.0, 1e8, 1920.0}}) {
    SoftScene scene;
    scene.surface.friction = mu;
    scene.addPlane(Eigen::Vector3d::UnitZ(), 0.0);
    SoftObject& soft = scene.addSoft(movedMesh(boxSurface({0.2, 0.2, 0.1}, 4), {0, 0, 0.0501}),
                                     {youngs_modulus, 0.3, 1000.0, 0.01}, 0.05, {1, 0, 0});
    const double e0 = scene.energy();
    Watch watch;
    watch.scale = e0;
    watch.play(scene, 1.0, 1.0 / rate);  // it stands after 51 ms
    const double way = soft.body().momentum().center.x();
    // Without friction 1 m; with friction 2 the block stands after v^2 / 2 mu g if it does not tip.
    std::ostringstream what;
    what << "way of a block of " << youngs_modulus << " Pa at 1 m/s in 1 s, friction " << mu
         << ", m";
    results.push_back(
        resultOf(what.str(), way, mu == 0.0 ? 1.0 : 1.0 / (4.0 * kG), scene, watch, 1.0));
  }
  return results;
}

std::vector<Result> squeezed() {
  SoftScene scene;
  scene.gravity.setZero();
  scene.surface.friction = 0.3;
  SoftObject& soft = scene.addSoft(boxSurface({0.2, 0.2, 0.2}, 5), {1e5, 0.3, 1000.0, 0.02}, 0.04);
  const TriangleMesh plate = boxSurface({0.5, 0.5, 0.02}, 8);
  for (const double side : {1.0, -1.0})
    scene.addMoving(plate, [side](double t) {
      // Closes to half the height in a second, holds, opens at once.
      const double gap = t < 1.0 ? 0.2 - 0.1 * t : t < 1.5 ? 0.1 : 0.4;
      return Eigen::Isometry3d(Eigen::Translation3d(0, 0, side * (0.5 * gap + 0.0101)));
    });
  Watch watch;
  watch.from = 1.5 + 1e-9;
  double height = 0.0, most = 0.0;
  watch.play(scene, 1.5, 1.0 / 60.0, [&](double) {
    height = soft.vertices().col(2).maxCoeff() - soft.vertices().col(2).minCoeff();
    most = std::max(most, soft.body().elasticEnergy());
  });
  watch.scale = most;
  const double squeezed_height = height;
  watch.play(scene, 3.0, 1.0 / 60.0);
  // it has got some spin
  const Eigen::VectorXd along = soft.vertices() * soft.motion().linear().col(2);
  height = along.maxCoeff() - along.minCoeff();
  return {resultOf("height of a block squeezed between plates 0.1 m apart, m", squeezed_height,
                   0.1002, scene, watch, 4.5),
          resultOf("its height along its own axis 3 s after the plates have opened, m", height, 0.2,
                   scene, watch, 4.5)};
}

// Two blocks that overlap by 2 cm from the start are pushed apart without a kick.
std::vector<Result> overlapAtStart() {
  SoftScene scene;
  scene.gravity.setZero();
  SoftObject& a = scene.addSoft(boxSurface({0.2, 0.2, 0.2}, 4), {1e5, 0.3, 1000.0, 0.02}, 0.05);
  SoftObject& b = scene.addSoft(movedMesh(boxSurface({0.2, 0.2, 0.2}, 4), {0.18, 0.01, 0.02}),
                                {1e5, 0.3, 1000.0, 0.02}, 0.05);
  Watch watch;
  double fastest = 0.0;
  watch.play(scene, 2.0, 1.0 / 60.0, [&](double) {
    fastest = std::max({fastest, a.fastest(), b.fastest()});
  });
  double deepest = 0.0;
  for (int v = 0; v < a.vertices().rows(); ++v)
    if (const auto hit = b.tree().nearest(a.vertices().row(v).transpose(), 0.1))
      deepest = std::max(deepest, -hit->distance);
  return {resultOf("fastest vertex while overlapping blocks part, m/s", fastest, 0.0, scene, watch,
                   2.0),
          resultOf("their overlap after 2 s, m", deepest, 0.0, scene, watch, 2.0)};
}

}  // namespace

Cases hardCases() {
  return {{"fast_block_thin_plate", fastBlockOnThinPlate},
          {"cloth_on_edge", clothOnEdge},
          {"stack", stackOfFive},
          {"mass_ratio", heavyOnLight},
          {"friction_extremes", frictionExtremes},
          {"squeezed", squeezed},
          {"overlap_at_start", overlapAtStart}};
}

}  // namespace calipso::fem
