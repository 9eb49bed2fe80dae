#include "calipso_bag/image_source.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>
#include <stdexcept>

#include "temporary_folder.hpp"

using namespace calipso::bag;

namespace {

void writeGrey(const std::string& path, int value, cv::Size size = {8, 6}) {
  cv::imwrite(path, cv::Mat(size, CV_8UC3, cv::Scalar::all(value)));
}

int greyOf(const std::optional<cv::Mat>& image) { return image->at<cv::Vec3b>(0, 0)[0]; }

}  // namespace

TEST(Sequence, GivesItsFramesInOrder) {
  const TemporaryFolder folder;
  for (int i = 0; i < 3; ++i) writeGrey(folder / (std::to_string(i) + ".png"), 10 * i);
  const auto source = openSequence(folder / "", "%d.png", 3, 25.0);
  EXPECT_DOUBLE_EQ(source->fps(), 25.0);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(greyOf(source->next()), 10 * i);
  EXPECT_FALSE(source->next());
}

TEST(Sequence, NamesAMissingFrameAndAChangeOfSize) {
  const TemporaryFolder folder;
  writeGrey(folder / "0.png", 1);
  writeGrey(folder / "1.png", 1, {9, 6});
  const auto sizes = openSequence(folder / "", "%d.png", 3, 25.0);
  sizes->next();
  EXPECT_NE(messageOf([&] { sizes->next(); }).find("9x6"), std::string::npos);
  EXPECT_NE(messageOf([&] { sizes->next(); }).find("2.png"), std::string::npos);
}

TEST(Sequence, RejectsPatternsThatAreNotOneInteger) {
  for (const char* pattern : {"%s.png", "%d%d.png", "%n.png", "0.png", "%*d.png"}) {
    EXPECT_THROW(openSequence("", pattern, 1, 25.0), std::invalid_argument) << pattern;
  }
}

TEST(Sequence, RefusesToBeEmptyAndNamesItsFirstFrame) {
  for (const int count : {0, -1}) {
    const std::string said = messageOf([&] { openSequence("clip", "%03d.png", count, 25.0); });
    EXPECT_NE(said.find("clip/000.png"), std::string::npos) << said;
    EXPECT_NE(said.find("number them from 0"), std::string::npos) << said;
  }
}

TEST(HoldLast, ContinuesAShortClip) {
  const TemporaryFolder folder;
  writeGrey(folder / "still.png", 77);
  const auto source = holdLast(openVideo(folder / "still.png"), 4);
  for (int i = 0; i < 4; ++i) EXPECT_EQ(greyOf(source->next()), 77);
  EXPECT_FALSE(source->next());
}

TEST(HoldLast, LeavesALongClipAlone) {
  const TemporaryFolder folder;
  for (int i = 0; i < 3; ++i) writeGrey(folder / (std::to_string(i) + ".png"), i);
  const auto source = holdLast(openSequence(folder / "", "%d.png", 3, 25.0), 2);
  int count = 0;
  while (source->next()) ++count;
  EXPECT_EQ(count, 3);
}

// A download that was cut short still opens.
TEST(OpenVideo, SaysThatAVideoIsIncomplete) {
  const TemporaryFolder folder;
  const cv::Size size(64, 48);
  const int all = 40;
  cv::VideoWriter writer(folder / "whole.avi", cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25.0,
                         size);
  cv::Mat noise(size, CV_8UC3);
  cv::RNG random(1);
  for (int k = 0; k < all; ++k) {
    random.fill(noise, cv::RNG::UNIFORM, 0, 255);
    writer.write(noise);
  }
  writer.release();
  const auto count = [](const std::string& path) {
    const auto source = openVideo(path);
    int frames = 0;
    while (source->next()) ++frames;
    return frames;
  };
  EXPECT_EQ(count(folder / "whole.avi"), all);
  std::filesystem::copy(folder / "whole.avi", folder / "part.avi");
  std::filesystem::resize_file(folder / "part.avi",
                               std::filesystem::file_size(folder / "whole.avi") / 2);
  const std::string said = messageOf([&] { count(folder / "part.avi"); });
  EXPECT_NE(said.find("of 40 frames"), std::string::npos) << said;
}

TEST(OpenVideo, NamesAFileThatIsNeitherVideoNorImage) {
  const TemporaryFolder folder;
  std::ofstream(folder / "notes.txt") << "words";
  EXPECT_NE(messageOf([&] { openVideo(folder / "notes.txt"); }).find("notes.txt"),
            std::string::npos);
}
