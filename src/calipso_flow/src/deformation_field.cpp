#include "calipso_flow/deformation_field.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

namespace calipso::flow {
namespace {

constexpr double kSheet = 0.1;  // of the middle extent: a thinner object is a sheet
constexpr double kShort = 0.3;  // of the longest extent: shorter axes deform linearly

// Covariance of the surface about its centre, by the triangles' centres and areas.
Eigen::Matrix3d surfaceCovariance(const TriangleMesh& mesh) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  double total = 0.0;
  for (int t = 0; t < mesh.triangleCount(); ++t) {
    const Eigen::Vector3d a = mesh.vertex(mesh.triangles(t, 0));
    const Eigen::Vector3d b = mesh.vertex(mesh.triangles(t, 1));
    const Eigen::Vector3d c = mesh.vertex(mesh.triangles(t, 2));
    const double area = (b - a).cross(c - a).norm();
    const Eigen::Vector3d centre = (a + b + c) / 3.0;
    sum += area * centre;
    squares += area * centre * centre.transpose();
    total += area;
  }
  if (!(total > 0.0)) {
    throw std::invalid_argument("deformation field: the mesh has no surface; give triangles");
  }
  return squares / total - sum * sum.transpose() / (total * total);
}

// Volume over the area of one of its faces: of a sheet, however bent. An open surface has none.
double thickness(const TriangleMesh& mesh) {
  double area = 0.0;
  for (int t = 0; t < mesh.triangleCount(); ++t) {
    const Eigen::Vector3d a = mesh.vertex(mesh.triangles(t, 0));
    area +=
        0.5 *
        (mesh.vertex(mesh.triangles(t, 1)) - a).cross(mesh.vertex(mesh.triangles(t, 2)) - a).norm();
  }
  TriangleMesh centred = mesh;  // an open surface's volume depends on the origin
  centred.vertices.rowwise() -= mesh.vertices.colwise().mean();
  return std::abs(signedVolume(centred)) / (0.5 * area);
}

int controlCount(double extent, double longest, int spans) {
  if (extent < kShort * longest) return 2;
  return 3 + std::max(1, static_cast<int>(std::lround(spans * extent / longest)));
}

// Values of the functions along one axis that are not zero at t in [0, 1].
struct AxisWeights {
  int first = 0, count = 1;
  double value[4] = {1.0, 0.0, 0.0, 0.0};
};

AxisWeights axisWeights(double t, int controls) {
  AxisWeights w;
  if (controls == 1) return w;
  t = std::clamp(t, 0.0, 1.0);
  if (controls == 2) {
    w.count = 2;
    w.value[0] = 1.0 - t, w.value[1] = t;
    return w;
  }
  const int spans = controls - 3;
  w.first = std::min(static_cast<int>(t * spans), spans - 1);
  w.count = 4;
  const double s = t * spans - w.first, r = 1.0 - s;
  w.value[0] = r * r * r / 6.0;
  w.value[1] = (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0;
  w.value[2] = (3.0 * r * r * r - 6.0 * r * r + 4.0) / 6.0;
  w.value[3] = s * s * s / 6.0;
  return w;
}

}  // namespace

DeformationField::DeformationField(const TriangleMesh& mesh, int spans) {
  if (spans < 1) {
    throw std::invalid_argument("deformation field: " + std::to_string(spans) +
                                " spans; give at least 1");
  }
  axes_ = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(surfaceCovariance(mesh)).eigenvectors();
  const Points along = mesh.vertices * axes_;
  low_ = along.colwise().minCoeff().transpose();
  size_ = along.colwise().maxCoeff().transpose() - low_;
  for (int a = 0; a < 3; ++a) counts_[a] = controlCount(size_[a], size_.maxCoeff(), spans);
  int thin = 0;
  const double least = size_.minCoeff(&thin);
  const double middle = size_.sum() - least - size_.maxCoeff();
  // A bent sheet fills its box more than its thickness does: nothing changes across it.
  if (thickness(mesh) < kSheet * middle) {
    counts_[thin] = 1;
    sheet_normal_ = axes_.col(thin);
  }
}

DeformationField::Weights DeformationField::weightsAt(const Points& points) const {
  std::vector<Eigen::Triplet<double>> entries;
  for (int i = 0; i < points.rows(); ++i) {
    const Eigen::Vector3d along = axes_.transpose() * points.row(i).transpose() - low_;
    AxisWeights w[3];
    for (int a = 0; a < 3; ++a)
      w[a] = axisWeights(along[a] / std::max(size_[a], 1e-300), counts_[a]);
    for (int z = 0; z < w[2].count; ++z) {
      for (int y = 0; y < w[1].count; ++y) {
        for (int x = 0; x < w[0].count; ++x) {
          entries.emplace_back(i, index({w[0].first + x, w[1].first + y, w[2].first + z}),
                               w[0].value[x] * w[1].value[y] * w[2].value[z]);
        }
      }
    }
  }
  Weights weights(points.rows(), size());
  weights.setFromTriplets(entries.begin(), entries.end());
  return weights;
}

Eigen::MatrixXd DeformationField::roughness() const {
  Eigen::MatrixXd R = Eigen::MatrixXd::Zero(size(), size());
  const auto addDifference = [&](const std::vector<std::pair<int, double>>& terms) {
    for (const auto& [i, a] : terms) {
      for (const auto& [j, b] : terms) R(i, j) += a * b;
    }
  };
  for (int z = 0; z < counts_.z(); ++z) {
    for (int y = 0; y < counts_.y(); ++y) {
      for (int x = 0; x < counts_.x(); ++x) {
        const Eigen::Vector3i at(x, y, z);
        for (int a = 0; a < 3; ++a) {
          const Eigen::Vector3i one = Eigen::Vector3i::Unit(a);
          if (at[a] + 2 < counts_[a]) {
            addDifference({{index(at), 1.0}, {index(at + one), -2.0}, {index(at + 2 * one), 1.0}});
          }
          const Eigen::Vector3i other = Eigen::Vector3i::Unit((a + 1) % 3);
          if (at[a] + 1 < counts_[a] && at[(a + 1) % 3] + 1 < counts_[(a + 1) % 3]) {
            // The mixed derivative counts twice, as in the bending energy of a plate.
            const double twice = std::sqrt(2.0);
            addDifference({{index(at), twice},
                           {index(at + one), -twice},
                           {index(at + other), -twice},
                           {index(at + one + other), twice}});
          }
        }
      }
    }
  }
  return R;
}

}  // namespace calipso::flow
