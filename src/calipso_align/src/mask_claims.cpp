#include <algorithm>

#include "calipso_align/mask_tracker.hpp"
#include "reappearance.hpp"

// Which object a pixel is left to, and objects that have gone or come back.
namespace calipso::align {

// A pixel goes to the one that was to be expected there; where both or neither were, to the one
// whose model says so, or else to the later.
void MaskTracker::settleClaims() {
  for (size_t a = 0; a < objects_.size(); ++a)
    for (size_t b = a + 1; b < objects_.size(); ++b) {
      Object &one = objects_[a], &other = objects_[b];
      const cv::Mat both = one.mask & other.mask;
      if (cv::countNonZero(both) == 0) continue;
      const cv::Mat expects_one = one.expected & ~other.expected,
                    expects_other = other.expected & ~one.expected;
      const bool first = one.shape && !other.shape;
      const cv::Mat others = both & (first ? expects_other : ~expects_one);
      leave(one, others);
      leave(other, both & ~others);
    }
}

void MaskTracker::leave(Object& object, const cv::Mat& pixels) {
  object.mask.setTo(0, pixels);
  object.coverage.setTo(0, pixels);
}

void MaskTracker::lose(Object& object) const {
  object.mask = cv::Mat::zeros(size_, CV_8U);
  object.coverage = object.mask.clone();
  object.expected = object.mask.clone();
  object.confidence = 0.0f;
  object.shape.reset();
}

void MaskTracker::takeUpAgain(const cv::Mat& image, const cv::Mat& means) {
  constexpr double kLeastShare = 0.05;  // of its area in the key frame
  constexpr double kLeastNoise = 2.0;   // grey levels, of a still picture
  constexpr float kConfidence = 0.5f;   // of a mask that no motion led to
  cv::Mat taken = cv::Mat::zeros(size_, CV_8U);
  for (const Object& object : objects_) taken |= object.mask;
  suspects_ = cv::Mat::zeros(size_, CV_8U);
  for (Object& object : objects_) {
    const int least = std::max(1, static_cast<int>(kLeastShare * object.key_area));
    if (cv::countNonZero(object.mask) >= least) continue;
    const Reappearance back =
        findAgain(image, background_, taken & ~object.mask, object.colours, least);
    if (!back.suspects.empty()) suspects_ |= back.suspects;
    if (back.mask.empty()) continue;
    object.shape.reset();  // it was left behind
    object.confidence = kConfidence;
    accept(object, image, background_, kLeastNoise, back.mask, cv::Rect(cv::Point(), size_));
    object.reference_mean = means;
    taken |= object.mask;
  }
}

}  // namespace calipso::align
