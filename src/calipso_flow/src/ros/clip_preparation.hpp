#pragma once

#include <calipso_msgs/AlignedModels.h>
#include <calipso_msgs/ClipDynamics.h>
#include <calipso_msgs/ClipInfo.h>
#include <calipso_msgs/Segmentation.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "calipso_flow/clip_dynamics.hpp"
#include "calipso_flow/live_dynamics.hpp"
#include "calipso_ros/frame_source.hpp"
#include "calipso_scene/scene.hpp"

namespace calipso::flow {

// The models and masks of the key frame, in whatever order their messages come.
struct KeyKnowledge {
  std::vector<ObjectModel> models;
  std::vector<cv::Mat> masks;
};

// Collects `models` and the segmentation of their stamp.
class KeyCollector {
 public:
  void take(const calipso_msgs::AlignedModelsConstPtr& models) { models_ = models; }
  void take(const calipso_msgs::SegmentationConstPtr& segmentation);  // the key frame's counts
  const calipso_msgs::AlignedModelsConstPtr& models() const { return models_; }  // or null
  // Forgets what belongs to a key frame later than this.
  void forgetAfter(const ros::Time& stamp);
  // Stamp of the key frame, once it has been segmented.
  std::optional<ros::Time> segmentedStamp() const;
  // Stamp of the key frame, once models have come.
  std::optional<ros::Time> keyStamp() const;
  // Both messages' content, once both have come. @throw std::invalid_argument for a bad message
  // @param scene  says where objects are attached
  std::optional<KeyKnowledge> knowledge(const Scene& scene) const;
  // The same with the masks of another frame. @pre knowledge() is there
  KeyKnowledge knowledgeAt(const calipso_msgs::Segmentation& frame, const Scene& scene) const;

 private:
  calipso_msgs::AlignedModelsConstPtr models_;
  calipso_msgs::SegmentationConstPtr segmentation_;
};

// The whole clip's dynamics as a message, one entry per stamp and object of the scene.
calipso_msgs::ClipDynamics clipDynamicsMsg(const Scene& scene,
                                           const std::vector<ObjectDynamics>& objects,
                                           const std::vector<double>& cut_times,
                                           const std::vector<std_msgs::Header>& headers);

// What the last seconds say about deforming objects, in the modes of the frames' amplitudes.
calipso_msgs::ClipDynamics liveDynamicsMsg(const std::vector<ObjectDynamics>& objects,
                                           const LiveAnalyser& analyser,
                                           const std_msgs::Header& header);

// Adds the wind that the last seconds show, as it is at a time, s.
void addWinds(const std::vector<ObjectDynamics>& objects, double time, calipso_msgs::Dynamics& msg);

// One frame's dynamics; `motions` by object name, objects without one get no estimate.
calipso_msgs::Dynamics dynamicsMsg(const Scene& scene, const std::vector<NamedMotion>& motions,
                                   const std_msgs::Header& header);

}  // namespace calipso::flow
