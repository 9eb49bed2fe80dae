#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>

#include "calipso_scene/camera.hpp"

namespace calipso::flow {

// A clip as a second recording of the same scene would have it: other grain, another rough
// placement by hand. What an estimate differs by from one such recording to the next rests on
// chance.
class Perturbation {
 public:
  // @param number  of the recording, which decides its grain and placement; 0: the clip as it is
  explicit Perturbation(int number = 0) : number_(number) {}

  int number() const { return number_; }
  // The picture of frame k (CV_8UC3) with grain of one grey level.
  void addGrain(int k, cv::Mat& picture) const;
  // The placement moved by a fraction of a pixel, parallel to the picture.
  // @param seed  objects with different ones are moved differently
  Eigen::Isometry3d nudged(const Eigen::Isometry3d& world_from_object, const Camera& camera,
                           int seed) const;

 private:
  int number_;
};

}  // namespace calipso::flow
