#include <calipso_msgs/EditReport.h>
#include <gtest/gtest.h>
#include <tf2_msgs/TFMessage.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "ros/bag_clip.hpp"
#include "ros/bag_images.hpp"
#include "ros/camera_path.hpp"
#include "ros/edit_files.hpp"
#include "temporary_folder.hpp"
#include "test_clip.hpp"

using namespace calipso;
using namespace calipso::bag;

namespace {

class DamagedBagTest : public ::testing::Test {
 protected:
  void SetUp() override {
    rosbag::Bag bag(path_, rosbag::bagmode::Write);
    bag.setCompression(rosbag::compression::BZ2);
    bag.setChunkThreshold(1);  // a message, a chunk
    test_clip::write(bag, test_clip::image(1.0));
    test_clip::write(bag, test_clip::info(1.0));
    calipso_msgs::EditReport report;
    report.header.stamp = ros::Time(1.0);
    report.accepted = true;
    report.edit.kind = calipso_msgs::Edit::GRAVITY;
    bag.write("/calipso/edits/applied", ros::Time(1.0), report);
    tf2_msgs::TFMessage tf;
    tf.transforms.resize(1);
    tf.transforms[0].header.stamp = ros::Time(1.0);
    tf.transforms[0].header.frame_id = "map";
    tf.transforms[0].child_frame_id = "camera_optical_frame";
    tf.transforms[0].transform.rotation.w = 1.0;
    bag.write("/tf", ros::Time(1.0), tf);
    bag.close();
  }

  // Its index stays; the messages from `first` on, as written above, cannot be decompressed.
  void damage(int first) const {
    const std::string kBzip2 = "BZh91AY";
    std::fstream file(path_, std::ios::in | std::ios::out | std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(file), {}};
    int chunks = 0;
    for (std::size_t at = bytes.find(kBzip2); at != std::string::npos;
         at = bytes.find(kBzip2, at + 1)) {
      if (chunks++ < first) continue;
      file.seekp(static_cast<std::streamoff>(at) + 20);
      file << std::string(32, '\xff');
    }
    ASSERT_EQ(chunks, 4);
  }

  // As a copy that was cut short is: its index is at the end.
  void cutShort() const {
    std::filesystem::resize_file(path_, std::filesystem::file_size(path_) - 200);
  }

  // What each reader of bags complains about.
  std::vector<std::string> complaints() const {
    return {messageOf([&] {
              BagClip clip({path_, "", ""});
            }),
            messageOf([&] {
              forEachImage(path_, "/camera/image_raw", [](const cv::Mat&, const ros::Time&) {});
            }),
            messageOf([&] { readEdits(path_, Scene(), ros::Time(1.0)); })};
  }

  TemporaryFolder folder_;
  std::string path_ = folder_ / "some.bag";
};

}  // namespace

TEST_F(DamagedBagTest, IsReadByAllWhileItIsWhole) {
  for (const std::string& text : complaints()) EXPECT_EQ(text, "nothing was thrown");
}

TEST_F(DamagedBagTest, IsNamedWithTheRemedy) {
  damage(0);
  for (const std::string& text : complaints()) {
    EXPECT_EQ(text.find(path_ + ": damaged ("), 0u) << text;
    EXPECT_NE(text.find("'rosbag reindex -f'"), std::string::npos) << text;
  }
}

TEST_F(DamagedBagTest, ThatWasCutShortIsNamedWithTheRemedy) {
  cutShort();
  for (const std::string& text : complaints()) {
    EXPECT_EQ(text.find(path_ + ": cannot be read as a bag ("), 0u) << text;
    EXPECT_NE(text.find("'rosbag reindex'"), std::string::npos) << text;
  }
}

TEST_F(DamagedBagTest, IsNamedWhenOnlyTfCannotBeRead) {
  const auto pathOf = [&] {
    BagClip clip({path_, "", ""});
    cameraPath(clip, Scene(), PoseSource::kBag);
  };
  EXPECT_NO_THROW(pathOf());
  damage(3);
  const std::string text = messageOf(pathOf);
  EXPECT_EQ(text.find(path_ + ": damaged ("), 0u) << text;
}

TEST_F(DamagedBagTest, ATopicOfOtherMessagesIsNotDamage) {
  const std::string text = messageOf(
      [&] { forEachImage(path_, "/camera/camera_info", [](const cv::Mat&, const ros::Time&) {}); });
  EXPECT_NE(text.find("sensor_msgs/CameraInfo; give a topic of pictures"), std::string::npos)
      << text;
}
