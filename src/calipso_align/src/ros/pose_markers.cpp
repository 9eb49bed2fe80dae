#include "ros/pose_markers.hpp"

#include "calipso_ros/conversions.hpp"
#include "calipso_ros/topics.hpp"

namespace calipso::align {
namespace {

using visualization_msgs::InteractiveMarker;
using visualization_msgs::InteractiveMarkerControl;
using visualization_msgs::InteractiveMarkerFeedbackConstPtr;
using visualization_msgs::Marker;

Marker solidOf(const TriangleMesh& model) {
  Marker marker;
  marker.type = Marker::TRIANGLE_LIST;
  marker.pose.orientation.w = 1.0;
  marker.scale.x = marker.scale.y = marker.scale.z = 1.0;
  marker.color.r = marker.color.g = marker.color.b = 0.8f;
  marker.color.a = 0.35f;
  for (int i = 0; i < model.triangles.size(); ++i) {
    marker.points.push_back(toPointMsg(model.vertex(model.triangles.data()[i])));
  }
  return marker;
}

// Moving along and turning about the axis that `orientation` turns x into.
void addAxis(const Eigen::Quaterniond& orientation, InteractiveMarker& marker) {
  InteractiveMarkerControl control;
  control.orientation.w = orientation.w();
  control.orientation.x = orientation.x();
  control.orientation.y = orientation.y();
  control.orientation.z = orientation.z();
  control.interaction_mode = InteractiveMarkerControl::MOVE_AXIS;
  marker.controls.push_back(control);
  control.interaction_mode = InteractiveMarkerControl::ROTATE_AXIS;
  marker.controls.push_back(control);
}

}  // namespace

PoseMarkers::PoseMarkers(const std::string& topic, OnMoved on_moved)
    : server_(topic), on_moved_(std::move(on_moved)) {}

void PoseMarkers::add(int object, const SceneObject& description, const TriangleMesh& model) {
  InteractiveMarker marker;
  marker.header.frame_id = topics::kWorldFrame;
  marker.name = description.name;
  marker.description = description.name;
  marker.scale = static_cast<float>(0.6 * boundingDiagonal(model));
  marker.pose = calipso::toMsg(description.initial_world_from_object);

  InteractiveMarkerControl body;
  body.always_visible = true;
  body.interaction_mode = InteractiveMarkerControl::MOVE_3D;
  body.markers.push_back(solidOf(model));
  marker.controls.push_back(body);
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d axis = Eigen::Vector3d::Unit(k);
    addAxis(Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitX(), axis), marker);
  }
  server_.insert(marker, [this, object](const InteractiveMarkerFeedbackConstPtr& feedback) {
    if (feedback->event_type != visualization_msgs::InteractiveMarkerFeedback::MOUSE_UP) return;
    on_moved_(object, calipso::fromMsg(feedback->pose));
  });
  server_.applyChanges();
}

void PoseMarkers::setPose(const std::string& name, const Eigen::Isometry3d& world_from_object) {
  server_.setPose(name, calipso::toMsg(world_from_object));
  server_.applyChanges();
}

}  // namespace calipso::align
