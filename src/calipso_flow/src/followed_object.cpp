#include "calipso_flow/followed_object.hpp"

#include <algorithm>

#include "calipso_flow/deformation_motion.hpp"

namespace calipso::flow {
namespace {

constexpr int kLeftFrames = 2;  // in which an object must have left its shape

}  // namespace

FollowedObject::FollowedObject(const ObjectModel& model, const Frame& key_frame,
                               const cv::Mat& mask, const TrackerParams& params, double rest_px)
    : tracker_(model, key_frame, mask, params),
      key_(key_frame),
      mask_(mask),
      params_(params),
      rest_px_(rest_px),
      observations_{tracker_.keyObservation()} {}

void FollowedObject::follow(const std::deque<Frame>& recent, bool cut,
                            const std::vector<double>& cut_times) {
  const Frame& frame = recent.back();
  observations_.emplace_back();
  if (deformable_) {
    followDeformation(frame, cut, observations_.back());
    return;
  }
  observations_.back() = tracker_.track(frame, cut);
  const ObjectModel& model = tracker_.model();
  const bool bent =
      !model.attached.empty() &&
      hasLeft(observations_.back(), model.world_from_object, frame.camera, rest_px_) &&
      !movesRigidly(observations_, model.world_from_object, frame.camera);
  frames_left_ = bent ? frames_left_ + 1 : 0;
  if (frames_left_ >= kLeftFrames) beginDeformable(recent, cut_times);
}

void FollowedObject::followDeformation(const Frame& frame, bool cut, Observation& observation) {
  deformations_.push_back(deformable_->track(frame, cut));
  observation = rigidPart(*deformable_, deformations_.back(), tracker_.centroid());
}

// Looks at the frames just seen again; before them the object was in its place.
void FollowedObject::beginDeformable(const std::deque<Frame>& recent,
                                     const std::vector<double>& cut_times) {
  deformable_ = std::make_unique<DeformableTracker>(tracker_.model(), key_, mask_, params_);
  const size_t again = std::min(recent.size(), observations_.size() - 1);
  for (size_t k = 0; k + again < observations_.size(); ++k) {
    deformations_.push_back(deformable_->keyObservation());
    deformations_.back().time = observations_[k].time;
  }
  for (auto frame = recent.end() - again; frame != recent.end(); ++frame) {
    const size_t k = deformations_.size();
    const bool cut = std::any_of(cut_times.begin(), cut_times.end(), [&](double time) {
      return time > observations_[k - 1].time && time < frame->time;
    });
    followDeformation(*frame, cut, observations_[k]);
  }
}

void FollowedObject::forgetBefore(double time) {
  const auto forget = [&](auto& all) {
    const auto first =
        std::find_if(all.begin(), all.end(), [&](const auto& o) { return o.time >= time; });
    all.erase(all.begin(), std::min(first, all.end() - 1));
  };
  forget(observations_);
  if (deformable_) forget(deformations_);
}

}  // namespace calipso::flow
