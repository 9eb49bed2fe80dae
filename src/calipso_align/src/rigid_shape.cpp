#include "calipso_align/rigid_shape.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "body_pose.hpp"
#include "calipso_align/layer_motion.hpp"
#include "calipso_align/mask_edge.hpp"
#include "calipso_align/silhouette.hpp"
#include "surface_motion.hpp"

namespace calipso::align {
namespace {

constexpr int kReachPx = 7;        // how far off the outline is looked for
constexpr float kDetailPx = 3.0f;  // where the mask is further off the model lacks what it shows

// Where along its normal a point of the outline is, as far as the evidence tells.
struct OutlineOffset {
  double mean = 0.0, variance = 0.0;  // px, px^2
};

// Posterior over the offset at which the object ends: the evidence of the pixels before it counts
// for the object, that of those beyond against it.
OutlineOffset offsetAlong(const cv::Mat& evidence, const Eigen::Vector2d& pixel,
                          const Eigen::Vector2d& normal, double expected) {
  constexpr int kCount = 2 * kReachPx + 1;
  constexpr float kMost = 3.0f;             // nats; of one pixel
  constexpr double kExpectedPx = 4.0;       // deviation of what was expected
  constexpr double kRounding = 1.0 / 12.0;  // px^2, of pixels
  double density[kCount + 1], sum = 0.0, most = -1e30;
  const auto offsetOf = [](int k) { return k - 0.5 * kCount; };
  for (int k = 0; k <= kCount; ++k) {
    const double off = (offsetOf(k) - expected) / kExpectedPx;
    density[k] = sum - 0.5 * off * off;
    most = std::max(most, density[k]);
    const Eigen::Vector2d q = pixel + (k - kReachPx) * normal;
    const cv::Point at(cvRound(q.x()), cvRound(q.y()));
    if (cv::Rect(cv::Point(), evidence.size()).contains(at))
      sum += std::clamp(evidence.at<float>(at), -kMost, kMost);
  }
  double total = 0.0;
  OutlineOffset offset;
  for (double& value : density) total += value = std::exp(value - most);
  for (int k = 0; k <= kCount; ++k) offset.mean += offsetOf(k) * density[k] / total;
  for (int k = 0; k <= kCount; ++k)
    offset.variance += std::pow(offsetOf(k) - offset.mean, 2) * density[k] / total;
  offset.variance += kRounding;
  return offset;
}

// What the outline says about a pose.
struct OutlineFit {
  StepEquations equations;
  int known = 0, met = 0;  // points
};

}  // namespace

struct RigidShape::State {
  State(const ModelSurface& model)
      : camera(model.camera),
        points(model.points),
        topology(model.triangles),
        pose{points.colwise().mean().transpose(), Eigen::Isometry3d::Identity()} {
    draw();
  }

  void draw() { view = renderDepth(transformed(pose.camera_from_key, points), topology, camera); }

  OutlineFit outlineFit(const cv::Mat& evidence, const cv::Mat& other, const cv::Rect& roi) const;

  Camera camera;
  Points points;  // key frame, camera's frame, m
  MeshTopology topology;
  BodyPose pose;
  DepthRendering view;                                         // at the pose
  Eigen::Isometry3d velocity = Eigen::Isometry3d::Identity();  // camera frame, per frame
  Eigen::Isometry3d before = Eigen::Isometry3d::Identity();    // the previous frame's pose
  cv::Mat details;   // CV_32F: the mask's signed distance less the silhouette's, px
  SurfaceLook look;  // of this frame
  double least_difference = 1.0, most_met = 0.0;  // of all frames
  bool holds = false;
};

OutlineFit RigidShape::State::outlineFit(const cv::Mat& evidence, const cv::Mat& other,
                                         const cv::Rect& roi) const {
  constexpr double kStepPx = 2.0, kMetPx = 2.0, kCrediblePx = 2.0;
  constexpr double kModelPx = 0.7;        // how far the model's outline may be off
  constexpr double kCorrelationPx = 6.0;  // ... along the outline
  OutlineFit fit;
  const Points x = transformed(pose.camera_from_key, points);
  for (const OutlinePoint& point : occludingContour(x, topology, view, camera, kStepPx)) {
    const Eigen::Vector2d here = point.pixel - Eigen::Vector2d(roi.x, roi.y);
    const cv::Point at(cvRound(here.x()), cvRound(here.y()));
    if (!cv::Rect(cv::Point(), roi.size()).contains(at) || other.at<uchar>(at)) continue;
    const double detail = details.at<float>(at + roi.tl());
    if (std::abs(detail) > kDetailPx) continue;
    const OutlineOffset offset = offsetAlong(evidence, here, point.normal, -detail);
    const double residual = offset.mean + detail;
    ++fit.known;
    fit.met += std::abs(residual) < kMetPx;
    const double weight = credible(residual * residual / (kCrediblePx * kCrediblePx)) *
                          point.length_px / kCorrelationPx /
                          (offset.variance + kModelPx * kModelPx);
    fit.equations.add(weight, residual,
                      pose.jacobian(camera, point.position).transpose() * point.normal);
  }
  return fit;
}

RigidShape::RigidShape(const ModelSurface& model, const cv::Mat& mask)
    : state_(std::make_unique<State>(model)) {
  constexpr double kLeastOverlap = 0.85;  // of silhouette and mask
  const cv::Mat found = silhouette();
  state_->holds = cv::countNonZero(found & mask) > kLeastOverlap * cv::countNonZero(found | mask);
  if (state_->holds) state_->details = signedDistance(mask) - signedDistance(found);
}

RigidShape::~RigidShape() = default;
RigidShape::RigidShape(RigidShape&&) noexcept = default;
RigidShape& RigidShape::operator=(RigidShape&&) noexcept = default;

bool RigidShape::holds() const { return state_->holds; }

cv::Mat RigidShape::silhouette() const { return maskOf(state_->view, state_->camera); }

void RigidShape::moveAlong(const cv::Mat& previous, const cv::Mat& now, const cv::Mat& flow,
                           const cv::Mat& core, const cv::Mat& hidden, const cv::Mat& as_before) {
  state_->before = state_->pose.camera_from_key;
  state_->look = followSurface({previous, now, flow, hidden, as_before}, core, state_->camera,
                               state_->view, state_->velocity, state_->pose);
  state_->least_difference = std::min(state_->least_difference, state_->look.difference);
  state_->draw();
}

void RigidShape::carryDetails(const cv::Mat& motion, const cv::Rect& roi) {
  const cv::Mat moved = movedBack(state_->details, motion, roi);
  state_->details = cv::Mat::zeros(state_->details.size(), CV_32F);
  moved.copyTo(state_->details(roi));
}

cv::Mat RigidShape::distance(const cv::Rect& roi) const {
  return signedDistance(silhouette()(roi)) + state_->details(roi);
}

// The surface's say is kept as it was where it put the model.
void RigidShape::meetOutline(const cv::Mat& evidence, const cv::Mat& other, const cv::Rect& roi) {
  constexpr int kIterations = 4, kFewest = 10;
  constexpr double kStillMet = 0.65, kStillAlike = 2.0;  // of what it was
  constexpr double kLeastMet = 0.4;                      // by chance a few points are met
  // What turns fast, or shows new sides, looks different; the outline of what deforms would show.
  constexpr double kPlainlyMet = 0.9;
  Vector6 moved = Vector6::Zero();
  OutlineFit fit;
  for (int k = 0; k < kIterations; ++k) {
    fit = state_->outlineFit(evidence, other, roi);
    if (fit.known < kFewest) break;
    fit.equations.matrix += state_->look.information;
    fit.equations.right -= state_->look.information * moved;
    const Vector6 step = solve(fit.equations);
    moved += step;
    state_->pose.move(step);
    state_->draw();
  }
  state_->velocity = state_->pose.camera_from_key * state_->before.inverse();
  const double met = fit.known < kFewest ? 0.0 : static_cast<double>(fit.met) / fit.known;
  state_->most_met = std::max(state_->most_met, met);
  const bool alike =
      met >= kPlainlyMet || state_->look.difference <= kStillAlike * state_->least_difference;
  state_->holds = met >= std::max(kLeastMet, kStillMet * state_->most_met) && alike;
}

}  // namespace calipso::align
