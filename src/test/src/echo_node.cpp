#include <calipso_msgs/Dynamics.h>
#include <calipso_msgs/Edit.h>
#include <calipso_msgs/EditReport.h>
#include <calipso_msgs/NodeStatus.h>
#include <calipso_msgs/SimulationState.h>

#include <csignal>
#include <cstdlib>
#include <string>

#include "calipso_ros/frame_source.hpp"
#include "calipso_ros/node_main.hpp"
#include "calipso_ros/topics.hpp"

namespace {

using calipso_msgs::NodeStatus;

// Stands in for the whole graph between player and recorder: is ready at once and gives every frame
// back as it came. Indices of frames: ~swallow one to lose, ~lose_image one whose image alone is
// lost, ~die_at one to end the process at. With ~deaf it hears no request to end.
class EchoNode {
 public:
  EchoNode(ros::NodeHandle& nh, ros::NodeHandle& pnh)
      : swallow_(pnh.param("swallow", -1)),
        lose_image_(pnh.param("lose_image", -1)),
        die_at_(pnh.param("die_at", -1)),
        edited_(nh.advertise<sensor_msgs::Image>(calipso::topics::kImageEdited, 100)),
        info_(nh.advertise<sensor_msgs::CameraInfo>(calipso::topics::kImageEditedCameraInfo, 100)),
        provenance_(nh.advertise<sensor_msgs::Image>(calipso::topics::kProvenance, 100)),
        state_(nh.advertise<calipso_msgs::SimulationState>(calipso::topics::kState, 100)),
        dynamics_(nh.advertise<calipso_msgs::Dynamics>(calipso::topics::kDynamics, 100)),
        report_(nh.advertise<calipso_msgs::EditReport>(calipso::topics::kEditsApplied, 100)),
        status_(nh.advertise<NodeStatus>(calipso::topics::kStatus, 100)),
        clip_(nh.subscribe(calipso::topics::kClipImage, 100, &EchoNode::onClipImage, this)),
        edits_(nh.subscribe(calipso::topics::kEdits, 100, &EchoNode::onEdit, this)),
        frames_(
            nh, calipso::topics::kImage, calipso::topics::kCameraInfo, 0, poses_,
            [this](const calipso::Frame& frame) { onFrame(frame); },
            [](const sensor_msgs::ImageConstPtr&, const std::string& reason) {
              ROS_ERROR_STREAM("echo: " << reason);
            }) {
    if (pnh.param("deaf", false)) std::signal(SIGINT, SIG_IGN);
    timer_ = nh.createWallTimer(ros::WallDuration(0.1), [this](const auto&) { report(); });
  }

 private:
  void onClipImage(const sensor_msgs::ImageConstPtr&) {
    ++clip_frames_;
    report();
  }

  void onEdit(const calipso_msgs::EditConstPtr& edit) {
    ++edit_count_;
    calipso_msgs::EditReport report;
    report.header = edit->header;
    report.edit = *edit;
    report.accepted = true;
    report_.publish(report);
    this->report();
  }

  void report() {
    for (const char* node : {"segmentation", "align", "flow", "simulator", "render"}) {
      NodeStatus status;
      status.node = node;
      status.state = NodeStatus::READY;
      status.message = "echoing";
      status.clip_frames = clip_frames_;
      status.edits = edit_count_;
      status_.publish(status);
    }
  }

  void onFrame(const calipso::Frame& frame) {
    const int index = frames_seen_++;
    if (index == die_at_) std::_Exit(3);
    if (index == swallow_) return;
    if (index != lose_image_) edited_.publish(frame.image);
    info_.publish(frame.info);
    sensor_msgs::Image provenance = *frame.image;
    provenance.encoding = "mono8";
    provenance.step = provenance.width;
    provenance.data.assign(provenance.step * provenance.height, 0);
    provenance_.publish(provenance);
    calipso_msgs::SimulationState state;
    state.header = frame.image->header;
    state.reports = edit_count_;
    state_.publish(state);
    calipso_msgs::Dynamics dynamics;
    dynamics.header = frame.image->header;
    dynamics_.publish(dynamics);
  }

  int swallow_, lose_image_, die_at_;
  int frames_seen_ = 0;
  unsigned clip_frames_ = 0, edit_count_ = 0;
  ros::Publisher edited_, info_, provenance_, state_, dynamics_, report_, status_;
  ros::Subscriber clip_, edits_;
  calipso::CameraPoses poses_{calipso::Mode::kBag};
  calipso::FrameSource frames_;
  ros::WallTimer timer_;
};

}  // namespace

int main(int argc, char** argv) { return calipso::runNode<EchoNode>(argc, argv, "echo"); }
