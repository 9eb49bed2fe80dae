#include "film.hpp"

#include <algorithm>
#include <calipso_fem/deformable_body.hpp>
#include <calipso_fem/modal_analysis.hpp>
#include <cmath>
#include <map>
#include <opencv2/imgproc.hpp>
#include <tuple>

#include "../src/sheet_simulation.hpp"
#include "calipso_flow/surface_view.hpp"

namespace calipso::flow {
namespace {

using Vertices = decltype(TriangleMesh::vertices);

constexpr double kFps = 30.0;
constexpr int kOver = 2;                // samples per pixel and direction
constexpr double kTextureStep = 0.045;  // m, wavelength scale of the texture
constexpr double kGustPeriod = 1.5;     // s
constexpr int kTruthBeamNodes = 3000;
constexpr int kSubsteps = 16;  // per frame: backward Euler shall not damp the beam

double textureAt(const Eigen::Vector3d& p) {
  const Eigen::Vector3d q = p / kTextureStep;
  return 128.0 + 40.0 * std::sin(5.1 * q.x() + 2.3 * q.z()) +
         35.0 * std::sin(6.3 * q.z() - 3.1 * q.x() + 1.0) +
         25.0 * std::sin(3.9 * q.x() - 4.7 * q.z() + 4.0 * q.y());
}

double wallAt(double u, double v) {
  return 120.0 + 25.0 * std::sin(0.21 * u) * std::cos(0.17 * v) + 0.05 * v;
}

Vertices reshaped(const Eigen::VectorXd& flat) {
  return Eigen::Map<const Vertices>(flat.data(), flat.size() / 3, 3);
}

std::vector<double> frameTimes(int frames) {
  std::vector<double> times;
  for (int k = 0; k < frames; ++k) times.push_back(k / kFps);
  return times;
}

}  // namespace

TriangleMesh dividedBox(const Eigen::Vector3d& low, const Eigen::Vector3d& high,
                        const Eigen::Vector3i& cells) {
  std::map<std::tuple<int, int, int>, int> index;
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Eigen::Vector3i> triangles;
  const auto vertexAt = [&](const Eigen::Vector3i& g) {
    const auto [at, added] =
        index.try_emplace({g.x(), g.y(), g.z()}, static_cast<int>(vertices.size()));
    if (added) {
      const Eigen::Vector3d share = g.cast<double>().cwiseQuotient(cells.cast<double>());
      vertices.push_back(low + share.cwiseProduct(high - low));
    }
    return at->second;
  };
  for (int axis = 0; axis < 3; ++axis) {
    const int a = (axis + 1) % 3, b = (axis + 2) % 3;
    for (int end = 0; end < 2; ++end) {
      for (int i = 0; i < cells[a]; ++i) {
        for (int j = 0; j < cells[b]; ++j) {
          Eigen::Vector3i corner[4];
          for (int c = 0; c < 4; ++c) {
            corner[c][axis] = end * cells[axis];
            corner[c][a] = i + (c == 1 || c == 2), corner[c][b] = j + (c >= 2);
          }
          int v[4];
          for (int c = 0; c < 4; ++c) v[c] = vertexAt(corner[c]);
          if (end == 0) std::swap(v[1], v[3]);
          triangles.push_back({v[0], v[1], v[2]});
          triangles.push_back({v[0], v[2], v[3]});
        }
      }
    }
  }
  TriangleMesh mesh;
  mesh.vertices.resize(vertices.size(), 3);
  mesh.triangles.resize(triangles.size(), 3);
  for (size_t i = 0; i < vertices.size(); ++i) mesh.vertices.row(i) = vertices[i].transpose();
  for (size_t i = 0; i < triangles.size(); ++i) mesh.triangles.row(i) = triangles[i].transpose();
  return mesh;
}

Camera lookingAt(const Eigen::Vector3d& eye, const Eigen::Vector3d& target, int width, int height,
                 double focal_px) {
  Camera camera;
  camera.width = width, camera.height = height;
  camera.fx = camera.fy = focal_px;
  camera.cx = 0.5 * (width - 1), camera.cy = 0.5 * (height - 1);
  const Eigen::Vector3d z = (target - eye).normalized();
  const Eigen::Vector3d x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
  camera.world_from_camera.linear() << x, z.cross(x), z;
  camera.world_from_camera.translation() = eye;
  return camera;
}

cv::Mat film(const ObjectModel& model, const Vertices& moved, const Camera& camera,
             double noise_grey, uint64_t seed) {
  Camera fine = camera;
  fine.width *= kOver, fine.height *= kOver;
  fine.fx *= kOver, fine.fy *= kOver;
  fine.cx = kOver * (camera.cx + 0.5) - 0.5, fine.cy = kOver * (camera.cy + 0.5) - 0.5;
  const Eigen::Isometry3d camera_from_world = camera.world_from_camera.inverse();
  const Vertices in_camera = (moved * camera_from_world.linear().transpose()).rowwise() +
                             camera_from_world.translation().transpose();
  // Shifted, so that no point of the rest shape is (0, 0, 0), which stands for nothing.
  const Eigen::RowVector3d shift = Eigen::RowVector3d::Constant(100.0);
  const CarriedView view =
      carrySurface(model.mesh, fine, in_camera, model.mesh.vertices.rowwise() + shift);
  cv::Mat big(fine.height, fine.width, CV_32F);
  for (int v = 0; v < fine.height; ++v) {
    for (int u = 0; u < fine.width; ++u) {
      double grey = wallAt(u / double(kOver), v / double(kOver));
      if (view.window.contains({u, v})) {
        const cv::Vec3f p = view.position.at<cv::Vec3f>(v - view.window.y, u - view.window.x);
        if (p != cv::Vec3f())
          grey = textureAt(Eigen::Vector3d(p[0], p[1], p[2]) - shift.transpose());
      }
      big.at<float>(v, u) = static_cast<float>(grey);
    }
  }
  cv::Mat picture, result;
  cv::resize(big, picture, {camera.width, camera.height}, 0, 0, cv::INTER_AREA);
  cv::Mat grain(picture.size(), CV_32F);
  cv::RNG(seed).fill(grain, cv::RNG::NORMAL, 0.0, std::max(1e-9, noise_grey));
  cv::Mat(picture + grain).convertTo(result, CV_8U);
  return result;
}

ObjectDynamics analyseFilm(const ObjectModel& model, const Camera& camera, const Shapes& shapes,
                           const std::vector<double>& times, const Eigen::Vector3d& gravity,
                           double noise_grey) {
  const auto frame = [&](size_t k) {
    return makeFrame(times[k], film(model, shapes[k], camera, noise_grey, k + 1), camera);
  };
  ClipAnalyser analyser(frame(0), {model}, {cv::Mat()}, gravity);
  for (size_t k = 1; k < times.size(); ++k) analyser.add(frame(k));
  return analyser.finish().front();
}

FilmedSheet filmedSheet(const Eigen::Vector3d& wind, int frames, const SheetTruth& settings) {
  FilmedSheet sheet;
  sheet.model.name = "sheet";
  sheet.model.index = 1;
  const double half = 0.5 * settings.width;
  const int columns = static_cast<int>(std::lround(20.0 * settings.width)),
            rows = static_cast<int>(std::lround(20.0 * settings.height));
  sheet.model.mesh =
      dividedBox({-half, -0.002, -settings.height}, {half, 0.002, 0.0}, {columns, 1, rows});
  sheet.model.world_from_object.translation().z() = 1.8;
  for (int i = 0; i < sheet.model.mesh.vertexCount(); ++i) {
    const bool corner = std::abs(sheet.model.mesh.vertices(i, 0)) > half - 0.06;
    if (sheet.model.mesh.vertices(i, 2) > -0.02 && (corner || !settings.pegged))
      sheet.model.attached.push_back(i);
  }
  sheet.gravity = {0.0, 0.0, -9.81};
  sheet.camera = lookingAt({1.5, -1.6, 1.5}, {0.0, 0.05, 1.4}, 480, 360, 620.0);
  sheet.times = frameTimes(frames);
  const auto windAt = [&](double t) -> Eigen::Vector3d {
    return (1.0 + settings.gust * std::sin(2.0 * M_PI * t / kGustPeriod)) * wind;
  };
  sheet.wind.setZero();
  for (const double t : sheet.times) sheet.wind += windAt(t) / frames;
  SheetSettings simulated;
  simulated.nodes = settings.nodes, simulated.longest_step = settings.step,
  simulated.stiffness = settings.stiffness;
  SheetSimulation simulation(sheet.model, sheet.gravity, simulated);
  const int count = sheet.model.mesh.vertexCount();
  const Vertices rest =
      sheet.model.mesh.vertices.rowwise() + sheet.model.world_from_object.translation().transpose();
  for (const SurfaceVector& u :
       simulation.run(sheet.times, SurfaceVector::Zero(3 * count), windAt)) {
    sheet.shapes.push_back(rest + reshaped(u));
  }
  return sheet;
}

FilmedBeam filmedBeam(const BeamTruth& truth, int frames) {
  FilmedBeam beam;
  beam.stiffness_ratio = truth.stiffness_ratio;
  beam.model.name = "beam";
  beam.model.index = 1;
  beam.model.mesh = dividedBox({0.0, -0.04, -0.04}, {0.8, 0.04, 0.04}, {30, 3, 3});
  for (int i = 0; i < beam.model.mesh.vertexCount(); ++i) {
    if (beam.model.mesh.vertices(i, 0) < 1e-6) beam.model.attached.push_back(i);
  }
  beam.camera = lookingAt({0.5, -1.6, 0.3}, {0.4, 0.0, 0.0}, 480, 360, 700.0);
  beam.times = frameTimes(frames);
  Material material;
  material.youngs_modulus = truth.stiffness_ratio * material.density;
  material.damping = truth.damping;
  fem::FemOptions options;
  options.target_nodes = kTruthBeamNodes;
  options.has_anchor = true;
  options.threads = 1;
  fem::DeformableBody body(beam.model.mesh, material, options);
  body.fixSurfaceVertices(beam.model.attached);
  std::vector<int> fixed;
  for (const int node : body.nodesOfSurfaceVertices(beam.model.attached)) {
    for (int axis = 0; axis < 3; ++axis) fixed.push_back(3 * node + axis);
  }
  const fem::ModalResult modal =
      fem::naturalFrequencies(body.model(), fixed, 4, options.lumped_mass);
  beam.frequency = modal.frequencies[0];  // those of a square beam come in pairs
  beam.second_frequency = modal.frequencies[2];
  // Struck upwards: about the first mode's shape, with the tip at 1.5 cm of amplitude, and as much
  // of the second's as is asked for.
  Eigen::VectorXd velocity = Eigen::VectorXd::Zero(3 * body.nodeCount());
  for (int n = 0; n < body.nodeCount(); ++n) {
    const double x = body.positions()[3 * n] / 0.8;
    const double second = truth.second * x * x * (x - 0.783) / (1.0 - 0.783);
    if (!body.isFixed(n)) velocity[3 * n + 2] = 0.5 * x * x * (3.0 - x) + second;
  }
  velocity *= 0.015 * 2.0 * M_PI * beam.frequency;
  body.setState(body.positions(), velocity);
  for (int k = 0; k < frames; ++k) {
    for (int s = 0; k > 0 && s < kSubsteps; ++s) body.step(1.0 / kFps / kSubsteps);
    beam.shapes.push_back(reshaped(body.surfaceVertices()));
  }
  return beam;
}

}  // namespace calipso::flow
