#include "repeat_case.hpp"

#include <cmath>

#include "calipso_flow/clip_dynamics.hpp"
#include "calipso_flow/rotation.hpp"
#include "film.hpp"
#include "json_entry.hpp"

namespace calipso::flow {
namespace {

constexpr int kFrames = 14;
constexpr double kFps = 30.0;
constexpr double kNoise = 4.0;           // grey levels
constexpr double kChiSquared95 = 7.815;  // three degrees of freedom

struct Throw {
  ObjectModel model;
  Camera camera;
  Eigen::Vector3d velocity{0.5, 0.25, 1.4}, spin{0.4, 0.8, -0.9}, gravity{0.0, 0.0, -9.81};

  Throw() {
    model.name = "box";
    model.index = 1;
    model.mesh = dividedBox({-0.15, -0.1, -0.12}, {0.15, 0.1, 0.12}, {3, 2, 2});
    model.world_from_object.linear() = rotationFromVector(Eigen::Vector3d(0.1, 0.2, 0.5));
    camera = lookingAt({0.1, -1.6, 0.2}, {0.1, 0.0, 0.0}, 320, 240, 380.0);
  }
  decltype(TriangleMesh::vertices) at(double t) const {
    const Eigen::Matrix3d R = rotationFromVector(spin * t) * model.world_from_object.linear();
    const Eigen::Vector3d p = velocity * t + 0.5 * t * t * gravity;
    return (model.mesh.vertices * R.transpose()).rowwise() + p.transpose();
  }
};

// How errors of three components compare with their covariances.
struct Calibration {
  int inside = 0;           // of 95 %
  double normalised = 0.0;  // squares in units of their variance, per component: 1 as stated
  void add(const Eigen::Vector3d& error, const Eigen::Matrix3d& covariance) {
    const double square = error.dot(covariance.ldlt().solve(error));
    inside += square < kChiSquared95;
    normalised += square / 3.0;
  }
};

ObjectDynamics analyseWithNoise(const Throw& box, const std::vector<cv::Mat>& clean, int seed) {
  cv::RNG rng(seed);
  const auto frame = [&](int k) {
    cv::Mat grain(clean[k].size(), CV_32F), picture;
    rng.fill(grain, cv::RNG::NORMAL, 0.0, kNoise);
    cv::add(clean[k], grain, picture, cv::noArray(), CV_8U);
    return makeFrame(k / kFps, picture, box.camera);
  };
  ClipAnalyser analyser(frame(0), {box.model}, {cv::Mat()}, box.gravity);
  for (int k = 1; k < kFrames; ++k) analyser.add(frame(k));
  return analyser.finish().front();
}

}  // namespace

std::vector<std::string> evaluateRepeats(int repeats) {
  const Throw box;
  std::vector<cv::Mat> clean;
  for (int k = 0; k < kFrames; ++k) {
    clean.push_back(film(box.model, box.at(k / kFps), box.camera, 0.0, 0));
  }
  Calibration velocity, spin;
  int gravity = 0, found = 0;
  double square = 0.0;
  for (int n = 0; n < repeats; ++n) {
    const ObjectDynamics dynamics = analyseWithNoise(box, clean, n + 1);
    const int middle = kFrames / 2;
    const MotionState& state = dynamics.motions[middle].state;
    const Eigen::Vector3d error = state.velocity - (box.velocity + middle / kFps * box.gravity);
    const Matrix6d covariance = state.twistCovariance();
    velocity.add(error, covariance.topLeftCorner<3, 3>());
    spin.add(state.spin - box.spin, covariance.bottomRightCorner<3, 3>());
    square += error.squaredNorm();
    if (!dynamics.trajectory.gravity) continue;
    ++found;
    const auto& g = *dynamics.trajectory.gravity;
    gravity += std::abs(g.acceleration.norm() - box.gravity.norm()) < 1.96 * g.deviation;
  }
  JsonEntry entry;
  entry.text("case", "filmed_repeats").text("object", "box").number("repeats", repeats);
  entry.number("velocity_covered_95", velocity.inside / double(repeats));
  entry.number("spin_covered_95", spin.inside / double(repeats));
  entry.number("gravity_covered_95", gravity / std::max(1.0, double(found)));
  entry.number("gravity_found", found / double(repeats));
  entry.number("velocity_normalised", velocity.normalised / repeats);
  entry.number("spin_normalised", spin.normalised / repeats);
  entry.number("velocity_rms_m_s", std::sqrt(square / repeats));
  return {entry.str()};
}

}  // namespace calipso::flow
