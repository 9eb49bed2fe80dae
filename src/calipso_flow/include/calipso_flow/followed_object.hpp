#pragma once

#include <deque>
#include <memory>
#include <vector>

#include "calipso_flow/deformable_tracker.hpp"
#include "calipso_flow/object_tracker.hpp"

namespace calipso::flow {

// One object as it is followed from frame to frame. It is rigid until it is held somewhere and is
// seen to move other than as a whole: from then on its deformation is followed. Not thread-safe.
class FollowedObject {
 public:
  static constexpr size_t kLookBack = 8;  // frames that `follow` wants at most

  // @param mask  as ObjectTracker's
  FollowedObject(const ObjectModel& model, const Frame& key_frame, const cv::Mat& mask,
                 const TrackerParams& params, double rest_px);

  // @param recent  the frames just seen, oldest first, `frame` the last of them: looked at again
  //   when the object starts to deform
  // @param cut     the picture does not continue the last one
  // @param cut_times  s, of all cuts so far, between two frames
  void follow(const std::deque<Frame>& recent, bool cut, const std::vector<double>& cut_times);
  void forgetBefore(double time);  // s; the last frame is always kept

  const ObjectTracker& tracker() const { return tracker_; }
  const std::vector<Observation>& observations() const { return observations_; }  // per frame
  // Nothing while it is rigid. @{
  const DeformableTracker* deformable() const { return deformable_.get(); }
  const std::vector<DeformationObservation>& deformations() const { return deformations_; }  // @}

 private:
  void beginDeformable(const std::deque<Frame>& recent, const std::vector<double>& cut_times);
  void followDeformation(const Frame& frame, bool cut, Observation& observation);

  ObjectTracker tracker_;
  Frame key_;
  cv::Mat mask_;
  TrackerParams params_;
  double rest_px_;
  std::vector<Observation> observations_;
  int frames_left_ = 0;  // successive frames in which it had left its place
  std::unique_ptr<DeformableTracker> deformable_;
  std::vector<DeformationObservation> deformations_;
};

}  // namespace calipso::flow
