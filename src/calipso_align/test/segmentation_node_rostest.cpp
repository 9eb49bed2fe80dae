// Feeds the segmentation node a clip of a moving disc and looks at what comes out.
#include <calipso_msgs/NodeStatus.h>
#include <calipso_msgs/Segmentation.h>
#include <cv_bridge/cv_bridge.h>
#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>

#include <boost/make_shared.hpp>
#include <functional>
#include <string>
#include <vector>

#include "calipso_align/segmentation_level.hpp"
#include "calipso_ros/topics.hpp"
#include "ros/segmentation_conversions.hpp"
#include "synthetic_picture.hpp"

namespace calipso::align {
namespace {

const cv::Size kSize(160, 120);
constexpr double kRadius = 30.0;
constexpr double kTimeoutSec = 20.0;

sensor_msgs::ImagePtr frame(double u0, double stamp, const cv::Size& size = kSize) {
  const cv::Mat picture = testing::paint(size, testing::disc(u0, 60, kRadius),
                                         cv::Vec3b(40, 160, 60), cv::Vec3b(150, 150, 150), 2.0);
  std_msgs::Header header;
  header.stamp = ros::Time(stamp);
  header.frame_id = "camera_optical_frame";
  return cv_bridge::CvImage(header, "bgr8", picture).toImageMsg();
}

// Of `value` inside a square about the disc's middle.
sensor_msgs::ImagePtr strokes(int value) {
  cv::Mat marks = cv::Mat::zeros(kSize, CV_8U);
  marks(cv::Rect(70, 50, 20, 20)).setTo(value);
  return cv_bridge::CvImage(std_msgs::Header(), "mono8", marks).toImageMsg();
}

class SegmentationNode : public ::testing::Test {
 protected:
  explicit SegmentationNode(const std::string& name_space = "",
                            const std::string& images = topics::kClipImage)
      : nh_(name_space),
        images_(nh_.advertise<sensor_msgs::Image>(images, 100)),
        strokes_(nh_.advertise<sensor_msgs::Image>(topics::kStrokes, 1)),
        segmentations_(
            nh_.subscribe(topics::kSegmentation, 0, &SegmentationNode::onSegmentation, this)),
        statuses_(nh_.subscribe(topics::kStatus, 0, &SegmentationNode::onStatus, this)),
        diagnostics_(
            nh_.subscribe(topics::kDiagnostics, 0, &SegmentationNode::onDiagnostics, this)) {}

  void onSegmentation(const calipso_msgs::SegmentationConstPtr& msg) { received_.push_back(msg); }
  void onStatus(const calipso_msgs::NodeStatusConstPtr& msg) { status_ = *msg; }
  void onDiagnostics(const diagnostic_msgs::DiagnosticArrayConstPtr& msg) {
    warnings_ += msg->status[0].message;
  }

  // Spins until `done`, or fails after the timeout.
  void waitFor(const std::function<bool()>& done, const char* what) {
    const ros::WallTime end = ros::WallTime::now() + ros::WallDuration(kTimeoutSec);
    while (!done()) {
      ASSERT_LT(ros::WallTime::now(), end) << "gave up waiting for " << what;
      ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.05));
    }
  }

  void waitForNode() {
    waitFor(
        [&] {
          return images_.getNumSubscribers() > 0 && strokes_.getNumSubscribers() > 0 &&
                 segmentations_.getNumPublishers() > 0 && diagnostics_.getNumPublishers() > 1 &&
                 !status_.node.empty();
        },
        "the node");
  }

  void waitForWarning(const std::string& part) {
    waitFor([&] { return warnings_.find(part) != std::string::npos; }, part.c_str());
  }

  // Of the k-th segmentation that came, where strokes() draws.
  int labelAtMiddle(size_t k) const {
    return labelsFromMsg(received_.at(k)->labels).at<uchar>(60, 80);
  }

  ros::NodeHandle nh_;
  ros::Publisher images_, strokes_;
  ros::Subscriber segmentations_, statuses_, diagnostics_;
  std::vector<calipso_msgs::SegmentationConstPtr> received_;
  calipso_msgs::NodeStatus status_;
  std::string warnings_;  // all, one after the other
};

TEST_F(SegmentationNode, SegmentsTheKeyFrameAnewWithNewStrokes) {
  waitForNode();
  images_.publish(frame(80.0, 1.0));
  waitFor([&] { return received_.size() == 1; }, "the key frame");
  EXPECT_EQ(labelAtMiddle(0), 1);
  strokes_.publish(strokes(kBackgroundStroke));
  waitFor([&] { return received_.size() == 2; }, "the key frame with a hole");
  EXPECT_EQ(labelAtMiddle(1), 0);

  constexpr int kNobody = 7;
  strokes_.publish(strokes(kNobody));
  waitFor([&] { return status_.message.find("stands") != std::string::npos; }, "the refusal");
  EXPECT_EQ(status_.state, calipso_msgs::NodeStatus::READY);

  strokes_.publish(strokes(1));
  waitFor([&] { return received_.size() == 3; }, "the key frame without a hole");
  EXPECT_EQ(labelAtMiddle(2), 1);
}

TEST_F(SegmentationNode, TracksTheRestAndServesLateSubscribers) {
  waitForNode();
  for (int k = 1; k < 3; ++k) images_.publish(frame(80.0 + 2.0 * k, 1.0 + 0.1 * k));
  waitFor([&] { return received_.size() == 3 && status_.clip_frames == 3; }, "three frames");

  EXPECT_EQ(status_.state, calipso_msgs::NodeStatus::READY);
  for (int k = 0; k < 3; ++k) {
    const auto& msg = *received_[k];
    EXPECT_EQ(msg.header.stamp, ros::Time(1.0 + 0.1 * k));
    const cv::Mat truth = testing::maskOf(kSize, testing::disc(80.0 + 2.0 * k, 60, kRadius));
    EXPECT_GE(testing::intersectionOverUnion(labelsFromMsg(msg.labels) == 1, truth), 0.95);
  }
  // A new connection is handed the key frame first.
  ASSERT_EQ(received_[0]->contours.size(), 1u);
  const ObjectContour contour = fromMsg(received_[0]->contours[0]);
  EXPECT_EQ(contour.object, "disc");
  for (const Eigen::Vector2d& p : contour.loops.at(0).points)
    EXPECT_NEAR((p - Eigen::Vector2d(80, 60)).norm(), kRadius, 1.5);
  EXPECT_TRUE(received_[1]->contours.empty());

  const auto broken = boost::make_shared<sensor_msgs::Image>();
  broken->header.stamp = ros::Time(1.3);
  images_.publish(broken);
  waitFor([&] { return status_.clip_frames == 4 && received_.size() == 4; },
          "the broken frame to be counted");
  EXPECT_EQ(status_.state, calipso_msgs::NodeStatus::READY);
  EXPECT_EQ(received_[3]->header.stamp, ros::Time(1.3));
  EXPECT_EQ(received_[3]->confidence, 0.0f);
  EXPECT_GT(cv::countNonZero(labelsFromMsg(received_[3]->labels)), 0)
      << "the labels of the frame before";
}

// Their masks are out, and one that starts again from the key frame may not find what has moved.
TEST_F(SegmentationNode, RefusesStrokesOnceFramesAreTracked) {
  waitForNode();
  waitFor([&] { return received_.size() == 1; }, "the key frame");
  strokes_.publish(strokes(kBackgroundStroke));
  waitForWarning("strokes.png");
  EXPECT_EQ(status_.state, calipso_msgs::NodeStatus::READY);
  images_.publish(frame(86.0, 1.4));
  waitFor([&] { return received_.size() == 2; }, "one more frame");
  EXPECT_EQ(received_[1]->header.stamp, ros::Time(1.4));
  EXPECT_EQ(labelAtMiddle(1), 1);
}

class LiveSegmentationNode : public SegmentationNode {
 protected:
  LiveSegmentationNode() : SegmentationNode("live", topics::kImage) {}
};

TEST_F(LiveSegmentationNode, WaitsForAPictureOfTheScenesSizeAndSaysWhatLateStrokesCost) {
  waitForNode();
  images_.publish(frame(40.0, 1.0, kSize / 2));
  waitFor([&] { return status_.state == calipso_msgs::NodeStatus::FAILED; }, "the refusal");
  EXPECT_EQ(status_.message,
            "images are 80x60, but scene.yaml is for 160x120; use the scene of this video");
  images_.publish(frame(80.0, 1.1));
  waitFor([&] { return !received_.empty(); }, "the key frame");
  EXPECT_EQ(received_[0]->header.stamp, ros::Time(1.1));

  images_.publish(frame(82.0, 1.2));
  waitFor([&] { return received_.size() == 2; }, "a tracked frame");
  strokes_.publish(strokes(kBackgroundStroke));
  waitForWarning("start over from the key frame");
  images_.publish(frame(84.0, 1.3));
  waitFor([&] { return received_.size() == 4; }, "the key frame anew and one more");
  EXPECT_EQ(received_[2]->header.stamp, ros::Time(1.1));
  EXPECT_EQ(labelAtMiddle(3), 0);
}

class SegmentationNodeWithoutDepth : public SegmentationNode {
 protected:
  SegmentationNodeWithoutDepth() : SegmentationNode("without_depth") {}
};

// Of its scene it cannot be read.
TEST_F(SegmentationNodeWithoutDepth, DoesWithoutTheDepthImage) {
  waitForNode();
  images_.publish(frame(80.0, 1.0));
  waitFor([&] { return status_.clip_frames == 1; }, "the key frame");
  EXPECT_EQ(status_.state, calipso_msgs::NodeStatus::READY) << status_.message;
}

}  // namespace
}  // namespace calipso::align

int main(int argc, char** argv) {
  ::testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "segmentation_node_rostest");
  return RUN_ALL_TESTS();
}
