#include "calipso_render/surface_texture.hpp"

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <opencv2/core/hal/intrin.hpp>

#include "texture/mesh_topology.hpp"

namespace calipso::render {
namespace {

constexpr int kMostSteps = 512;   // texels along an edge
constexpr double kAnchor = 1e-4;  // pull towards the mean where nothing known is connected

std::size_t texelCount(int steps) { return static_cast<std::size_t>(steps + 1) * (steps + 2) / 2; }

float longestEdge(const Points& p, const Eigen::Vector3i& t) {
  return std::max(
      {(p[t[1]] - p[t[0]]).norm(), (p[t[2]] - p[t[1]]).norm(), (p[t[0]] - p[t[2]]).norm()});
}

// Vertices at one place are one: the first of them stands for all.
struct WeldedValues {
  std::vector<int> place, row;  // per vertex: who stands for it; its unknown, -1 if it has a value
  std::vector<cv::Vec3d> mean;  // per place
  cv::Vec3d mean_of_all;
  int rows = 0;

  WeldedValues(const Points& vertices, const std::vector<bool>& known,
               const std::vector<cv::Vec3f>& values)
      : place(weld(vertices)), row(vertices.size(), -1), mean(vertices.size()) {
    std::vector<int> parts(vertices.size(), 0);
    int all = 0;
    for (std::size_t i = 0; i < vertices.size(); ++i) {
      if (!known[i]) continue;
      mean[place[i]] += cv::Vec3d(values[i]), ++parts[place[i]];
      mean_of_all += cv::Vec3d(values[i]), ++all;
    }
    mean_of_all *= 1.0 / std::max(1, all);
    for (std::size_t i = 0; i < vertices.size(); ++i) {
      if (parts[i] > 0)
        mean[i] *= 1.0 / parts[i];
      else if (place[i] == static_cast<int>(i))
        row[i] = rows++;
    }
  }
};

// Graph Laplacian with a weak pull to the mean and one to the value far away. @return one row per
// unknown
Eigen::MatrixXd smoothValues(const WeldedValues& welded, const Points& vertices,
                             const Triangles& triangles, const std::optional<FarValues>& far) {
  std::vector<Eigen::Triplet<double>> entries;
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(welded.rows, 3);
  if (welded.rows == 0) return right;
  for (int r = 0; r < welded.rows; ++r) {
    entries.emplace_back(r, r, kAnchor);
    for (int c = 0; c < 3; ++c) right(r, c) = kAnchor * welded.mean_of_all[c];
  }
  const auto link = [&](int a, int b) {
    const int row = welded.row[a], other = welded.row[b];
    if (row < 0) return;
    // Two links along each of a vertex' six edges of length e stand for 3 e^2 times the Laplacian.
    const double e = (vertices[a] - vertices[b]).norm(),
                 pull = far ? 0.25 * e * e / (far->reach * far->reach) : 0.0;
    entries.emplace_back(row, row, 1.0 + pull);
    for (int c = 0; c < 3 && far; ++c) right(row, c) += pull * far->value[a][c];
    if (other >= 0)
      entries.emplace_back(row, other, -1.0);
    else
      for (int c = 0; c < 3; ++c) right(row, c) += welded.mean[b][c];
  };
  for (const Eigen::Vector3i& t : triangles) {
    for (int k = 0; k < 3; ++k) {
      const int a = welded.place[t[k]], b = welded.place[t[(k + 1) % 3]];
      if (a != b) link(a, b), link(b, a);
    }
  }
  Eigen::SparseMatrix<double> L(welded.rows, welded.rows);
  L.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(L);
  return solver.solve(right);
}

}  // namespace

SurfaceTexture::SurfaceTexture(const Points& vertices, const Triangles& triangles, float texel,
                               std::size_t most) {
  std::size_t count = 0;
  for (;; texel *= 1.4f) {
    steps_.clear(), count = 0;
    for (const Eigen::Vector3i& t : triangles) {
      steps_.push_back(
          std::clamp(static_cast<int>(std::ceil(longestEdge(vertices, t) / texel)), 1, kMostSteps));
      count += texelCount(steps_.back());
    }
    if (count <= most + 3 * triangles.size()) break;  // no triangle has fewer than three
  }
  spacing_ = texel;
  texels.assign(count, cv::Vec4f());
  count = 0;
  for (const int steps : steps_) first_.push_back(count), count += texelCount(steps);
}

Eigen::Vector3f SurfaceTexture::weightsOf(int triangle, std::size_t texel) const {
  const int n = steps_[triangle];
  int i = 0;
  while (texel >= static_cast<std::size_t>(n + 1 - i)) texel -= n + 1 - i, ++i;
  const float a = static_cast<float>(i) / n, b = static_cast<float>(texel) / n;
  return {a, b, std::max(0.0f, 1.0f - a - b)};
}

cv::Vec4f SurfaceTexture::at(int triangle, const Eigen::Vector3f& weights) const {
  const int n = steps_[triangle];
  const cv::Vec4f* grid = &texels[first_[triangle]];
  const float x = std::clamp(weights[0], 0.0f, 1.0f) * n,
              y = std::clamp(weights[1], 0.0f, 1.0f) * n;
  const int i = std::min(static_cast<int>(x), n - 1), j = std::min(static_cast<int>(y), n - 1 - i);
  float fx = x - i, fy = y - j;
  const auto times = [grid](std::size_t texel, float weight) {
    return cv::v_load(grid[texel].val) * cv::v_setall_f32(weight);
  };
  const std::size_t right = index(i + 1, j, n), below = index(i, j + 1, n);
  cv::Vec4f out;
  if (fx + fy <= 1.0f || i + j + 2 > n) {
    const float sum = std::max(1.0f, fx + fy);
    fx /= sum, fy /= sum;
    cv::v_store(out.val,
                times(index(i, j, n), 1.0f - fx - fy) + times(right, fx) + times(below, fy));
  } else {
    cv::v_store(out.val, times(index(i + 1, j + 1, n), fx + fy - 1.0f) + times(right, 1.0f - fy) +
                             times(below, 1.0f - fx));
  }
  return out;
}

void diffuseOverMesh(const Points& vertices, const Triangles& triangles,
                     const std::vector<bool>& known, std::vector<cv::Vec3f>& values,
                     const std::optional<FarValues>& far) {
  const WeldedValues welded(vertices, known, values);
  const Eigen::MatrixXd x = smoothValues(welded, vertices, triangles, far);
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (known[i]) continue;
    const int place = welded.place[i], r = welded.row[place];
    values[i] = r >= 0 ? cv::Vec3f(x(r, 0), x(r, 1), x(r, 2)) : cv::Vec3f(welded.mean[place]);
  }
}

}  // namespace calipso::render
