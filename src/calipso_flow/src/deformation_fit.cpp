#include "calipso_flow/deformation_fit.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <set>

#include "calipso_scene/median.hpp"

namespace calipso::flow {
namespace {

constexpr int kSpringEnds = 48;  // surface points whose distances are kept
constexpr int kNeighbours = 5;   // springs per point
constexpr int kMostAnchors = 24;
constexpr double kAcross = 0.15;  // of a sheet's in-plane deviation: across the way to its hold
constexpr int kIterations = 6;
constexpr double kSettled = 2e-5;  // of the diagonal: a smaller step is the last

// Vertices spread over the surface: each the farthest from those before it.
std::vector<int> spreadVertices(const TriangleMesh& mesh, int count) {
  std::vector<int> chosen{0};
  Eigen::VectorXd distance =
      (mesh.vertices.rowwise() - mesh.vertices.row(0)).rowwise().squaredNorm();
  while (static_cast<int>(chosen.size()) < std::min(count, mesh.vertexCount())) {
    int next = 0;
    if (!(distance.maxCoeff(&next) > 0.0)) break;
    chosen.push_back(next);
    distance = distance.cwiseMin(
        (mesh.vertices.rowwise() - mesh.vertices.row(next)).rowwise().squaredNorm());
  }
  return chosen;
}

std::set<std::pair<int, int>> neighbourPairs(const DeformationField::Points& points) {
  std::set<std::pair<int, int>> pairs;
  const int count = static_cast<int>(points.rows());
  std::vector<int> order(count);
  for (int i = 0; i < count; ++i) {
    const Eigen::VectorXd distance = (points.rowwise() - points.row(i)).rowwise().squaredNorm();
    std::iota(order.begin(), order.end(), 0);
    const int last = std::min(count, kNeighbours + 1);
    std::partial_sort(order.begin(), order.begin() + last, order.end(), [&](int a, int b) {
      return std::make_pair(distance[a], a) < std::make_pair(distance[b], b);
    });
    for (int k = 1; k < last; ++k) pairs.insert(std::minmax(i, order[k]));
  }
  return pairs;
}

// Weight of a sheet's displacements within its plane. Bending shortens it towards what holds it;
// across that way it is held by its own shear, and hardly moves.
Eigen::Matrix3d inPlane(const ObjectModel& model, const Eigen::Vector3d& normal) {
  const Eigen::Matrix3d plane = Eigen::Matrix3d::Identity() - normal * normal.transpose();
  if (model.attached.empty()) return plane;
  Eigen::Vector3d way = model.mesh.vertices.colwise().mean().transpose();
  for (const int i : model.attached) way -= model.mesh.vertex(i) / model.attached.size();
  way = plane * way;
  if (way.norm() < 1e-3 * boundingDiagonal(model.mesh)) return plane;
  const Eigen::Vector3d across = normal.cross(way.normalized());
  return plane + (1.0 / (kAcross * kAcross) - 1.0) * across * across.transpose();
}

using Blocks = Eigen::Matrix<double, 9, Eigen::Dynamic>;

int blockIndex(int row, int column) { return row * (row + 1) / 2 + column; }

// Adds A (3 x 3) to the blocks of all pairs of functions with weight a and b.
template <class RowIterator>
void addBlocks(RowIterator first, const Eigen::Matrix3d& A, Blocks& blocks) {
  const Eigen::Map<const Eigen::Matrix<double, 9, 1>> flat(A.data());
  for (RowIterator i = first; i; ++i) {
    const Eigen::Matrix<double, 9, 1> weighted = i.value() * flat;
    for (RowIterator j = first; j; ++j) {
      if (j.index() > i.index()) break;
      blocks.col(blockIndex(i.index(), j.index())) += j.value() * weighted;
    }
  }
}

Eigen::Vector3d displacementOf(DeformationField::Weights::InnerIterator weight,
                               const Eigen::VectorXd& controls) {
  Eigen::Vector3d u = Eigen::Vector3d::Zero();
  for (; weight; ++weight) u += weight.value() * controls.segment<3>(3 * weight.index());
  return u;
}

}  // namespace

Eigen::MatrixXd DeformationFitter::Normal::matrix() const {
  const int size = static_cast<int>(right.size()) / 3;
  Eigen::MatrixXd full = Eigen::MatrixXd::Zero(right.size(), right.size());
  for (int i = 0; i < size; ++i) {
    for (int j = 0; j <= i; ++j) {
      full.block<3, 3>(3 * i, 3 * j) =
          Eigen::Map<const Eigen::Matrix3d>(blocks.col(blockIndex(i, j)).data());
    }
  }
  return full;
}

DeformationFitter::DeformationFitter(const ObjectModel& model, const DeformationParams& params)
    : params_(params),
      diagonal_(boundingDiagonal(model.mesh)),
      strain_(params.strain),
      world_from_object_(model.world_from_object),
      field_(model.mesh, params.spans) {
  chooseSprings(model.mesh);
  // Priors that are quadratic in the controls; the same for all three components.
  const double rough = params.roughness * diagonal_, innovation = params.innovation * diagonal_;
  Eigen::MatrixXd scalar = field_.roughness() / (rough * rough);
  scalar.diagonal().array() += 1.0 / (innovation * innovation);
  const std::vector<int>& attached = model.attached;
  const int stride = std::max<int>(1, attached.size() / kMostAnchors);
  DeformationField::Points anchors(attached.empty() ? 0 : (attached.size() - 1) / stride + 1, 3);
  for (int i = 0; i < anchors.rows(); ++i)
    anchors.row(i) = model.mesh.vertices.row(attached[i * stride]);
  const Eigen::MatrixXd w = field_.weightsAt(anchors);
  const double anchor = params.anchor * diagonal_;
  scalar += w.transpose() * w / (anchor * anchor);
  quadratic_ = Eigen::MatrixXd::Zero(3 * field_.size(), 3 * field_.size());
  for (int i = 0; i < field_.size(); ++i) {
    for (int j = 0; j < field_.size(); ++j) {
      for (int a = 0; a < 3; ++a) quadratic_(3 * i + a, 3 * j + a) = scalar(i, j);
    }
  }
  if (const auto normal = field_.sheetNormal()) {
    strain_ = params.sheet_strain;
    in_plane_ = inPlane(model, *normal);
  }
  quadratic_blocks_.resize(9, blockIndex(field_.size(), 0));
  for (int i = 0; i < field_.size(); ++i) {
    for (int j = 0; j <= i; ++j) {
      Eigen::Map<Eigen::Matrix3d>(quadratic_blocks_.col(blockIndex(i, j)).data()) =
          quadratic_.block<3, 3>(3 * i, 3 * j);
    }
  }
}

void DeformationFitter::chooseSprings(const TriangleMesh& mesh) {
  const std::vector<int> vertices = spreadVertices(mesh, kSpringEnds);
  DeformationField::Points ends(vertices.size(), 3);
  for (size_t i = 0; i < vertices.size(); ++i) ends.row(i) = mesh.vertices.row(vertices[i]);
  const DeformationField::Weights w = field_.weightsAt(ends);
  for (const auto& [i, j] : neighbourPairs(ends)) {
    Spring spring;
    spring.rest = (ends.row(i) - ends.row(j)).transpose();
    spring.weights = (w.row(i) - w.row(j)).transpose();
    // Ends that move as one, such as the faces of a sheet, have nothing to say.
    spring.weights.prune(1e-9);
    if (spring.weights.nonZeros() > 0) springs_.push_back(std::move(spring));
  }
}

DeformationField::Points DeformationFitter::displaced(const DeformationField::Points& points,
                                                      const DeformationField::Weights& weights,
                                                      const Eigen::VectorXd& controls) {
  const Eigen::Map<const DeformationField::Points> c(controls.data(), controls.size() / 3, 3);
  return points + weights * c;
}

std::vector<DeformationFitter::Residual> DeformationFitter::residuals(
    const std::vector<SurfaceMatch>& matches, const DeformationField::Weights& weights,
    const Camera& camera, const Eigen::VectorXd& controls) const {
  const Eigen::Isometry3d camera_from_object =
      camera.world_from_camera.inverse() * world_from_object_;
  std::vector<Residual> result(matches.size());
  for (size_t i = 0; i < matches.size(); ++i) {
    const SurfaceMatch& match = matches[i];
    Residual& r = result[i];
    const DeformationField::Weights::InnerIterator row(weights, i);
    const Eigen::Vector3d p = camera_from_object * (match.point + displacementOf(row, controls));
    const Eigen::Matrix2d covariance =
        match.covariance + params_.floor_px * params_.floor_px * Eigen::Matrix2d::Identity();
    r.information = covariance.inverse();
    if (p.z() <= 0.0) {
      r.value = {1e6, 1e6};
      r.jacobian.setZero();
    } else {
      r.value = camera.project(p) - match.pixel;
      r.jacobian = camera.projectJacobian(p) * camera_from_object.linear();
    }
    r.length = std::sqrt(r.value.dot(r.information * r.value));
  }
  return result;
}

DeformationFitter::Normal DeformationFitter::springNormal(const Eigen::VectorXd& controls) const {
  Normal normal{Blocks::Zero(9, quadratic_blocks_.cols()), Eigen::VectorXd::Zero(controls.size())};
  for (const Spring& spring : springs_) {
    Eigen::Vector3d d = spring.rest;
    for (Eigen::SparseVector<double>::InnerIterator w(spring.weights); w; ++w) {
      d += w.value() * controls.segment<3>(3 * w.index());
    }
    const double rest = spring.rest.norm(), length = d.norm();
    const double sigma = strain_ * rest;
    const Eigen::Vector3d g = d / std::max(length, 1e-9 * rest) / sigma;
    const double r = (length - rest) / sigma;
    addBlocks(Eigen::SparseVector<double>::InnerIterator(spring.weights),
              Eigen::Matrix3d(g * g.transpose()), normal.blocks);
    for (Eigen::SparseVector<double>::InnerIterator w(spring.weights); w; ++w) {
      normal.right.segment<3>(3 * w.index()) -= w.value() * r * g;
    }
  }
  return normal;
}

std::vector<Eigen::Matrix3d> DeformationFitter::inPlaneWeights(
    const Eigen::VectorXd& controls) const {
  std::vector<Eigen::Matrix3d> weights;
  if (!field_.sheetNormal()) return weights;
  for (int i = 0; i < field_.size(); ++i) {
    const double out = field_.sheetNormal()->dot(controls.segment<3>(3 * i));
    const double still = params_.in_plane * diagonal_, bent = params_.bent * out * out / diagonal_;
    weights.push_back(in_plane_ / (still * still + bent * bent));
  }
  return weights;
}

Eigen::MatrixXd DeformationFitter::sharedErrors(const Eigen::VectorXd& controls,
                                                const Eigen::VectorXd& predicted) const {
  Eigen::MatrixXd shared = Eigen::MatrixXd::Zero(controls.size(), 9);
  for (const Spring& spring : springs_) {
    Eigen::Vector3d d = spring.rest;
    for (Eigen::SparseVector<double>::InnerIterator w(spring.weights); w; ++w) {
      d += w.value() * controls.segment<3>(3 * w.index());
    }
    const Eigen::Vector3d e = spring.rest.normalized();
    // e . E e for an isotropic random strain E: diagonal entries with the strain's deviation, the
    // others with 1 / sqrt(2) of it.
    Eigen::Matrix<double, 1, 6> stretch;
    stretch << e.cwiseAbs2().transpose(),
        M_SQRT2 * Eigen::RowVector3d(e.y() * e.z(), e.x() * e.z(), e.x() * e.y());
    const Eigen::Vector3d g = d.normalized() / (strain_ * spring.rest.norm());
    for (Eigen::SparseVector<double>::InnerIterator w(spring.weights); w; ++w) {
      shared.block<3, 6>(3 * w.index(), 0) += w.value() * g * stretch;
    }
  }
  const std::vector<Eigen::Matrix3d> in_plane = inPlaneWeights(predicted);
  for (size_t i = 0; i < in_plane.size(); ++i) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(in_plane[i]);
    shared.block<3, 3>(3 * i, 6) =
        axes.eigenvectors() * axes.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
  }
  return shared;
}

void DeformationFitter::addPriors(const Eigen::VectorXd& controls, const Eigen::VectorXd& predicted,
                                  Normal& normal) const {
  normal.blocks += quadratic_blocks_;
  const std::vector<Eigen::Matrix3d> in_plane = inPlaneWeights(predicted);
  for (size_t i = 0; i < in_plane.size(); ++i) {
    Eigen::Map<Eigen::Matrix3d>(normal.blocks.col(blockIndex(i, i)).data()) += in_plane[i];
    normal.right.segment<3>(3 * i) -= in_plane[i] * controls.segment<3>(3 * i);
  }
  // The innovation's prior is about the prediction, not about zero.
  const double innovation = params_.innovation * diagonal_;
  normal.right += predicted / (innovation * innovation) - quadratic_ * controls;
}

Eigen::MatrixXd DeformationFitter::priorInformation() const {
  Normal normal = springNormal(zero());
  addPriors(zero(), zero(), normal);
  return Eigen::MatrixXd(normal.matrix().selfadjointView<Eigen::Lower>());
}

void DeformationFitter::addMatches(const DeformationField::Weights& weights,
                                   const std::vector<Residual>& residuals,
                                   const std::vector<double>& trust, Normal& normal) {
  for (size_t i = 0; i < residuals.size(); ++i) {
    if (trust[i] == 0.0) continue;
    const Residual& r = residuals[i];
    const Eigen::Matrix<double, 3, 2> weighted = trust[i] * r.jacobian.transpose() * r.information;
    const Eigen::Matrix3d A = weighted * r.jacobian;
    const Eigen::Vector3d b = weighted * r.value;
    const DeformationField::Weights::InnerIterator row(weights, i);
    addBlocks(row, A, normal.blocks);
    for (auto w = row; w; ++w) normal.right.segment<3>(3 * w.index()) -= w.value() * b;
  }
}

// Linearised about where the fit starts; the matches enter with what they are trusted.
class DeformationFitter::Iterations {
 public:
  Iterations(const DeformationFitter& fitter, const std::vector<SurfaceMatch>& matches,
             const Camera& camera, const Eigen::VectorXd& start, const Eigen::VectorXd& predicted)
      : fitter_(fitter),
        matches_(matches),
        camera_(camera),
        start_(start),
        predicted_(predicted),
        weights_(fitter.field_.weightsAt(pointsOf(matches))),
        springs_(fitter.springNormal(start)),
        spring_matrix_(springs_.matrix()),
        trust_(matches.size()) {
    observe(start);
  }

  void observe(const Eigen::VectorXd& controls) {
    found_ = fitter_.residuals(matches_, weights_, camera_, controls);
  }
  // Deviation of the matches, in units of what they say of themselves.
  double deviation() const {
    std::vector<double> lengths;
    for (const Residual& r : found_) lengths.push_back(r.length);
    // The median of a two-dimensional standard normal's length is 1.1774.
    return median(lengths) / 1.1774;
  }
  void trustWithin(double scale, double noise) {
    for (size_t i = 0; i < found_.size(); ++i) {
      const double ratio = scale * scale / (scale * scale + found_[i].length * found_[i].length);
      trust_[i] = ratio * ratio / (noise * noise);
    }
  }
  std::vector<bool> trustInliers(double noise) {
    std::vector<bool> inlier;
    for (size_t i = 0; i < found_.size(); ++i) {
      inlier.push_back(found_[i].length < fitter_.params_.inlier_sigma * noise);
      trust_[i] = inlier.back() ? 1.0 / (noise * noise) : 0.0;
    }
    return inlier;
  }
  // Distances along the surface change little within a frame: their springs are linearised once, at
  // c0, and pull with  right - H (c - c0)  elsewhere.
  Normal normalAt(const Eigen::VectorXd& controls) const {
    Normal normal = springs_;
    normal.right -= spring_matrix_.selfadjointView<Eigen::Lower>() * (controls - start_);
    fitter_.addPriors(controls, predicted_, normal);
    addMatches(weights_, found_, trust_, normal);
    return normal;
  }

 private:
  static DeformationField::Points pointsOf(const std::vector<SurfaceMatch>& matches) {
    DeformationField::Points points(matches.size(), 3);
    for (size_t i = 0; i < matches.size(); ++i) points.row(i) = matches[i].point.transpose();
    return points;
  }

  const DeformationFitter& fitter_;
  const std::vector<SurfaceMatch>& matches_;
  const Camera& camera_;
  const Eigen::VectorXd &start_, &predicted_;
  const DeformationField::Weights weights_;
  const Normal springs_;
  const Eigen::MatrixXd spring_matrix_;
  std::vector<Residual> found_;
  std::vector<double> trust_;
};

DeformationFit DeformationFitter::fit(const std::vector<SurfaceMatch>& matches,
                                      const Camera& camera, const Eigen::VectorXd& start,
                                      const Eigen::VectorXd& predicted, double scale) const {
  DeformationFit fit;
  fit.controls = start;
  if (static_cast<int>(matches.size()) < params_.least_inliers) return fit;
  Iterations iterations(*this, matches, camera, start, predicted);
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const double noise = std::max(1.0, iterations.deviation());
    scale = std::max(3.0 * noise, 0.4 * scale);
    iterations.trustWithin(scale, noise);
    const Normal normal = iterations.normalAt(fit.controls);
    const Eigen::LLT<Eigen::MatrixXd, Eigen::Lower> factor(normal.matrix());
    const Eigen::VectorXd step = factor.solve(normal.right);
    if (factor.info() != Eigen::Success || !step.allFinite()) return fit;
    fit.controls += step;
    iterations.observe(fit.controls);
    if (scale <= 3.01 * noise && step.cwiseAbs().maxCoeff() < kSettled * diagonal_) break;
  }
  fit.deviation = std::max(1e-9, iterations.deviation());
  fit.inlier = iterations.trustInliers(std::max(1.0, fit.deviation));
  fit.inliers = static_cast<int>(std::count(fit.inlier.begin(), fit.inlier.end(), true));
  if (fit.inliers < params_.least_inliers) return fit;
  const Eigen::LLT<Eigen::MatrixXd, Eigen::Lower> factor(
      iterations.normalAt(fit.controls).matrix());
  if (factor.info() != Eigen::Success) return fit;
  fit.covariance =
      factor.solve(Eigen::MatrixXd::Identity(fit.controls.size(), fit.controls.size()));
  fit.assumed = factor.solve(sharedErrors(fit.controls, predicted));
  fit.converged = fit.covariance.allFinite();
  return fit;
}

}  // namespace calipso::flow
