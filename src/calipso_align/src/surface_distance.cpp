#include "calipso_align/surface_distance.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace calipso::align {
namespace {

Eigen::Vector3d closestOnTriangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                  const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  // Regions of the triangle's plane, after Ericson, Real-Time Collision Detection, 5.1.5.
  const Eigen::Vector3d ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap), d3 = ab.dot(bp), d4 = ac.dot(bp), d5 = ab.dot(cp),
               d6 = ac.dot(cp);
  if (d1 <= 0 && d2 <= 0) return a;
  if (d3 >= 0 && d4 <= d3) return b;
  if (d6 >= 0 && d5 <= d6) return c;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + d1 / (d1 - d3) * ab;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + d2 / (d2 - d6) * ac;
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  }
  const double sum = va + vb + vc;
  return a + ab * (vb / sum) + ac * (vc / sum);
}

// Faces by the cells of a grid that their bounding boxes meet.
class FaceGrid {
 public:
  FaceGrid(const Points& x, const Triangles& triangles) : x_(x), triangles_(triangles) {
    constexpr double kCellsAcross = 40.0;
    const Eigen::Vector3d high = x.colwise().maxCoeff();
    low_ = x.colwise().minCoeff();
    cell_ = std::max((high - low_).maxCoeff() / kCellsAcross, 1e-300);
    for (int k = 0; k < 3; ++k) size_[k] = static_cast<int>((high - low_)[k] / cell_) + 1;
    start_.assign(static_cast<size_t>(size_.prod()) + 1, 0);
    eachCellOfFaces([&](int, size_t cell) { ++start_[cell + 1]; });
    for (size_t i = 1; i < start_.size(); ++i) start_[i] += start_[i - 1];
    faces_.resize(start_.back());
    std::vector<int> filled(start_.begin(), start_.end() - 1);
    eachCellOfFaces([&](int f, size_t cell) { faces_[filled[cell]++] = ballOf(f); });
  }

  double distance(const Eigen::Vector3d& p) const {
    const Eigen::Vector3i home = cellOf(p);
    const int rings = size_.maxCoeff();
    double best = std::numeric_limits<double>::max();
    std::vector<const Ball*> near;
    // Cells `ring` steps away are at least ring - 1 cells away.
    for (int ring = 0; ring < rings && best > (ring - 1) * cell_; ++ring) {
      const Eigen::Vector3i from = (home.array() - ring).cwiseMax(0),
                            to = (home.array() + ring).min(size_.array() - 1);
      for (int k = from[2]; k <= to[2]; ++k)
        for (int j = from[1]; j <= to[1]; ++j) {
          const bool whole_row = std::abs(k - home[2]) == ring || std::abs(j - home[1]) == ring;
          const int step = whole_row || ring == 0 ? 1 : 2 * ring;
          const int first = whole_row ? from[0] : home[0] - ring;
          for (int i = first; i <= to[0]; i += step)
            if (i >= 0) collect(p, cellIndex({i, j, k}), best, near);
        }
      for (const Ball* ball : near) {
        const double reach = best + ball->radius;
        if ((ball->centre - p).squaredNorm() > reach * reach) continue;
        const int f = ball->face;
        const Eigen::Vector3d q = closestOnTriangle(p, corner(f, 0), corner(f, 1), corner(f, 2));
        best = std::min(best, (q - p).norm());
      }
      near.clear();
    }
    return best;
  }

 private:
  struct Ball {  // around a face; its centre lies on the face
    Eigen::Vector3d centre;
    double radius;
    int face;
  };

  Eigen::Vector3i cellOf(const Eigen::Vector3d& p) const {
    const Eigen::Array3d at = ((p - low_) / cell_).array().floor();
    return at.max(0.0).min((size_.array() - 1).cast<double>()).cast<int>();
  }
  size_t cellIndex(const Eigen::Vector3i& c) const {
    return (static_cast<size_t>(c[2]) * size_[1] + c[1]) * size_[0] + c[0];
  }
  Eigen::Vector3d corner(int f, int k) const { return x_.row(triangles_(f, k)).transpose(); }

  template <class Action>
  void eachCellOfFaces(const Action& action) const {
    for (int f = 0; f < triangles_.rows(); ++f) {
      const Eigen::Vector3d a = corner(f, 0), b = corner(f, 1), c = corner(f, 2);
      const Eigen::Vector3i from = cellOf(a.cwiseMin(b).cwiseMin(c)),
                            to = cellOf(a.cwiseMax(b).cwiseMax(c));
      for (int k = from[2]; k <= to[2]; ++k)
        for (int j = from[1]; j <= to[1]; ++j)
          for (int i = from[0]; i <= to[0]; ++i) action(f, cellIndex({i, j, k}));
    }
  }

  Ball ballOf(int f) const {
    Ball ball{(corner(f, 0) + corner(f, 1) + corner(f, 2)) / 3.0, 0.0, f};
    for (int k = 0; k < 3; ++k)
      ball.radius = std::max(ball.radius, (corner(f, k) - ball.centre).norm());
    return ball;
  }

  // Faces that may be nearer than `best`, which their centres bring down meanwhile.
  void collect(const Eigen::Vector3d& p, size_t cell, double& best,
               std::vector<const Ball*>& near) const {
    for (int i = start_[cell]; i < start_[cell + 1]; ++i) {
      const Ball& ball = faces_[i];
      const double squared = (ball.centre - p).squaredNorm(), reach = best + ball.radius;
      if (squared > reach * reach) continue;
      near.push_back(&ball);
      if (squared < best * best) best = std::sqrt(squared);
    }
  }

  const Points& x_;
  const Triangles& triangles_;
  Eigen::Vector3d low_;
  double cell_;
  Eigen::Vector3i size_;
  std::vector<int> start_;  // of cell c: faces_[start_[c]] ... faces_[start_[c + 1] - 1]
  std::vector<Ball> faces_;
};

}  // namespace

std::vector<double> distancesToSurface(const Points& from, const Points& x,
                                       const Triangles& triangles) {
  const FaceGrid grid(x, triangles);
  std::vector<double> result(from.rows());
#pragma omp parallel for schedule(static)
  for (int i = 0; i < from.rows(); ++i) result[i] = grid.distance(from.row(i).transpose());
  return result;
}

}  // namespace calipso::align
