#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "calipso_render/clip_sample.hpp"

namespace calipso::render {

// How a camera that stands still has exposed a picture against its key frame: automatic exposure
// and white balance change as what is in the picture does.
class ExposureMeter {
 public:
  // @param key CV_8UC3 @param labels CV_8UC1: the objects
  ExposureMeter(const cv::Mat& key, const cv::Mat& labels);

  // Factor per channel of linear light that most of the place has in common; nullopt: the same
  // exposure, or none is told.
  std::optional<cv::Vec3f> gainOf(const cv::Mat& bgr, const cv::Mat& labels) const;

 private:
  struct Square {
    cv::Rect where;
    cv::Vec3f mean;  // linear
  };
  std::vector<Square> squares_;
};

// A picture of another exposure. CV_8UC3
cv::Mat exposedBy(const cv::Mat& bgr, const cv::Vec3f& gain);
// One that has been exposed by a gain as the key frame is; what is clipped in it stays bright.
cv::Mat exposedAsKey(const cv::Mat& bgr, const cv::Vec3f& gain);

// The clip with every frame exposed as the first one; nullopt: they are.
std::optional<ClipSample> evenlyExposed(const ClipSample& clip);

}  // namespace calipso::render
