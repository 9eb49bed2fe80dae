#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "calipso_flow/deformation_field.hpp"
#include "calipso_flow/object_model.hpp"
#include "calipso_scene/camera.hpp"

namespace calipso::flow {

// Deviations of what is assumed about a deforming body, relative to its diagonal where lengths.
struct DeformationParams {
  int spans = 3;               // control intervals along the longest axis
  double strain = 0.03;        // of a distance between neighbouring surface points
  double sheet_strain = 0.04;  // the same of a thin sheet
  // Of a sheet's controls within its plane, and besides, which is second order in how far it has
  // left the plane, so many times the square of that over the diagonal: what swings on an arm as
  // long as the diagonal rises by half that square.
  double in_plane = 0.006, bent = 1.0;
  double roughness = 0.2;    // second difference of neighbouring controls
  double innovation = 0.05;  // of a control point, from the constant-velocity prediction
  double anchor = 1e-3;      // of a point that is attached
  double floor_px = 0.05;    // no track is better than this
  double inlier_sigma = 5.0;
  int least_inliers = 12;
};

// One surface point found in the picture.
struct SurfaceMatch {
  Eigen::Vector3d point;       // object frame, undeformed, m
  Eigen::Vector2d pixel;       // px
  Eigen::Matrix2d covariance;  // px^2; may be long in one direction
};

struct DeformationFit {
  Eigen::VectorXd controls;    // 3 size(): the field's coefficients, object frame, m
  Eigen::MatrixXd covariance;  // of controls, m^2, as if what is assumed erred everywhere anew
  // Of controls, m, 3 size() x 9: their way, each column a deviation, if what is assumed errs alike
  // over the whole body. However many points are found, this does not average out.
  Eigen::MatrixXd assumed;
  std::vector<bool> inlier;  // per match
  int inliers = 0;
  double deviation = 0.0;  // robust deviation of the residuals over their own, 1 = as expected
  bool converged = false;
};

// Fits a smooth deformation to points found in one picture. What the picture does not tell, mainly
// depth, comes from distances along the surface, which hardly change. Immutable once made.
class DeformationFitter {
 public:
  DeformationFitter(const ObjectModel& model, const DeformationParams& params);

  // @param start, predicted  controls: where the search begins and what the prior expects
  // @param scale  residuals up to this many deviations count fully at first
  DeformationFit fit(const std::vector<SurfaceMatch>& matches, const Camera& camera,
                     const Eigen::VectorXd& start, const Eigen::VectorXd& predicted,
                     double scale) const;

  const DeformationField& field() const { return field_; }
  double strain() const { return strain_; }  // deviation that is assumed of the body
  // What is known of the controls before any picture, about the shape in the key frame, 1/m^2.
  Eigen::MatrixXd priorInformation() const;
  Eigen::VectorXd zero() const { return Eigen::VectorXd::Zero(3 * field_.size()); }
  // Displaced points for given controls, object frame.
  static DeformationField::Points displaced(const DeformationField::Points& points,
                                            const DeformationField::Weights& weights,
                                            const Eigen::VectorXd& controls);

 private:
  struct Spring {
    Eigen::SparseVector<double> weights;  // of the difference of its ends
    Eigen::Vector3d rest;                 // m
  };
  // Normal equations: 3 x 3 blocks of the lower triangle of their matrix, each a column.
  struct Normal {
    Eigen::Matrix<double, 9, Eigen::Dynamic> blocks;
    Eigen::VectorXd right;
    Eigen::MatrixXd matrix() const;  // lower triangle
  };
  struct Residual {
    Eigen::Vector2d value;                 // px
    Eigen::Matrix<double, 2, 3> jacobian;  // by the point's displacement
    Eigen::Matrix2d information;
    double length;  // Mahalanobis
  };
  class Iterations;
  std::vector<Residual> residuals(const std::vector<SurfaceMatch>& matches,
                                  const DeformationField::Weights& weights, const Camera& camera,
                                  const Eigen::VectorXd& controls) const;
  // Of the springs, linearised at `controls`.
  Normal springNormal(const Eigen::VectorXd& controls) const;
  // Adds what is quadratic in the controls.
  void addPriors(const Eigen::VectorXd& controls, const Eigen::VectorXd& predicted,
                 Normal& normal) const;
  // Change of the normal equations' right side by one deviation of what is assumed: six strains of
  // the whole body and three shifts of a sheet within its plane. Columns of 3 size().
  Eigen::MatrixXd sharedErrors(const Eigen::VectorXd& controls,
                               const Eigen::VectorXd& predicted) const;
  // Of a sheet's controls within its plane, one each, 1/m^2; nothing of a solid's.
  // @param controls  that the sheet is about as bent as
  std::vector<Eigen::Matrix3d> inPlaneWeights(const Eigen::VectorXd& controls) const;
  // @param trust  weight of each match
  static void addMatches(const DeformationField::Weights& weights,
                         const std::vector<Residual>& residuals, const std::vector<double>& trust,
                         Normal& normal);
  void chooseSprings(const TriangleMesh& mesh);

  DeformationParams params_;
  double diagonal_;  // m
  double strain_;
  Eigen::Isometry3d world_from_object_;
  DeformationField field_;
  std::vector<Spring> springs_;
  Eigen::Matrix3d in_plane_ = Eigen::Matrix3d::Zero();  // directions that a sheet is held in
  Eigen::MatrixXd quadratic_;  // roughness, anchors and innovation: constant
  Eigen::Matrix<double, 9, Eigen::Dynamic> quadratic_blocks_;  // the same, as Normal's
};

}  // namespace calipso::flow
