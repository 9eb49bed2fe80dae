#include "calipso_flow/object_motion.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgproc.hpp>

#include "calipso_scene/median.hpp"

namespace calipso::flow {
namespace {

constexpr double kCrossingTime = 0.1;  // s; see priorFor
// grey levels by which half the picture differs: less is what moves before a place that stays
constexpr double kOtherPlace = 3.0;
constexpr double kLeastOverlap = 0.25;  // of the picture: what a camera turned by more shows is new

// @param seen  CV_8U: where to compare
double medianDifference(const cv::Mat& a, const cv::Mat& b, const cv::Mat& seen) {
  std::vector<double> differences;
  for (int v = 0; v < a.rows; ++v) {
    for (int u = 0; u < a.cols; ++u) {
      if (seen.at<uchar>(v, u))
        differences.push_back(std::abs(a.at<float>(v, u) - b.at<float>(v, u)));
    }
  }
  return median(std::move(differences));
}

Eigen::Matrix3d thumbnailIntrinsics(const Frame& frame) {
  const Camera& camera = frame.camera;
  const double across = static_cast<double>(frame.thumbnail.cols) / camera.width,
               down = static_cast<double>(frame.thumbnail.rows) / camera.height;
  Eigen::Matrix3d K;
  K << across * camera.fx, 0.0, across * (camera.cx + 0.5) - 0.5,  //
      0.0, down * camera.fy, down * (camera.cy + 0.5) - 0.5,       //
      0.0, 0.0, 1.0;
  return K;
}

// The thumbnail as the next frame's camera would have seen it, for what is far away: K R K^-1.
// @param seen  CV_8U, out: where it has something to show; all of it when the camera has not turned,
//   or by too much to tell
cv::Mat thumbnailTurned(const Frame& frame, const Frame& next, cv::Mat& seen) {
  const cv::Mat& thumbnail = frame.thumbnail;
  seen = cv::Mat(thumbnail.size(), CV_8U, cv::Scalar(255));
  const Eigen::Matrix3d R =
      next.camera.world_from_camera.linear().transpose() * frame.camera.world_from_camera.linear();
  if (R.isIdentity(1e-9)) return thumbnail;
  cv::Mat H, turned, shown;
  cv::eigen2cv(
      Eigen::Matrix3d(thumbnailIntrinsics(next) * R * thumbnailIntrinsics(frame).inverse()), H);
  cv::warpPerspective(thumbnail, turned, H, thumbnail.size(), cv::INTER_LINEAR,
                      cv::BORDER_REPLICATE);
  cv::warpPerspective(seen, shown, H, thumbnail.size(), cv::INTER_NEAREST);
  // Half a turn maps the picture to what is behind it.
  if (R(2, 2) <= 0.0 || cv::countNonZero(shown) < kLeastOverlap * shown.total()) return thumbnail;
  seen = shown;
  return turned;
}

}  // namespace

ObjectMotion motionFrom(const MotionState& state, const Eigen::Vector3d& centroid, bool moving,
                        int tracks) {
  ObjectMotion motion;
  motion.state = state;
  motion.moving = moving;
  motion.tracks = tracks;
  motion.world_from_object.linear() = state.rotation;
  motion.world_from_object.translation() = state.position - state.rotation * centroid;
  return motion;
}

bool isCut(const Frame& previous, const Frame& next, double least_correlation) {
  cv::Scalar mean_a, mean_b, deviation_a, deviation_b;
  cv::Mat seen;
  const cv::Mat a = thumbnailTurned(previous, next, seen), &b = next.thumbnail;
  cv::meanStdDev(a, mean_a, deviation_a, seen);
  cv::meanStdDev(b, mean_b, deviation_b, seen);
  const double spread = deviation_a[0] * deviation_b[0];
  // Two flat pictures agree when their brightness does.
  if (spread < 1.0) return std::abs(mean_a[0] - mean_b[0]) > 16.0;
  const cv::Mat product = (a - mean_a[0]).mul(b - mean_b[0]);
  return cv::mean(product, seen)[0] / spread < least_correlation &&
         medianDifference(a, b, seen) > kOtherPlace;
}

MotionPrior priorFor(const Camera& camera, double depth, const Eigen::Vector3d& gravity) {
  MotionPrior prior;
  const double width = depth * camera.width / camera.fx;  // m
  prior.position = 10.0 * width;
  prior.velocity = width / kCrossingTime;
  prior.acceleration = prior.velocity / kCrossingTime;
  prior.gravity = gravity;
  return prior;
}

std::vector<PoseMeasurement> measurementsOf(const std::vector<Observation>& observations,
                                            const Eigen::Vector3d& centroid) {
  std::vector<PoseMeasurement> measurements;
  for (const Observation& observation : observations) {
    measurements.push_back({observation.time, observation.world_from_object * centroid,
                            observation.world_from_object.linear(),
                            observation.covariance - observation.persistent, observation.found,
                            observation.common, observation.drift});
  }
  return measurements;
}

}  // namespace calipso::flow
