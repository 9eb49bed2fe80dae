#include "ros/bag_clip.hpp"

#include <gtest/gtest.h>
#include <tf2_msgs/TFMessage.h>

#include <filesystem>
#include <functional>

#include "ros/camera_path.hpp"
#include "ros/clip_writer.hpp"
#include "temporary_folder.hpp"
#include "test_clip.hpp"

using namespace calipso;
using namespace calipso::bag;

namespace {

class BagClipTest : public ::testing::Test {
 protected:
  // What opening a bag complains about, after `fill` has written it.
  std::string complaint(const std::function<void(rosbag::Bag&)>& fill,
                        BagClip::Params params = {}) {
    write(fill);
    params.path = path_;
    return messageOf([&] { BagClip clip(params); });
  }

  void write(const std::function<void(rosbag::Bag&)>& fill) {
    rosbag::Bag bag(path_, rosbag::bagmode::Write);
    fill(bag);
  }

  TemporaryFolder folder_;
  std::string path_ = folder_ / "clip.bag";
};

void expectSays(const std::string& text, const std::string& part) {
  EXPECT_NE(text.find(part), std::string::npos) << "'" << part << "' is not in: " << text;
}

void fillGood(rosbag::Bag& bag) {
  for (int i = 0; i < 3; ++i) {
    test_clip::write(bag, test_clip::image(1.0 + 0.1 * i, static_cast<unsigned char>(i)));
    test_clip::write(bag, test_clip::info(1.0 + 0.1 * i));
  }
}

}  // namespace

TEST_F(BagClipTest, ReadsEveryFrameOnceInEachPass) {
  write(fillGood);
  BagClip clip({path_, "", ""});
  ASSERT_EQ(clip.frameCount(), 3);
  EXPECT_NEAR(clip.fps(), 10.0, 1e-6);  // stamps are whole nanoseconds
  for (int pass = 0; pass < 2; ++pass) {
    BagClip::Reader reader = clip.reader();
    for (int i = 0; i < 3; ++i) {
      const BagFrame frame = reader.next();
      EXPECT_EQ(frame.image->data[0], i);
      EXPECT_EQ(frame.image->header.stamp, clip.stamps()[static_cast<std::size_t>(i)]);
      EXPECT_EQ(frame.info->header.stamp, frame.image->header.stamp);
    }
  }
}

TEST_F(BagClipTest, ASingleCameraInfoServesEveryFrame) {
  write([](rosbag::Bag& bag) {
    test_clip::write(bag, test_clip::info(1.0));
    for (int i = 0; i < 3; ++i) test_clip::write(bag, test_clip::image(1.0 + 0.1 * i));
  });
  BagClip clip({path_, "", ""});
  BagClip::Reader reader = clip.reader();
  reader.next();
  const BagFrame second = reader.next();
  EXPECT_DOUBLE_EQ(second.info->K[0], 10.0);
  EXPECT_EQ(second.info->header.stamp, second.image->header.stamp);
}

TEST_F(BagClipTest, RectifiedImagesHaveTheirOwnFocalLength) {
  write([](rosbag::Bag& bag) {
    sensor_msgs::CameraInfo info = test_clip::info(1.0);
    info.D = {-0.3, 0.1, 0.0, 0.0, 0.0};
    info.P = {9.0, 0.0, 3.5, 0.0, 0.0, 9.0, 2.5, 0.0, 0.0, 0.0, 1.0, 0.0};
    test_clip::write(bag, info);
    bag.write("/camera/image_rect", ros::Time(1.0), test_clip::image(1.0));
  });
  BagClip clip({path_, "", ""});
  EXPECT_DOUBLE_EQ(clip.reader().next().info->K[0], 9.0);
}

TEST_F(BagClipTest, CompressedImagesAreReadAsBgr) {
  Camera camera;
  camera.width = 16;
  camera.height = 16;
  camera.fx = camera.fy = 20.0;
  ClipWriter writer(path_, camera, 30.0, true);
  writer.add(cv::Mat(16, 16, CV_8UC3, cv::Scalar(10, 120, 230)), std::nullopt);
  writer.finish();
  BagClip clip({path_, "", ""});
  const BagFrame frame = clip.reader().next();
  EXPECT_EQ(frame.image->encoding, "bgr8");
  // JPEG at its default quality keeps a plain colour to within a few grey levels.
  EXPECT_NEAR(frame.image->data[0], 10, 4);
  EXPECT_NEAR(frame.image->data[2], 230, 4);
}

TEST_F(BagClipTest, SaysThatThereIsNoCameraInfo) {
  expectSays(complaint([](rosbag::Bag& bag) { test_clip::write(bag, test_clip::image(1.0)); }),
             "no camera_info");
}

TEST_F(BagClipTest, SaysThatTheImageTopicIsMissingAndWhichThereAre) {
  BagClip::Params params;
  params.image_topic = "/left/image_raw";
  const std::string text = complaint(fillGood, params);
  expectSays(text, "/left/image_raw");
  expectSays(text, "there: /camera/image_raw");
  expectSays(complaint([](rosbag::Bag&) {}), "no images; record");
}

TEST_F(BagClipTest, SaysThatTheSizeChanges) {
  expectSays(complaint([](rosbag::Bag& bag) {
               fillGood(bag);
               sensor_msgs::Image other = test_clip::image(2.0);
               other.height = 5;
               test_clip::write(bag, other);
             }),
             "image 3: size 8x5 after 8x6");
}

TEST_F(BagClipTest, SaysThatAnEncodingIsUnknown) {
  expectSays(complaint([](rosbag::Bag& bag) {
               fillGood(bag);
               sensor_msgs::Image other = test_clip::image(2.0);
               other.encoding = "bayer_rggb8";
               test_clip::write(bag, other);
             }),
             "encoding 'bayer_rggb8' is not known");
}

TEST_F(BagClipTest, SaysThatAnImageLacksData) {
  expectSays(complaint([](rosbag::Bag& bag) {
               sensor_msgs::Image image = test_clip::image(1.0);
               image.data.resize(20);
               test_clip::write(bag, image);
               test_clip::write(bag, test_clip::info(1.0));
             }),
             "do not fit its 20 bytes");
}

TEST_F(BagClipTest, SaysThatStampsDoNotIncrease) {
  expectSays(complaint([](rosbag::Bag& bag) {
               fillGood(bag);
               sensor_msgs::Image other = test_clip::image(1.05);
               bag.write("/camera/image_raw", ros::Time(3.0), other);
             }),
             "stamps must increase");
}

TEST_F(BagClipTest, SaysThatCameraInfoIsUncalibratedOrForAnotherSize) {
  const auto with = [&](const std::function<void(sensor_msgs::CameraInfo&)>& spoil) {
    return complaint([&](rosbag::Bag& bag) {
      sensor_msgs::CameraInfo info = test_clip::info(1.0);
      spoil(info);
      test_clip::write(bag, info);
      test_clip::write(bag, test_clip::image(1.0));
    });
  };
  expectSays(with([](sensor_msgs::CameraInfo& info) { info.K[0] = 0.0; }), "fx, fy, cx, cy = 0.0");
  expectSays(with([](sensor_msgs::CameraInfo& info) { info.width = 16; }), "is for 16x6");
  expectSays(with([](sensor_msgs::CameraInfo& info) { info.D = {0.1, 0, 0, 0, 0}; }), "undistort");
}

TEST_F(BagClipTest, SaysThatABagWasCutShort) {
  write(fillGood);
  std::filesystem::resize_file(path_, std::filesystem::file_size(path_) * 2 / 3);
  expectSays(messageOf([&] { BagClip clip({path_, "", ""}); }), "rosbag reindex");
  std::filesystem::resize_file(path_, 5);
  expectSays(messageOf([&] { BagClip clip({path_, "", ""}); }), "clip.bag");
  expectSays(messageOf([&] { BagClip clip({folder_ / "absent.bag", "", ""}); }), "absent.bag");
}

TEST_F(BagClipTest, CameraPathPrefersTheBagsTf) {
  write([](rosbag::Bag& bag) {
    fillGood(bag);
    tf2_msgs::TFMessage tf;
    tf.transforms.resize(2);
    tf.transforms[0].header.frame_id = "map";
    tf.transforms[0].child_frame_id = "arm";
    tf.transforms[0].transform.rotation.w = 1.0;
    tf.transforms[0].transform.translation.x = 2.0;
    tf.transforms[1].header.frame_id = "arm";
    tf.transforms[1].child_frame_id = "camera_optical_frame";
    tf.transforms[1].transform.rotation.w = 1.0;
    tf.transforms[1].transform.translation.y = 3.0;
    bag.write("/tf_static", ros::Time(1.0), tf);
  });
  BagClip clip({path_, "", ""});
  const CameraPath path = cameraPath(clip, Scene(), PoseSource::kAuto);
  ASSERT_EQ(path.world_from_camera.size(), 3u);
  EXPECT_DOUBLE_EQ(path.world_from_camera[1].transform.translation.x, 2.0);
  EXPECT_DOUBLE_EQ(path.world_from_camera[1].transform.translation.y, 3.0);
  EXPECT_EQ(path.world_from_camera[1].header.stamp, clip.stamps()[1]);
}

TEST_F(BagClipTest, CameraPathFallsBackToTheSceneAndSaysSo) {
  write(fillGood);
  BagClip clip({path_, "", ""});
  Scene scene;
  scene.camera.world_from_camera.translation() = Eigen::Vector3d(0.0, 0.0, 4.0);
  const CameraPath path = cameraPath(clip, scene, PoseSource::kAuto);
  EXPECT_DOUBLE_EQ(path.world_from_camera[2].transform.translation.z, 4.0);
  expectSays(path.origin, "the bag has no tf");
  expectSays(messageOf([&] { cameraPath(clip, scene, PoseSource::kBag); }), "poses:=scene");
}

TEST_F(BagClipTest, CameraPathOfAMovingCameraNeedsAPoseForEachFrame) {
  write(fillGood);
  BagClip clip({path_, "", ""});
  Scene scene;
  scene.world_from_camera_per_frame.assign(2, Eigen::Isometry3d::Identity());
  expectSays(messageOf([&] { cameraPath(clip, scene, PoseSource::kScene); }), "2 of the bag's 3");
}
