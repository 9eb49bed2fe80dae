#include "calipso_render/surface_symmetry.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <random>

#include "calipso_render/stage.hpp"
#include "texture/mesh_topology.hpp"

namespace calipso::render {
namespace {

constexpr std::size_t kMirrorProbes = 300;
constexpr float kMirrorTolerance = 0.03f;  // of the surface's extent
constexpr float kMirrorPart = 0.95f;       // of the vertices that must find their image
// principal axes of nearly the same length: any axis between may be the one
constexpr float kAlike = 0.9f;
constexpr int kAnglesBetween = 12;  // tried there, over half a turn

// Part of a spread of vertices whose mirror image lies near some vertex.
float mirroredPart(const Points& vertices, const MirrorPlane& plane, float tolerance) {
  const std::size_t step = std::max<std::size_t>(1, vertices.size() / kMirrorProbes);
  int hits = 0, probes = 0;
  for (std::size_t i = 0; i < vertices.size(); i += step, ++probes) {
    const Eigen::Vector3f image = plane.point(vertices[i]);
    const bool near = std::any_of(vertices.begin(), vertices.end(), [&](const Eigen::Vector3f& p) {
      return (p - image).squaredNorm() < tolerance * tolerance;
    });
    hits += near;
  }
  return static_cast<float>(hits) / std::max(1, probes);
}

constexpr int kAxisTrials = 200;              // each with an axis through five normals
constexpr std::size_t kAxisTriangles = 2000;  // looked at
constexpr float kCrease = 0.85f;              // cosine between the normals of vertex and triangle
constexpr int kRefinements = 4;
constexpr float kAxisMiss = 0.015f;  // of the extent: how far a normal may pass by the axis
// sine between normal and axis; what faces along the axis says nothing
constexpr float kTurned = 0.25f;
constexpr float kAxisPart = 0.5f;  // of the area that says something, which must agree
constexpr float kAxisNear = 0.5f;  // of the extent: how far the axis may run from the middle

// A normal of the surface as a line, about the surface's middle and in units of its extent. A line
// (a, m) of direction a and moment m meets it where row . (m, a) = 0 (Pluecker coordinates).
struct NormalLine {
  Eigen::Vector3d normal, moment;
  double area = 0.0;

  Eigen::Matrix<double, 6, 1> row() const {
    Eigen::Matrix<double, 6, 1> r;
    r << normal, moment;
    return r;
  }
};

// Three per triangle, of the smooth surface that the mesh stands for: vertex normals count where
// they are no crease's.
std::vector<NormalLine> normalLines(const Points& vertices, const Triangles& triangles,
                                    const Eigen::Vector3f& middle, double extent) {
  const Points normals = vertexNormals(vertices, triangles);
  const std::size_t step = 1 + triangles.size() / kAxisTriangles;
  std::vector<NormalLine> lines;
  for (std::size_t i = 0; i < triangles.size(); i += step) {
    const Eigen::Vector3i& t = triangles[i];
    const Eigen::Vector3f across =
        (vertices[t[1]] - vertices[t[0]]).cross(vertices[t[2]] - vertices[t[0]]);
    if (!(across.norm() > 0.0f)) continue;
    const Eigen::Vector3f flat = across.normalized();
    const auto normalAt = [&](int k) -> Eigen::Vector3f {
      return normals[t[k]].dot(flat) > kCrease ? normals[t[k]] : flat;
    };
    for (int k = 0; k < 3; ++k) {
      const int next = (k + 1) % 3, last = (k + 2) % 3;
      const Eigen::Vector3d n =
          (4.0f * normalAt(k) + normalAt(next) + normalAt(last)).normalized().cast<double>();
      const Eigen::Vector3f p =
          (4.0f * vertices[t[k]] + vertices[t[next]] + vertices[t[last]]) / 6.0f;
      const Eigen::Vector3d x = (p - middle).cast<double>() / extent;
      lines.push_back({n, x.cross(n), across.norm()});
    }
  }
  return lines;
}

struct AxisLine {
  Eigen::Vector3d direction, moment;
};

// The line (m, a) made a proper one; nothing when it runs far off (as the common line of parallel
// normals does).
std::optional<AxisLine> axisLine(const Eigen::Matrix<double, 6, 1>& line) {
  const Eigen::Vector3d m = line.head<3>(), a = line.tail<3>();
  if (!(a.norm() * kAxisNear > m.norm())) return std::nullopt;
  const Eigen::Vector3d direction = a.normalized();
  const Eigen::Vector3d moment = m / a.norm();
  return AxisLine{direction, moment - direction * direction.dot(moment)};
}

// Whether a line agrees with the axis: 0 no, 1 yes, -1 it says nothing.
int agrees(const NormalLine& line, const AxisLine& axis) {
  const double turned = line.normal.cross(axis.direction).norm();
  if (turned < kTurned) return -1;
  return std::abs(line.normal.dot(axis.moment) + line.moment.dot(axis.direction)) <
         kAxisMiss * turned;
}

double agreeingPart(const std::vector<NormalLine>& lines, const AxisLine& axis) {
  double agreeing = 0.0, speaking = 0.0, all = 0.0;
  for (const NormalLine& line : lines) {
    const int agreed = agrees(line, axis);
    all += line.area;
    if (agreed >= 0) speaking += line.area;
    if (agreed > 0) agreeing += line.area;
  }
  return speaking > kTurned * all ? agreeing / speaking : 0.0;
}

// The line that those which agree with `axis` meet best.
std::optional<AxisLine> refined(const std::vector<NormalLine>& lines, const AxisLine& axis) {
  Eigen::Matrix<double, 6, 6> sum = Eigen::Matrix<double, 6, 6>::Zero();
  for (const NormalLine& line : lines) {
    if (agrees(line, axis) > 0) sum += line.area * line.row() * line.row().transpose();
  }
  return axisLine(
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>>(sum).eigenvectors().col(0));
}

}  // namespace

std::vector<MirrorPlane> mirrorPlanes(const Points& vertices, const Triangles& triangles) {
  // Middle and second moments of the surface, triangle by triangle.
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  double total = 0.0;
  for (const Eigen::Vector3i& t : triangles) {
    const Eigen::Vector3d a = vertices[t[0]].cast<double>(), b = vertices[t[1]].cast<double>(),
                          c = vertices[t[2]].cast<double>();
    const double area = 0.5 * (b - a).cross(c - a).norm();
    const Eigen::Vector3d sum = a + b + c;
    total += area, middle += area / 3.0 * sum;
    // Of all of the triangle, not of its middle: a box has two to a side.
    moments += area / 12.0 *
               (a * a.transpose() + b * b.transpose() + c * c.transpose() + sum * sum.transpose());
  }
  if (!(total > 0.0)) return {};
  middle /= total;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(moments / total -
                                                            middle * middle.transpose());
  std::vector<Eigen::Vector3d> normals;
  for (int k = 0; k < 3; ++k) normals.push_back(axes.eigenvectors().col(k));
  for (int k = 0; k < 2; ++k) {
    if (axes.eigenvalues()[k] < kAlike * axes.eigenvalues()[k + 1]) continue;
    for (int i = 1; i < kAnglesBetween; ++i) {
      const double angle = M_PI * i / kAnglesBetween;
      normals.push_back(std::cos(angle) * normals[k] + std::sin(angle) * normals[k + 1]);
    }
  }
  const float tolerance = kMirrorTolerance * boxOf(vertices).diagonal().norm();
  std::vector<MirrorPlane> tried;
  for (const Eigen::Vector3d& n : normals)
    tried.push_back({n.cast<float>(), static_cast<float>(n.dot(middle))});
  std::vector<float> mirrored(tried.size());
#pragma omp parallel for schedule(dynamic, 1)
  for (std::size_t i = 0; i < tried.size(); ++i)
    mirrored[i] = mirroredPart(vertices, tried[i], tolerance);
  std::vector<MirrorPlane> planes;
  for (std::size_t i = 0; i < tried.size(); ++i) {
    if (mirrored[i] >= kMirrorPart) planes.push_back(tried[i]);
  }
  return planes;
}

std::optional<Axis> revolutionAxis(const Points& vertices, const Triangles& triangles) {
  const Eigen::AlignedBox3f box = boxOf(vertices);
  const double extent = box.diagonal().norm();
  if (!(extent > 0.0)) return std::nullopt;
  const std::vector<NormalLine> lines = normalLines(vertices, triangles, box.center(), extent);
  if (lines.size() < 5) return std::nullopt;
  std::mt19937 random(1);
  std::vector<Eigen::Matrix<double, 5, 6>> rows(kAxisTrials);
  for (auto& five : rows) {
    for (int k = 0; k < 5; ++k) five.row(k) = lines[random() % lines.size()].row();
  }
  const auto partOf = [&](const std::optional<AxisLine>& axis) {
    return axis ? agreeingPart(lines, *axis) : 0.0;
  };
  std::vector<std::optional<AxisLine>> tried(kAxisTrials);
  std::vector<double> parts(kAxisTrials);
#pragma omp parallel for schedule(static)
  for (int i = 0; i < kAxisTrials; ++i) {
    tried[i] = axisLine(Eigen::FullPivLU<Eigen::Matrix<double, 5, 6>>(rows[i]).kernel().col(0));
    parts[i] = partOf(tried[i]);
  }
  std::optional<AxisLine> best;
  double best_part = 0.0;
  const auto consider = [&](const std::optional<AxisLine>& axis, double part) {
    if (part > best_part) best = axis, best_part = part;
  };
  for (int i = 0; i < kAxisTrials; ++i) consider(tried[i], parts[i]);
  for (int k = 0; k < kRefinements && best; ++k) {
    const std::optional<AxisLine> next = refined(lines, *best);
    consider(next, partOf(next));
  }
  if (best_part < kAxisPart) return std::nullopt;
  const Eigen::Vector3d point = best->direction.cross(best->moment) * extent;
  return Axis{box.center() + point.cast<float>(), best->direction.cast<float>()};
}

}  // namespace calipso::render
