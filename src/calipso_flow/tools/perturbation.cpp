#include "perturbation.hpp"

#include "calipso_flow/pose_fit.hpp"

namespace calipso::flow {
namespace {

constexpr double kGrain = 1.0;    // grey levels
constexpr double kNudgePx = 0.5;  // most, per direction

cv::RNG generator(int number, int stream) {
  return cv::RNG(static_cast<uint64_t>(number) * 1000003u + static_cast<uint64_t>(stream) + 1u);
}

}  // namespace

void Perturbation::addGrain(int k, cv::Mat& picture) const {
  if (number_ == 0) return;
  cv::RNG random = generator(number_, k);
  cv::Mat grain(picture.size(), CV_32FC3);
  random.fill(grain, cv::RNG::NORMAL, 0.0, kGrain);
  cv::add(picture, grain, picture, cv::noArray(), CV_8UC3);
}

Eigen::Isometry3d Perturbation::nudged(const Eigen::Isometry3d& world_from_object,
                                       const Camera& camera, int seed) const {
  if (number_ == 0) return world_from_object;
  cv::RNG random = generator(number_, -1 - seed);
  const double right = random.uniform(-kNudgePx, kNudgePx),
               down = random.uniform(-kNudgePx, kNudgePx);
  return shiftInPicture(camera, world_from_object, Eigen::Vector3d::Zero(), {right, down});
}

}  // namespace calipso::flow
