#include "calipso_flow/deformation_motion.hpp"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <complex>

#include "calipso_flow/shading.hpp"
#include "calipso_scene/median.hpp"

namespace calipso::flow {
namespace {

using Vertices = decltype(TriangleMesh::vertices);

constexpr double kLeastTravelling = 0.1;  // a smaller share of travelling power is a standing wave
constexpr double kLeastPhase = 0.5;       // rad over the object's size
constexpr double kMostWaves = 3.0;        // over the object's size
constexpr double kClearTravel = 2.0;      // power of what goes forth over that of what goes back
constexpr double kLeastNoise = 1e-6;      // m
constexpr double kEnd = 0.05;             // of the extent along gravity: what counts as the end
constexpr double kLeftShare = 0.15;       // of the tracks that must have moved
constexpr int kLeastLeft = 6;
// of a track, which scatters by about twice its own account
constexpr double kLeftDeviations = 8.0;
constexpr double kRigidShare = 0.1;  // of the way: a clamped beam's bend leaves 0.17 and more
// by so much of their own account do rigid tracks scatter
constexpr double kRigidDeviations = 2.0;

// The series in which lines are sought: amplitudes of the modes and of the shading, each over its
// noise, so that a line is as strong as it stands out.
struct LineSeries {
  Eigen::MatrixXd values;      // T x (modes + shading)
  Eigen::VectorXd mode_noise;  // m

  LineSeries(const DeformationModes& modes, const Shading& shading)
      : values(modes.amplitudes.rows(), modes.count() + shading.count()),
        mode_noise(modes.count()) {
    for (int m = 0; m < modes.count(); ++m) {
      const double stated =
          std::sqrt(modes.deviations.col(m).squaredNorm() / modes.deviations.rows());
      mode_noise[m] = std::max({stated, noiseOf(modes.amplitudes.col(m)), kLeastNoise});
      values.col(m) = modes.amplitudes.col(m) / mode_noise[m];
    }
    values.rightCols(shading.count()) = shading.amplitudes / shading.noise;
  }
};

// Rows: two unit vectors within a sheet, object frame.
Eigen::Matrix<double, 2, 3> withinSheet(const Eigen::Vector3d& normal) {
  Eigen::Matrix<double, 2, 3> axes;
  axes.row(0) = normal.unitOrthogonal().transpose();
  axes.row(1) = normal.cross(normal.unitOrthogonal()).transpose();
  return axes;
}

// Where the crests of a sheet's line go as its shading shows it, rad/m, object frame; nothing where
// as much goes back as forth.
std::optional<Eigen::Vector3d> shadedTravel(const DeformableTracker& tracker,
                                            const Eigen::VectorXcd& shading_field) {
  const auto normal = tracker.fitter().field().sheetNormal();
  if (!normal || !(shading_field.norm() > 0.0)) return std::nullopt;
  const Eigen::Matrix<double, 2, 3> axes = withinSheet(*normal);
  const double diagonal = boundingDiagonal(tracker.model().mesh);
  const PlaneWave wave = planeWaveIn(tracker.points() * axes.transpose(), shading_field,
                                     kMostWaves * 2.0 * M_PI / diagonal);
  const bool travels =
      wave.power > kClearTravel * wave.opposite && wave.wave_vector.norm() * diagonal > kLeastPhase;
  if (!travels) return std::nullopt;
  return Eigen::Vector3d(axes.transpose() * wave.wave_vector);
}

// The same from the displacement of the surface.
std::optional<Eigen::Vector3d> displacementTravel(const DeformableTracker& tracker,
                                                  const Eigen::VectorXcd& shape) {
  const TriangleMesh& mesh = tracker.model().mesh;
  const CrestTravel travel = crestTravel(mesh, shape);
  const bool travels = travel.travelling > kLeastTravelling &&
                       travel.wave_vector.norm() * boundingDiagonal(mesh) > kLeastPhase;
  if (!travels) return std::nullopt;
  return travel.wave_vector;
}

// A solid's vibration is compared as the picture shows it, across the lines of sight: along them it
// is seen far worse, and what wanders there would be taken for a part of its shape.
Eigen::VectorXcd acrossSight(const DeformableTracker& tracker, const Eigen::VectorXcd& shape) {
  const ObjectModel& model = tracker.model();
  const Eigen::Vector3d eye = model.world_from_object.inverse() * tracker.keyCamera().translation();
  Eigen::VectorXcd across = shape;
  for (int i = 0; i < model.mesh.vertexCount(); ++i) {
    const Eigen::Vector3d sight = (model.mesh.vertex(i) - eye).normalized();
    const std::complex<double> along =
        sight.cast<std::complex<double>>().dot(shape.segment<3>(3 * i));
    across.segment<3>(3 * i) -= along * sight;
  }
  return across;
}

// @param line  of a LineSeries; its amplitudes become those of the modes
SurfaceLine onSurface(const DeformableTracker& tracker, const DeformationModes& modes,
                      const Shading& shading, const LineSeries& series, SpectralLine line,
                      Eigen::VectorXcd& shape) {
  const Eigen::VectorXcd field =
      shading.shapes.cast<std::complex<double>>() * line.amplitude.tail(shading.count());
  line.amplitude = series.mode_noise.cast<std::complex<double>>().cwiseProduct(
      line.amplitude.head(modes.count()).eval());
  SurfaceLine result;
  result.line = line;
  shape = modes.shapes.cast<std::complex<double>>() * line.amplitude;
  result.amplitude = std::sqrt(0.5 * shape.squaredNorm() * 3.0 / shape.size());
  auto travel = shadedTravel(tracker, field);
  if (!tracker.fitter().field().sheetNormal()) shape = acrossSight(tracker, shape);
  if (!travel) travel = displacementTravel(tracker, shape);
  if (travel) result.wave_vector = tracker.model().world_from_object.linear() * *travel;
  return result;
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

namespace {

// Only a standing vibration is the object's own. Whether a solid's is one its shape shows, which a
// mode of the model explains or not; a sheet's shape is seen badly, but its shading shows travel.
std::optional<StiffnessRatio> ownStiffness(const DeformableTracker& tracker,
                                           const SurfaceLine& line, const Eigen::VectorXcd& shape,
                                           std::string& note) {
  const bool sheet = tracker.fitter().field().sheetNormal().has_value();
  if (sheet && !line.wave_vector.isZero()) {
    note = "no stiffness from the vibration: its crests travel, so that it is driven";
    return std::nullopt;
  }
  return stiffnessRatio(tracker.model(), line.line, shape, note);
}

}  // namespace

DeformationMotion describeDeformation(const DeformableTracker& tracker,
                                      const std::vector<DeformationObservation>& observations,
                                      const Eigen::Vector3d& gravity, bool with_wind) {
  DeformationMotion motion;
  for (const DeformationObservation& o : observations) motion.times.push_back(o.time);
  motion.modes = modesOf(observations, tracker.vertexWeights());
  const DeformationModes& modes = motion.modes;
  if (modes.count() == 0) return motion;

  const Shading shading = shadingOf(observations);
  const LineSeries series(modes, shading);
  SpectrumParams params;
  params.noise = 1.0;
  const Spectrum spectrum =
      findLines(Eigen::Map<const Eigen::VectorXd>(motion.times.data(), motion.times.size()),
                series.values, params);
  for (const SpectralLine& line : spectrum.lines) {
    Eigen::VectorXcd shape;
    motion.lines.push_back(onSurface(tracker, modes, shading, series, line, shape));
    if (motion.lines.size() == 1) {
      motion.stiffness = ownStiffness(tracker, motion.lines[0], shape, motion.note);
    }
  }
  const ObjectModel& model = tracker.model();
  if (with_wind && tracker.fitter().field().sheetNormal()) {
    std::string note;
    motion.wind = estimateWind(model, motion.times, modes, gravity, note);
    if (!note.empty()) motion.note += (motion.note.empty() ? "" : "; ") + note;
  }
  motion.lean = leanOf(
      model,
      modes.surface(model.mesh, series.mode_noise.cwiseProduct(spectrum.mean.head(modes.count()))),
      gravity);
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

namespace {

// 3 x 3 size(): mean way of the vertices, world axes, by the controls.
Eigen::MatrixXd meanWayOf(const DeformableTracker& tracker) {
  const DeformationField::Weights& weights = tracker.vertexWeights();
  const Eigen::VectorXd mean =
      Eigen::VectorXd(weights.transpose() * Eigen::VectorXd::Ones(weights.rows())) /
      static_cast<double>(weights.rows());
  Eigen::MatrixXd B(3, 3 * mean.size());
  for (int m = 0; m < mean.size(); ++m) {
    B.block<3, 3>(0, 3 * m) = mean[m] * tracker.model().world_from_object.linear();
  }
  return B;
}

// Of a place or its velocity, and from it over the object's radius of the rotation or spin.
Matrix6d withTurn(const Eigen::Matrix3d& position, const TriangleMesh& mesh,
                  const Eigen::Vector3d& centroid) {
  const double squared_radius =
      (mesh.vertices.rowwise() - centroid.transpose()).rowwise().squaredNorm().mean();
  Matrix6d covariance = Matrix6d::Zero();
  covariance.topLeftCorner<3, 3>() = position;
  covariance.bottomRightCorner<3, 3>() =
      position.trace() / squared_radius * Eigen::Matrix3d::Identity();
  return covariance;
}

// 1/s, what takes the way that an assumed strain stands for to a velocity. Lengths along the
// surface go by the square of a bend, and so what they are wrong by at twice its pace; and no body
// is strained more than it moves over its size.
double paceOfStrain(const DeformationModes& modes, double strain, double diagonal) {
  const Eigen::MatrixXd about = modes.amplitudes.rowwise() - modes.amplitudes.colwise().mean();
  const double way = about.norm() / std::sqrt(static_cast<double>(about.rows()));  // m, rms
  const double speed = modes.velocities.norm() / std::sqrt(static_cast<double>(about.rows()));
  return way > 0.0 ? 2.0 * speed / std::max(way, strain * diagonal) : 0.0;
}

}  // namespace

Matrix6d assumedTwist(const DeformableTracker& tracker,
                      const std::vector<DeformationObservation>& observations,
                      const DeformationModes& modes, const Eigen::Vector3d& centroid) {
  const Eigen::MatrixXd B = meanWayOf(tracker);
  Eigen::Matrix3d position = Eigen::Matrix3d::Zero();
  int seen = 0;
  for (const DeformationObservation& o : observations) {
    if (!o.found || o.assumed.size() == 0) continue;
    const Eigen::MatrixXd way = B * o.assumed;
    position += way * way.transpose(), ++seen;
  }
  const TriangleMesh& mesh = tracker.model().mesh;
  const double pace = paceOfStrain(modes, tracker.fitter().strain(), boundingDiagonal(mesh));
  return withTurn(pace * pace / std::max(1, seen) * position, mesh, centroid);
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

  const Eigen::MatrixXd B = meanWayOf(tracker);
  const Eigen::Matrix3d position =
      observation.covariance.size() == 0
          ? Eigen::Matrix3d(1e-12 * Eigen::Matrix3d::Identity())
          : Eigen::Matrix3d(B * observation.covariance * B.transpose());
  rigid.covariance = withTurn(position, tracker.model().mesh, centroid);
  return rigid;
}

}  // namespace calipso::flow
