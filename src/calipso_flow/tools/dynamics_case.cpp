#include "dynamics_case.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <stdexcept>

#include "aligned_models.hpp"
#include "calipso_flow/clip_dynamics.hpp"
#include "calipso_scene/scene.hpp"
#include "deformation_errors.hpp"
#include "json_entry.hpp"
#include "throw_case.hpp"
#include "truth.hpp"

namespace calipso::flow {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

// Wall and processor time, ms.
struct Cost {
  double wall = 0.0, cpu = 0.0;
};

Cost now() {
  const std::chrono::duration<double, std::milli> wall =
      std::chrono::steady_clock::now().time_since_epoch();
  return {wall.count(), 1e3 * std::clock() / CLOCKS_PER_SEC};
}

void add(const Cost& since, int frames, Cost& cost) {
  const Cost end = now();
  cost.wall += (end.wall - since.wall) / frames;
  cost.cpu += (end.cpu - since.cpu) / frames;
}

cv::Mat readFrame(const Scene& scene, int k, int scale) {
  char name[512];
  std::snprintf(name, sizeof name, scene.frame_pattern.c_str(), k);
  const std::string path = scene.directory + "/" + name;
  cv::Mat picture = cv::imread(path, cv::IMREAD_COLOR);
  if (picture.empty()) throw std::runtime_error(path + " is no picture that can be read");
  if (scale > 1) cv::resize(picture, picture, {}, scale, scale, cv::INTER_CUBIC);
  return picture;
}

// The camera of a picture whose pixels were each divided into scale x scale.
Camera enlarged(Camera camera, int scale) {
  camera.width *= scale, camera.height *= scale;
  camera.fx *= scale, camera.fy *= scale;
  camera.cx = scale * (camera.cx + 0.5) - 0.5, camera.cy = scale * (camera.cy + 0.5) - 0.5;
  return camera;
}

constexpr double kPlacementOff = 0.05;

double meanDepth(const TriangleMesh& mesh, const Eigen::Isometry3d& camera_from_object) {
  double sum = 0.0;
  for (int i = 0; i < mesh.vertexCount(); ++i) sum += (camera_from_object * mesh.vertex(i)).z();
  return sum / mesh.vertexCount();
}

// The true surface grown about the camera until it has the rough placement's depth: the best that a
// fit to the picture can do while the depth is held.
ObjectModel heldAtDepth(const SceneObject& object, const Camera& camera, ObjectModel model) {
  const Eigen::Isometry3d camera_from_world = camera.world_from_camera.inverse();
  const double held =
      meanDepth(loadMesh(object.cad_path), camera_from_world * object.initial_world_from_object);
  const double factor = held / meanDepth(model.mesh, camera_from_world * model.world_from_object);
  const Eigen::Vector3d eye = camera.world_from_camera.translation();
  const Eigen::Vector3d sight = model.world_from_object.translation() - eye;
  // A rough placement is off by 5 % of the distance in any direction.
  model.position_covariance = kPlacementOff * kPlacementOff / 3.0 * sight * sight.transpose();
  model.mesh.vertices *= factor;
  model.world_from_object.translation() =
      eye + factor * (model.world_from_object.translation() - eye);
  return model;
}

// The same surface with the true object's frame, so that poses compare.
ObjectModel inFrame(const Eigen::Isometry3d& world_from_object, ObjectModel model) {
  const Eigen::Isometry3d change = world_from_object.inverse() * model.world_from_object;
  for (int i = 0; i < model.mesh.vertexCount(); ++i) {
    model.mesh.vertices.row(i) = (change * model.mesh.vertex(i)).transpose();
  }
  model.world_from_object = world_from_object;
  return model;
}

// @param aligned  of this object; read when `models` asks for it
ObjectModel modelOf(const Scene& scene, const SceneObject& object, const TrueObject& truth,
                    const std::string& models, const std::optional<AlignedModel>& aligned) {
  const Eigen::Isometry3d& pose = truth.world_from_object.front();
  if (aligned) return inFrame(pose, aligned->model);
  ObjectModel model;
  model.name = object.name;
  model.index = object.index;
  if (models == "true" || models == "held") {
    model.world_from_object = pose;
    model.mesh = loadMesh(truth.mesh_path);
    return models == "true" ? model : heldAtDepth(object, scene.camera, model);
  }
  model.mesh = loadMesh(models + "/" + object.name + ".obj");
  return inFrame(pose, model);
}

const Eigen::Vector3d& at(const std::vector<Eigen::Vector3d>& values, size_t k) {
  return values[std::min(k, values.size() - 1)];
}

// Frames over which the true motion is smooth: up to the first collision, or all.
size_t smoothFrames(const TrueObject& truth, const ObjectDynamics& dynamics) {
  if (truth.collisions.empty()) return dynamics.motions.size();
  size_t k = 0;
  while (k < dynamics.observations.size() &&
         dynamics.observations[k].time < truth.collisions.front().time) {
    ++k;
  }
  return k;
}

struct MotionErrors {
  double velocity_m = 0.0, velocity_percent = kNone, velocity_px = 0.0;
  double spin_percent = kNone, acceleration_percent = kNone;
  double covered = kNone;  // share of frames whose velocity lies inside its 95 % ellipsoid
  bool below_uncertainty = true;
};

// 95 % of a chi-squared variable with three degrees of freedom lie below this.
constexpr double kChiSquared95 = 7.815;

MotionErrors motionErrors(const Scene& scene, const TrueObject& truth,
                          const ObjectDynamics& dynamics) {
  MotionErrors errors;
  const size_t frames = smoothFrames(truth, dynamics);
  double error = 0.0, speed = 0.0, spin_error = 0.0, spin = 0.0, pixels = 0.0;
  int inside = 0;
  for (size_t k = 0; k < frames; ++k) {
    const ObjectMotion& motion = dynamics.motions[k];
    const Eigen::Vector3d v =
        truth.velocity.empty() ? Eigen::Vector3d::Zero() : at(truth.velocity, k);
    const Eigen::Vector3d w = truth.spin.empty() ? Eigen::Vector3d::Zero() : at(truth.spin, k);
    const Eigen::Vector3d difference = motion.state.velocity - v;
    const double depth = (scene.camera.world_from_camera.inverse() * motion.state.position).z();
    error += difference.squaredNorm();
    speed += v.squaredNorm();
    pixels += difference.norm() * scene.camera.fx / depth / scene.fps;
    spin_error += (motion.state.spin - w).squaredNorm();
    spin += w.squaredNorm();
    const Eigen::Matrix3d covariance = motion.state.twistCovariance().topLeftCorner<3, 3>();
    const bool covers = difference.dot(covariance.ldlt().solve(difference)) < kChiSquared95;
    inside += covers;
    if (truth.velocity.empty() && !covers) errors.below_uncertainty = false;
  }
  errors.velocity_m = std::sqrt(error / frames);
  errors.velocity_px = pixels / frames;
  errors.covered = static_cast<double>(inside) / frames;
  if (speed > 0.0) errors.velocity_percent = 100.0 * std::sqrt(error / speed);
  if (spin > 0.0) errors.spin_percent = 100.0 * std::sqrt(spin_error / spin);
  return errors;
}

// Per true collision the distance to the nearest estimated one, in frames; null when there is none.
std::vector<double> collisionErrors(const Scene& scene, const TrueObject& truth,
                                    const Trajectory& trajectory) {
  std::vector<double> errors;
  for (const TrueCollision& collision : truth.collisions) {
    double nearest = kNone;
    for (const Collision& found : trajectory.collisions) {
      const double error = scene.fps * (found.time - collision.time);
      if (std::isnan(nearest) || std::abs(error) < std::abs(nearest)) nearest = error;
    }
    errors.push_back(nearest);
  }
  return errors;
}

// Vertical, of the first impact; true impacts less than a frame apart, which no frame lies between,
// count as one.
double restitutionError(const Scene& scene, const TrueObject& truth, const Trajectory& trajectory) {
  if (truth.collisions.empty() || trajectory.collisions.empty()) return kNone;
  const Eigen::Vector3d up = -scene.gravity.normalized();
  const TrueCollision& t = truth.collisions.front();
  const TrueCollision* last = &t;
  for (const TrueCollision& next : truth.collisions) {
    if (next.time - last->time < 1.0 / scene.fps) last = &next;
  }
  const Collision& e = trajectory.collisions.front();
  const double real = -last->velocity_after.dot(up) / t.velocity_before.dot(up);
  const double found = -e.after.velocity.dot(up) / e.before.velocity.dot(up);
  return 100.0 * std::abs(found / real - 1.0);
}

// The paper's cue: the first frame at which the flow along gravity changes its sign, half a frame
// earlier. Error in frames against the first true collision.
double signChangeError(const Scene& scene, const TrueObject& truth,
                       const ObjectDynamics& dynamics) {
  if (truth.collisions.empty()) return kNone;
  const auto position = [&](size_t k) {
    const Observation& o = dynamics.observations[k];
    return o.world_from_object.translation().dot(scene.gravity.normalized());
  };
  for (size_t k = 2; k < dynamics.observations.size(); ++k) {
    const double before = position(k - 1) - position(k - 2), now = position(k) - position(k - 1);
    if (before <= 0.0 || now >= 0.0) continue;
    return k - 0.5 - scene.fps * truth.collisions.front().time;
  }
  return kNone;
}

double gravityError(const Scene& scene, const Trajectory& trajectory) {
  if (!trajectory.gravity) return kNone;
  return 100.0 * std::abs(trajectory.gravity->acceleration.norm() / scene.gravity.norm() - 1.0);
}

// One line per frame: estimate, its deviations and the truth, for plots.
void writeTrace(const std::string& folder, const Scene& scene, const TrueObject& truth,
                const ObjectDynamics& dynamics) {
  const std::string name = std::filesystem::path(scene.directory).filename().string();
  std::ofstream file(folder + "/" + name + "_" + dynamics.name + ".csv");
  file << "t,tracks,moving,x,y,z,vx,vy,vz,wx,wy,wz,ax,ay,az,sx,sy,sz,tvx,tvy,tvz,twx,twy,twz\n";
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  for (size_t k = 0; k < dynamics.motions.size(); ++k) {
    const ObjectMotion& m = dynamics.motions[k];
    const Eigen::Vector3d sigma = m.state.twistCovariance().diagonal().head<3>().cwiseSqrt();
    file << m.state.time << "," << m.tracks << "," << m.moving;
    for (const Eigen::Vector3d& v :
         {m.state.position, m.state.velocity, m.state.spin, m.state.acceleration, sigma,
          truth.velocity.empty() ? zero : at(truth.velocity, k),
          truth.spin.empty() ? zero : at(truth.spin, k)}) {
      file << "," << v.x() << "," << v.y() << "," << v.z();
    }
    file << "\n";
  }
  for (const Collision& c : dynamics.trajectory.collisions) {
    file << "# collision at " << c.time << " s +- " << c.time_deviation << ", speed "
         << c.before.velocity.transpose() << " -> " << c.after.velocity.transpose() << "\n";
  }
  for (const MotionPiece& piece : dynamics.trajectory.pieces) {
    file << "# piece from " << piece.start << " s, travel " << static_cast<int>(piece.travel)
         << ", turning " << static_cast<int>(piece.turning) << "\n";
  }
}

// Per frame, for all objects together.
struct Costs {
  Cost track, fit, wind;  // fit: without the search for the wind
};

std::string describe(const Scene& scene, const ObjectModel& model, const TrueObject& truth,
                     const ObjectDynamics& dynamics, const Costs& costs) {
  const MotionErrors errors = motionErrors(scene, truth, dynamics);
  const Trajectory& trajectory = dynamics.trajectory;
  const bool moving = std::any_of(dynamics.motions.begin(), dynamics.motions.end(),
                                  [](const ObjectMotion& m) { return m.moving; });
  JsonEntry entry;
  entry.text("case", std::filesystem::path(scene.directory).filename().string());
  entry.text("object", dynamics.name).flag("moving", moving);
  entry.number("velocity_error_percent", errors.velocity_percent);
  entry.number("velocity_error_px", errors.velocity_px);
  entry.number("velocity_error_m_s", errors.velocity_m);
  entry.number("angular_velocity_error_percent", errors.spin_percent);
  entry.number("g_error_percent", gravityError(scene, trajectory));
  entry.numbers("collision_errors_frames", collisionErrors(scene, truth, trajectory));
  entry.number("collisions_found", static_cast<double>(trajectory.collisions.size()));
  entry.number("sign_change_error_frames", signChangeError(scene, truth, dynamics));
  entry.number("restitution_error_percent", restitutionError(scene, truth, trajectory));
  addDeformationErrors(model, truth, dynamics, scene.gravity, entry);
  entry.null("endpoint_error_px");
  entry.number("covered_95", errors.covered);
  const bool still = truth.velocity.empty() && truth.vertices.empty();
  if (still) entry.flag("below_uncertainty", errors.below_uncertainty);
  const bool rigid = !dynamics.deformation && truth.world_from_object.size() > 1;
  if (rigid) addThrow(scene, model, truth, dynamics, entry);
  entry.number("width", scene.camera.width);
  entry.number("track_ms_frame", costs.track.wall).number("fit_ms_frame", costs.fit.wall);
  entry.number("track_cpu_ms_frame", costs.track.cpu).number("fit_cpu_ms_frame", costs.fit.cpu);
  entry.number("wind_ms_frame", costs.wind.wall).number("wind_cpu_ms_frame", costs.wind.cpu);
  entry.number("cpu_ms_frame", costs.track.cpu + costs.fit.cpu + costs.wind.cpu);
  return entry.number("ms_frame", costs.track.wall + costs.fit.wall + costs.wind.wall).str();
}

}  // namespace

std::vector<std::string> evaluateScene(const std::string& directory,
                                       const DynamicsOptions& options) {
  Scene scene = loadScene(directory);
  std::vector<ObjectModel> object_models;
  std::vector<cv::Mat> masks;
  std::vector<TrueObject> truths;
  const int scale = options.scale;
  std::vector<std::optional<AlignedModel>> aligned(scene.objects.size());
  if (options.models == "aligned") {
    std::vector<AlignedModel> fits = alignedModels(scene);
    std::move(fits.begin(), fits.end(), aligned.begin());
  }
  for (size_t i = 0; i < scene.objects.size(); ++i) {
    const SceneObject& object = scene.objects[i];
    const std::optional<TrueObject> truth = readTruth(directory, object.name);
    if (!truth) continue;
    object_models.push_back(modelOf(scene, object, *truth, options.models, aligned[i]));
    object_models.back().attached = verticesIn(object.attachments, object_models.back());
    masks.push_back(aligned[i] ? aligned[i]->mask
                    : truth->mask_path.empty()
                        ? cv::Mat()
                        : cv::imread(truth->mask_path, cv::IMREAD_GRAYSCALE));
    if (!masks.back().empty()) {
      cv::resize(masks.back(), masks.back(), {}, scale, scale, cv::INTER_NEAREST);
    }
    truths.push_back(*truth);
  }
  if (truths.empty()) throw std::runtime_error(directory + " holds no truth to compare with");
  scene.camera = enlarged(scene.camera, scale);

  ClipAnalyser analyser(makeFrame(0.0, readFrame(scene, 0, scale), scene.cameraAt(0)),
                        object_models, masks, scene.gravity);
  Costs costs;
  for (int k = 1; k < scene.frame_count; ++k) {
    const cv::Mat picture = readFrame(scene, k, scale);
    const Cost start = now();
    analyser.add(makeFrame(k / scene.fps, picture, scene.cameraAt(k)));
    add(start, scene.frame_count, costs.track);
  }
  const Cost start = now();
  std::vector<ObjectDynamics> dynamics = analyser.finish(false);
  add(start, scene.frame_count, costs.fit);
  const bool deforms = std::any_of(dynamics.begin(), dynamics.end(), [](const ObjectDynamics& d) {
    return d.deformation.has_value();
  });
  if (deforms) {  // what the wind costs is what all of it costs more
    const Cost again = now();
    dynamics = analyser.finish(true);
    add(again, scene.frame_count, costs.wind);
    costs.wind.wall -= costs.fit.wall, costs.wind.cpu -= costs.fit.cpu;
  }
  std::vector<std::string> entries;
  for (size_t i = 0; i < dynamics.size(); ++i) {
    entries.push_back(describe(scene, object_models[i], truths[i], dynamics[i], costs));
    if (!options.trace.empty()) writeTrace(options.trace, scene, truths[i], dynamics[i]);
  }
  return entries;
}

}  // namespace calipso::flow
