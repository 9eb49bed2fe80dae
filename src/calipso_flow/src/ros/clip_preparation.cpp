#include "clip_preparation.hpp"

#include <algorithm>

#include "calipso_ros/topics.hpp"
#include "conversions.hpp"

namespace calipso::flow {

void KeyCollector::take(const calipso_msgs::SegmentationConstPtr& segmentation) {
  if (!segmentation->contours.empty()) segmentation_ = segmentation;
}

void KeyCollector::forgetAfter(const ros::Time& stamp) {
  if (models_ && models_->header.stamp > stamp) models_.reset();
  if (segmentation_ && segmentation_->header.stamp > stamp) segmentation_.reset();
}

std::optional<ros::Time> KeyCollector::segmentedStamp() const {
  if (!segmentation_) return std::nullopt;
  return segmentation_->header.stamp;
}

std::optional<ros::Time> KeyCollector::keyStamp() const {
  if (!models_) return std::nullopt;
  return models_->header.stamp;
}

std::optional<KeyKnowledge> KeyCollector::knowledge(const Scene& scene) const {
  if (!models_ || !segmentation_ || segmentation_->header.stamp != models_->header.stamp)
    return std::nullopt;
  return knowledgeAt(*segmentation_, scene);
}

KeyKnowledge KeyCollector::knowledgeAt(const calipso_msgs::Segmentation& frame,
                                       const Scene& scene) const {
  KeyKnowledge knowledge;
  for (const calipso_msgs::AlignedModel& model : models_->models) {
    knowledge.models.push_back(modelFromMsg(model, scene));
    knowledge.masks.push_back(maskFromMsg(frame.labels, model.index));
  }
  return knowledge;
}

calipso_msgs::Dynamics dynamicsMsg(const Scene& scene, const std::vector<NamedMotion>& motions,
                                   const std_msgs::Header& header) {
  calipso_msgs::Dynamics msg;
  msg.header = header;
  msg.header.frame_id = topics::kWorldFrame;
  for (const SceneObject& object : scene.objects) {
    const auto motion = std::find_if(motions.begin(), motions.end(),
                                     [&](const auto& m) { return m.object == object.name; });
    if (motion == motions.end()) {
      msg.objects.push_back(withoutEstimate(object));
      continue;
    }
    msg.objects.push_back(toMsg(object.name, motion->motion));
    addModes(motion->mode_amplitudes, motion->mode_velocities, msg.objects.back());
  }
  return msg;
}

calipso_msgs::ClipDynamics liveDynamicsMsg(const std::vector<ObjectDynamics>& objects,
                                           const LiveAnalyser& analyser,
                                           const std_msgs::Header& header) {
  calipso_msgs::ClipDynamics msg;
  msg.header = header;
  msg.header.frame_id = topics::kWorldFrame;
  for (const std::string& name : analyser.deforming()) {
    const auto described = std::find_if(objects.begin(), objects.end(),
                                        [&](const ObjectDynamics& o) { return o.name == name; });
    ObjectDynamics object;
    if (described != objects.end()) object = *described;
    object.name = name;
    if (!object.deformation) object.deformation.emplace();
    object.deformation->modes.shapes = analyser.modesOf(name)->shapes;
    msg.objects.push_back(toMsg(object));
  }
  return msg;
}

void addWinds(const std::vector<ObjectDynamics>& objects, double time,
              calipso_msgs::Dynamics& msg) {
  for (calipso_msgs::ObjectDynamics& entry : msg.objects) {
    for (const ObjectDynamics& object : objects) {
      if (object.name == entry.object) addWind(*object.deformation, time, entry);
    }
  }
}

calipso_msgs::ClipDynamics clipDynamicsMsg(const Scene& scene,
                                           const std::vector<ObjectDynamics>& objects,
                                           const std::vector<double>& cut_times,
                                           const std::vector<std_msgs::Header>& headers) {
  calipso_msgs::ClipDynamics msg;
  if (!headers.empty()) msg.header = headers.front();
  msg.header.frame_id = topics::kWorldFrame;
  for (size_t k = 0; k < headers.size(); ++k) {
    std::vector<NamedMotion> motions;
    for (const ObjectDynamics& object : objects) {
      motions.push_back({object.name, object.motions.at(k)});
    }
    msg.frames.push_back(dynamicsMsg(scene, motions, headers[k]));
    for (const ObjectDynamics& object : objects) {
      if (!object.deformation) continue;
      const auto entry = std::find_if(
          msg.frames.back().objects.begin(), msg.frames.back().objects.end(),
          [&](const calipso_msgs::ObjectDynamics& o) { return o.object == object.name; });
      if (entry == msg.frames.back().objects.end()) continue;
      addDeformation(*object.deformation, static_cast<int>(k), *entry);
    }
  }
  for (const ObjectDynamics& object : objects) msg.objects.push_back(toMsg(object));
  for (const double time : cut_times) msg.cuts.push_back(ros::Time(time));
  return msg;
}

}  // namespace calipso::flow
