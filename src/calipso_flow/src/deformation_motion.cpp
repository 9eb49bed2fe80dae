#include "calipso_flow/deformation_motion.hpp"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <complex>

namespace calipso::flow {
namespace {

using Vertices = decltype(TriangleMesh::vertices);

constexpr double kLeastTravelling = 0.1;  // a smaller share of travelling power is a standing wave
constexpr double kLeastPhase = 0.5;       // rad over the object's size
constexpr double kEnd = 0.05;             // of the extent along gravity: what counts as the end
constexpr double kLeftShare = 0.15;       // of the tracks that must have moved
constexpr int kLeastLeft = 6;
// of a track, which scatters by about twice its own account
constexpr double kLeftDeviations = 8.0;
constexpr double kRigidShare = 0.1;  // of the way: a clamped beam's bend leaves 0.17 and more
// by so much of their own account do rigid tracks scatter
constexpr double kRigidDeviations = 2.0;

SurfaceLine onSurface(const DeformableTracker& tracker, const DeformationModes& modes,
                      const SpectralLine& line, Eigen::VectorXcd& shape) {
  SurfaceLine result;
  result.line = line;
  shape = modes.shapes.cast<std::complex<double>>() * line.amplitude;
  result.amplitude = std::sqrt(0.5 * shape.squaredNorm() * 3.0 / shape.size());
  const TriangleMesh& mesh = tracker.model().mesh;
  const CrestTravel travel = crestTravel(mesh, shape);
  const bool travels = travel.travelling > kLeastTravelling &&
                       travel.wave_vector.norm() * boundingDiagonal(mesh) > kLeastPhase;
  if (travels) {
    result.wave_vector = tracker.model().world_from_object.linear() * travel.wave_vector;
  }
  return result;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + values.size() / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// How far the tracks' points are apart in the picture in two poses, px.
double medianWay(const std::vector<Track>& tracks, const Eigen::Isometry3d& from,
                 const Eigen::Isometry3d& to, const Camera& camera) {
  std::vector<double> way;
  for (const Track& track : tracks) {
    const Eigen::Vector3d start = from * track.point, end = to * track.point;
    way.push_back((camera.projectWorld(end) - camera.projectWorld(start)).norm());
  }
  return median(std::move(way));
}

Vertices inWorld(const ObjectModel& model, const Vertices& vertices) {
  return (vertices * model.world_from_object.linear().transpose()).rowwise() +
         model.world_from_object.translation().transpose();
}

}  // namespace

Eigen::Vector3d leanOf(const ObjectModel& model, const Vertices& mean_shape,
                       const Eigen::Vector3d& gravity) {
  const Eigen::Vector3d down = gravity.normalized();
  const Vertices shape = inWorld(model, mean_shape);
  const Eigen::VectorXd depth = shape * down;
  const double low = depth.maxCoeff(), high = depth.minCoeff(), end = kEnd * (low - high);
  Eigen::Vector3d held = Eigen::Vector3d::Zero();
  int held_count = 0;
  for (const int i : model.attached) held += shape.row(i).transpose(), ++held_count;
  for (int i = 0; held_count == 0 && i < shape.rows(); ++i) {
    if (depth[i] < high + end) held += shape.row(i).transpose();
  }
  if (held_count == 0) held_count = static_cast<int>((depth.array() < high + end).count());
  held /= held_count;
  // The free end is the one farther from what holds the object.
  const bool hangs = low - held.dot(down) > held.dot(down) - high;
  Eigen::Vector3d free = Eigen::Vector3d::Zero();
  int free_count = 0;
  for (int i = 0; i < shape.rows(); ++i) {
    const bool at_end = hangs ? depth[i] > low - end : depth[i] < high + end;
    if (at_end) free += shape.row(i).transpose(), ++free_count;
  }
  const Eigen::Vector3d way = free / free_count - held;
  return way - way.dot(down) * down;
}

DeformationMotion describeDeformation(const DeformableTracker& tracker,
                                      const std::vector<DeformationObservation>& observations,
                                      const Eigen::Vector3d& gravity, bool with_wind) {
  DeformationMotion motion;
  for (const DeformationObservation& o : observations) motion.times.push_back(o.time);
  motion.modes = modesOf(observations, tracker.vertexWeights());
  const DeformationModes& modes = motion.modes;
  if (modes.count() == 0) return motion;

  SpectrumParams params;
  params.noise = std::sqrt(modes.deviations.squaredNorm() / modes.deviations.size());
  const Spectrum spectrum =
      findLines(Eigen::Map<const Eigen::VectorXd>(motion.times.data(), motion.times.size()),
                modes.amplitudes, params);
  for (const SpectralLine& line : spectrum.lines) {
    Eigen::VectorXcd shape;
    motion.lines.push_back(onSurface(tracker, modes, line, shape));
    // Only a standing vibration is the object's own.
    const bool own = motion.lines.size() == 1 && motion.lines[0].wave_vector.isZero();
    if (own) motion.stiffness = stiffnessRatio(tracker.model(), line, shape, motion.note);
  }
  const ObjectModel& model = tracker.model();
  if (with_wind && tracker.fitter().field().sheetNormal()) {
    std::string note;
    motion.wind = estimateWind(model, motion.times, modes, gravity, note);
    if (!note.empty()) motion.note += (motion.note.empty() ? "" : "; ") + note;
  }
  motion.lean = leanOf(model, modes.surface(model.mesh, spectrum.mean), gravity);
  return motion;
}

bool hasLeft(const Observation& observation, const Eigen::Isometry3d& still_pose,
             const Camera& camera, double rest_px) {
  int left = 0;
  for (const Track& track : observation.tracks) {
    const Eigen::Vector3d p = camera.world_from_camera.inverse() * (still_pose * track.point);
    if (p.z() <= 0.0) continue;
    const double apart = (camera.project(p) - track.pixel).norm();
    if (apart > std::max(2.0 * rest_px, kLeftDeviations * track.deviation)) ++left;
  }
  return left >= std::max<double>(kLeastLeft, kLeftShare * observation.tracks.size());
}

bool movesRigidly(const std::vector<Observation>& observations, const Eigen::Isometry3d& still_pose,
                  const Camera& camera) {
  const Observation& last = observations.back();
  if (!last.found || last.tracks.empty() || last.deviation > kRigidDeviations) return false;
  std::vector<double> left_over;  // px
  for (const Track& track : last.tracks) {
    const Eigen::Vector3d moved = last.world_from_object * track.point;
    left_over.push_back((camera.projectWorld(moved) - track.pixel).norm());
  }
  double farthest = 0.0;  // px: a swing comes through its place again
  for (const Observation& observation : observations) {
    if (!observation.found) continue;
    const Eigen::Isometry3d& pose = observation.world_from_object;
    farthest = std::max(farthest, medianWay(last.tracks, still_pose, pose, camera));
  }
  return median(left_over) < kRigidShare * farthest;
}

Observation rigidPart(const DeformableTracker& tracker, const DeformationObservation& observation,
                      const Eigen::Vector3d& centroid) {
  Observation rigid;
  rigid.time = observation.time;
  rigid.found = observation.found;
  rigid.tracks = observation.tracks;
  rigid.deviation = observation.deviation;
  rigid.world_from_object = tracker.model().world_from_object;
  if (!observation.found) return rigid;
  // Kabsch over the vertices.
  const Vertices& from = tracker.model().mesh.vertices;
  const Vertices to = tracker.surfaceAt(observation.controls);
  const Eigen::RowVector3d mean_from = from.colwise().mean(), mean_to = to.colwise().mean();
  const Eigen::Matrix3d moment =
      (to.rowwise() - mean_to).transpose() * (from.rowwise() - mean_from);
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(moment, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  Eigen::Isometry3d moved = Eigen::Isometry3d::Identity();
  moved.linear() =
      svd.matrixU() * Eigen::Vector3d(1.0, 1.0, sign).asDiagonal() * svd.matrixV().transpose();
  moved.translation() = mean_to.transpose() - moved.linear() * mean_from.transpose();
  rigid.world_from_object = tracker.model().world_from_object * moved;

  // The mean displacement's covariance, and from it over the object's radius the rotation's.
  const Eigen::VectorXd mean =
      Eigen::VectorXd(tracker.vertexWeights().transpose() * Eigen::VectorXd::Ones(from.rows())) /
      static_cast<double>(from.rows());
  Eigen::MatrixXd B = Eigen::MatrixXd::Zero(3, observation.controls.size());
  for (int m = 0; m < mean.size(); ++m) {
    B.block<3, 3>(0, 3 * m) = mean[m] * tracker.model().world_from_object.linear();
  }
  const Eigen::Matrix3d position =
      observation.covariance.size() == 0
          ? Eigen::Matrix3d(1e-12 * Eigen::Matrix3d::Identity())
          : Eigen::Matrix3d(B * observation.covariance * B.transpose());
  const double radius =
      std::sqrt((from.rowwise() - centroid.transpose()).rowwise().squaredNorm().mean());
  rigid.covariance.topLeftCorner<3, 3>() = position;
  rigid.covariance.bottomRightCorner<3, 3>() =
      position.trace() / (radius * radius) * Eigen::Matrix3d::Identity();
  return rigid;
}

}  // namespace calipso::flow
