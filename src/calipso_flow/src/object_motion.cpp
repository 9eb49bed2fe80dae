#include "calipso_flow/object_motion.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "calipso_scene/median.hpp"

namespace calipso::flow {
namespace {

constexpr double kCrossingTime = 0.1;  // s; see priorFor
// grey levels by which half the picture differs: less is what moves before a place that stays
constexpr double kOtherPlace = 3.0;

double medianDifference(const cv::Mat& a, const cv::Mat& b) {
  const cv::Mat difference = cv::abs(a - b);
  return median({difference.begin<float>(), difference.end<float>()});
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
  const cv::Mat &a = previous.thumbnail, &b = next.thumbnail;
  cv::meanStdDev(a, mean_a, deviation_a);
  cv::meanStdDev(b, mean_b, deviation_b);
  const double spread = deviation_a[0] * deviation_b[0];
  // Two flat pictures agree when their brightness does.
  if (spread < 1.0) return std::abs(mean_a[0] - mean_b[0]) > 16.0;
  const cv::Mat product = (a - mean_a[0]).mul(b - mean_b[0]);
  return cv::mean(product)[0] / spread < least_correlation && medianDifference(a, b) > kOtherPlace;
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
