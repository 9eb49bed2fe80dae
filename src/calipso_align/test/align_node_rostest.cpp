// Feeds the align node a key frame's contour and looks at the models that come out.
#include <calipso_msgs/AlignedModels.h>
#include <calipso_msgs/Segmentation.h>
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <visualization_msgs/MarkerArray.h>

#include <algorithm>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include "calipso_ros/same_message.hpp"
#include "calipso_ros/topics.hpp"
#include "ros/align_ros.hpp"

namespace calipso::align {
namespace {

constexpr double kTimeoutSec = 40.0;
const ros::Time kStamp(2.5);

constexpr int kWidth = 160, kHeight = 120;  // of the scene's pictures

// A square on its tip, as far as it is in the picture: where the border cuts it, the contour is
// unknown.
calipso_msgs::Contour tippedSquare(double centre_u, double centre_v, double radius) {
  constexpr int kPerSide = 40;
  const double corner_u[] = {1, 0, -1, 0}, corner_v[] = {0, 1, 0, -1};
  calipso_msgs::Contour loop;
  for (int side = 0; side < 4; ++side) {
    for (int k = 0; k < kPerSide; ++k) {
      const double t = static_cast<double>(k) / kPerSide;
      const int next = (side + 1) % 4;
      const double u = centre_u + radius * ((1 - t) * corner_u[side] + t * corner_u[next]);
      const double v = centre_v + radius * ((1 - t) * corner_v[side] + t * corner_v[next]);
      const double seen_u = std::min(std::max(u, -0.5), kWidth - 0.5);
      const double seen_v = std::min(std::max(v, -0.5), kHeight - 0.5);
      loop.u.push_back(seen_u);
      loop.v.push_back(seen_v);
      loop.known.push_back(seen_u == u && seen_v == v);
      loop.confidence.push_back(1.0f);
    }
  }
  return loop;
}

calipso_msgs::Segmentation keyFrame(const ros::Time& stamp,
                                    const std::vector<calipso_msgs::Contour>& loops,
                                    const std::string& object = "disc") {
  calipso_msgs::Segmentation msg;
  msg.header.stamp = stamp;
  msg.contours.resize(1);
  msg.contours[0].object = object;
  msg.contours[0].index = 1;
  msg.contours[0].loops = loops;
  return msg;
}

// The outline of the scene's double pyramid, moved by a few pixels and a tenth larger.
calipso_msgs::Segmentation keyFrame() { return keyFrame(kStamp, {tippedSquare(82.0, 58.0, 33.0)}); }

class AlignNode : public ::testing::Test {
 protected:
  explicit AlignNode(const std::string& name_space = "")
      : nh_(name_space),
        segmentations_(nh_.advertise<calipso_msgs::Segmentation>(topics::kSegmentation, 10)),
        poses_(nh_.advertise<geometry_msgs::PoseStamped>("align/initial_pose/disc", 1)),
        models_(nh_.subscribe(topics::kModels, 0, &AlignNode::onModels, this)) {}

  void onModels(const calipso_msgs::AlignedModelsConstPtr& msg) { received_.push_back(msg); }

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
          return segmentations_.getNumSubscribers() > 0 && poses_.getNumSubscribers() > 0 &&
                 models_.getNumPublishers() > 0;
        },
        "the node");
  }

  // What the node says of the model after a message, which makes it fit again.
  template <class Message>
  calipso_msgs::AlignedModel answerTo(const ros::Publisher& publisher, const Message& message,
                                      const ros::Time& stamp) {
    waitForNode();
    // Results of another test's message may still be on their way.
    const size_t before = received_.size();
    publisher.publish(message);
    waitFor([&] { return received_.size() > before && received_.back()->header.stamp == stamp; },
            "the models");
    if (received_.empty() || received_.back()->models.size() != 1) {
      ADD_FAILURE() << "there is no model";
      return {};
    }
    return received_.back()->models[0];
  }

  calipso_msgs::AlignedModel answerTo(const calipso_msgs::Segmentation& message) {
    return answerTo(segmentations_, message, message.header.stamp);
  }

  // How many models of this key frame have come.
  long countOf(const ros::Time& stamp) const {
    return std::count_if(received_.begin(), received_.end(),
                         [&](const auto& msg) { return msg->header.stamp == stamp; });
  }

  ros::NodeHandle nh_;
  ros::Publisher segmentations_, poses_;
  ros::Subscriber models_;
  std::vector<calipso_msgs::AlignedModelsConstPtr> received_;
};

geometry_msgs::PoseStamped placedAt(double x, double y) {
  geometry_msgs::PoseStamped pose;
  pose.header.frame_id = "map";
  pose.pose.position.x = x;
  pose.pose.position.y = y;
  pose.pose.orientation.w = 1.0;
  return pose;
}

void expectFlag(const calipso_msgs::AlignedModel& model, const std::string& reason) {
  EXPECT_FALSE(model.trusted);
  EXPECT_NE(model.reason.find(reason), std::string::npos) << model.reason;
  EXPECT_FALSE(model.mesh.vertices.empty());  // marked, never left out
}

TEST_F(AlignNode, AlignsTheKeyFrame) {
  const calipso_msgs::AlignedModel model = answerTo(keyFrame());
  EXPECT_EQ(received_.back()->header.frame_id, "map");
  EXPECT_EQ(model.object, "disc");
  EXPECT_EQ(model.mesh.triangles, model.cad.triangles);
  EXPECT_TRUE(model.trusted) << model.reason;
  EXPECT_LT(model.contour_mean_px, 1.0f);  // straight edges against straight edges
}

TEST_F(AlignNode, FlagsARoughPoseThatIsOfNoUse) {
  const ros::Time stamp(3.0);
  EXPECT_TRUE(answerTo(keyFrame(stamp, {tippedSquare(82.0, 58.0, 33.0)})).trusted);
  expectFlag(answerTo(poses_, placedAt(0.0, -1.0), stamp), "behind the camera");
  expectFlag(answerTo(poses_, placedAt(4.0, 1.0), stamp), "off the image");
  EXPECT_TRUE(answerTo(poses_, placedAt(0.0, 1.0), stamp).trusted);
}

TEST_F(AlignNode, FlagsAMaskThatIsEmpty) {
  expectFlag(answerTo(keyFrame(ros::Time(4.0), {tippedSquare(82.0, 58.0, 33.0)}, "something_else")),
             "add strokes");
}

TEST_F(AlignNode, FlagsAMaskThatFillsTheImage) {
  expectFlag(answerTo(keyFrame(ros::Time(5.0), {tippedSquare(79.5, 59.5, 400.0)})),
             "contour mostly unknown");
}

TEST_F(AlignNode, FlagsAContourOfTwoPieces) {
  expectFlag(answerTo(keyFrame(ros::Time(6.0),
                               {tippedSquare(60.0, 58.0, 15.0), tippedSquare(100.0, 58.0, 15.0)})),
             "separate pieces");
}

TEST_F(AlignNode, SaysThatTheImageBorderCutsTheObject) {
  const calipso_msgs::AlignedModel model =
      answerTo(keyFrame(ros::Time(7.0), {tippedSquare(79.5, 100.0, 33.0)}));
  EXPECT_NE(model.reason.find("cut by the image border"), std::string::npos) << model.reason;
}

TEST_F(AlignNode, SendsTheModelsOfAKeyFrameThatComesAgainWithoutFittingThemAnew) {
  const ros::Time stamp(8.0);
  const auto key = keyFrame(stamp, {tippedSquare(82.0, 58.0, 33.0)});
  for (int sent = 0; sent < 2; ++sent) answerTo(key);
  ASSERT_EQ(countOf(stamp), 2);
  EXPECT_TRUE(sameMessage(*received_[received_.size() - 2], *received_.back()))
      << "the time that a fit takes is never the same";
}

// As rviz does, at any time of a run; who has models would prepare anew.
TEST_F(AlignNode, SendsWhoListensToMarkersThoseAlone) {
  const ros::Time stamp(10.0);
  answerTo(keyFrame(stamp, {tippedSquare(82.0, 58.0, 33.0)}));
  visualization_msgs::MarkerArrayConstPtr markers;
  const ros::Subscriber listener = nh_.subscribe<visualization_msgs::MarkerArray>(
      topics::kMarkers, 1, [&](const auto& msg) { markers = msg; });
  waitFor([&] { return markers && markers->markers[0].header.stamp == stamp; }, "the markers");
  answerTo(keyFrame(ros::Time(11.0), {tippedSquare(82.0, 58.0, 33.0)}));
  EXPECT_EQ(countOf(stamp), 1);
}

class AlignNodeInMillimetres : public AlignNode {
 protected:
  AlignNodeInMillimetres() : AlignNode("in_mm") {}
};

TEST_F(AlignNodeInMillimetres, FlagsTheMeshAndOffersTheScale) {
  const calipso_msgs::AlignedModel model = answerTo(keyFrame());
  expectFlag(model, "size implausible");
  const size_t at = model.reason.find("scaled by ");
  ASSERT_NE(at, std::string::npos) << model.reason;
  EXPECT_NEAR(std::stod(model.reason.substr(at + 10)), 1e-3, 3e-4);
}

TEST(AlignRos, NamesObjectsThatWouldShareAPoseTopic) {
  ros::NodeHandle nh, pnh("~like_names");
  try {
    AlignRos node(nh, pnh);
    FAIL() << "nothing was thrown";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("'disc 1' and 'disc-1'"), std::string::npos)
        << error.what();
  }
}

}  // namespace
}  // namespace calipso::align

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "align_node_rostest");
  return RUN_ALL_TESTS();
}
