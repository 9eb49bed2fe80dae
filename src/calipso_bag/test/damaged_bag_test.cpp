#include <calipso_msgs/EditReport.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "ros/bag_clip.hpp"
#include "ros/bag_images.hpp"
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
    test_clip::write(bag, test_clip::image(1.0));
    test_clip::write(bag, test_clip::info(1.0));
    calipso_msgs::EditReport report;
    report.header.stamp = ros::Time(1.0);
    report.accepted = true;
    report.edit.kind = calipso_msgs::Edit::GRAVITY;
    bag.write("/calipso/edits/applied", ros::Time(1.0), report);
    bag.close();
  }

  // Its index stays; what the index points to cannot be decompressed.
  void damage() const {
    std::fstream file(path_, std::ios::in | std::ios::out | std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(file), {}};
    const std::size_t chunk = bytes.find("BZh");  // bzip2's signature
    ASSERT_NE(chunk, std::string::npos);
    file.seekp(static_cast<std::streamoff>(chunk) + 20);
    file << std::string(32, '\xff');
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
  damage();
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

TEST_F(DamagedBagTest, ATopicOfOtherMessagesIsNotDamage) {
  const std::string text = messageOf(
      [&] { forEachImage(path_, "/camera/camera_info", [](const cv::Mat&, const ros::Time&) {}); });
  EXPECT_NE(text.find("sensor_msgs/CameraInfo; give a topic of pictures"), std::string::npos)
      << text;
}
