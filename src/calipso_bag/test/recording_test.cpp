#include <calipso_msgs/EditReport.h>
#include <gtest/gtest.h>
#include <rosbag/view.h>
#include <std_msgs/String.h>
#include <sys/resource.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "ros/edit_files.hpp"
#include "ros/output_bag.hpp"
#include "ros/stamped_writer.hpp"
#include "temporary_folder.hpp"

using namespace calipso;
using namespace calipso::bag;

namespace {

std_msgs::StringConstPtr text(const std::string& words) {
  const auto message = boost::make_shared<std_msgs::String>();
  message->data = words;
  return message;
}

std::string wordsIn(const std::string& path, const std::string& topic) {
  rosbag::Bag bag(path, rosbag::bagmode::Read);
  rosbag::View view(bag, rosbag::TopicQuery(topic));
  std::string words;
  for (const rosbag::MessageInstance& message : view) {
    words += message.instantiate<std_msgs::String>()->data + " ";
  }
  return words;
}

Scene sceneWithPear() {
  Scene scene;
  scene.objects.resize(1);
  scene.objects[0].name = "pear";
  return scene;
}

}  // namespace

TEST(OutputBag, HasItsNameOnlyWhenItIsFinished) {
  const TemporaryFolder folder;
  const std::string path = folder / "new/folder/out.bag";
  {
    OutputBag output(path);
    output.write("/words", ros::Time(1.0), *text("a"));
    EXPECT_FALSE(std::filesystem::exists(path));
  }
  EXPECT_FALSE(std::filesystem::exists(path)) << "an unfinished bag must not look complete";
  OutputBag output(path);
  output.write("/words", ros::Time(1.0), *text("a"));
  output.finish();
  EXPECT_EQ(wordsIn(path, "/words"), "a ");
  EXPECT_FALSE(std::filesystem::exists(path + ".active"));
}

TEST(OutputBag, LeavesWhatWasWrittenOrNothing) {
  const TemporaryFolder folder;
  { OutputBag output(folder / "empty.bag"); }
  EXPECT_TRUE(std::filesystem::is_empty(folder / ""));
  {
    OutputBag output(folder / "begun.bag");
    output.write("/words", ros::Time(1.0), *text("a"));
  }
  EXPECT_EQ(wordsIn(folder / "begun.bag.active", "/words"), "a ") << "closed, with its index";
}

TEST(OutputBag, SaysWhereItCannotBeWritten) {
  const TemporaryFolder folder;
  std::ofstream(folder / "file") << "not a folder";
  const std::string text = messageOf([&] { OutputBag output(folder / "file/out.bag"); });
  EXPECT_NE(text.find("file/out.bag: cannot be written"), std::string::npos) << text;
}

TEST(OutputBag, RefusesAFolderAtOnce) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "old");
  for (const std::string& path : {folder / "old", folder / "old/", folder / "new/"}) {
    const std::string text = messageOf([&] { OutputBag output(path); });
    EXPECT_NE(text.find("is a folder"), std::string::npos) << text;
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "new"));
}

TEST(OutputBag, DoesNotReplaceItsInput) {
  const TemporaryFolder folder;
  const std::string path = folder / "in.bag";
  std::ofstream(path) << "a bag";
  const std::string text = messageOf([&] { OutputBag output(folder / "./in.bag", {path}); });
  EXPECT_NE(text.find("in.bag"), std::string::npos) << text;
  EXPECT_NE(text.find("give another path"), std::string::npos) << text;
  EXPECT_FALSE(std::filesystem::exists(path + ".active"));
  EXPECT_NO_THROW(OutputBag(folder / "out.bag", {path}));
  EXPECT_TRUE(std::filesystem::exists(path));
  // Nor any other file that is read, nor what an interrupted run has left.
  const std::string kept = folder / "kept.bag.active";
  std::ofstream(kept) << "a bag";
  const std::string left = messageOf([&] { OutputBag output(folder / "kept.bag", {path, kept}); });
  EXPECT_NE(left.find("kept.bag.active: is read"), std::string::npos) << left;
  EXPECT_EQ(std::filesystem::file_size(kept), 5u);
}

TEST(OutputBag, SaysWhereTheWholeBagIsThatCannotHaveItsName) {
  const TemporaryFolder folder;
  OutputBag output(folder / "out.bag");
  std::filesystem::create_directory(folder / "out.bag");
  const std::string text = messageOf([&] { output.finish(); });
  EXPECT_NE(text.find("out.bag.active: rename it"), std::string::npos) << text;
  EXPECT_EQ(text.find("make room"), std::string::npos) << text;
}

// A limit on the size of files stands for a disk that is full.
TEST(OutputBag, SaysWhenTheDiskIsFullAndCanBeLeft) {
  const TemporaryFolder folder;
  const auto limitFiles = [](rlim_t bytes) {
    rlimit limit{};
    getrlimit(RLIMIT_FSIZE, &limit);
    limit.rlim_cur = std::min(bytes, limit.rlim_max);
    setrlimit(RLIMIT_FSIZE, &limit);
  };
  const auto on_excess = std::signal(SIGXFSZ, SIG_IGN);
  limitFiles(1 << 16);
  const std::string said = messageOf([&] {
    OutputBag output(folder / "out.bag");
    for (int i = 1; i < 1000; ++i)
      output.write("/words", ros::Time(i), *text(std::string(10000, 'a')));
    output.finish();
  });
  limitFiles(RLIM_INFINITY);
  std::signal(SIGXFSZ, on_excess);
  EXPECT_NE(said.find("out.bag: cannot be written"), std::string::npos) << said;
  EXPECT_NE(said.find("make room"), std::string::npos) << said;
}

TEST(StampedWriter, OrdersByStampThenRankAndKeepsTheFirst) {
  const TemporaryFolder folder;
  OutputBag output(folder / "out.bag");
  StampedWriter writer(output);
  writer.add<std_msgs::String>("/b", ros::Time(2.0), "", text("late"));
  writer.add<std_msgs::String>("/b", ros::Time(1.0), "", text("early"));
  writer.add<std_msgs::String>("/a", ros::Time(1.0), "y", text("second"));
  writer.add<std_msgs::String>("/a", ros::Time(1.0), "x", text("first"));
  writer.add<std_msgs::String>("/a", ros::Time(1.0), "x", text("doubled"));
  writer.flush(ros::Time(1.0));
  writer.add<std_msgs::String>("/a", ros::Time(2.0), "", text("third"));
  writer.flushAll();
  output.finish();
  EXPECT_EQ(wordsIn(folder / "out.bag", "/a"), "first second third ");
  EXPECT_EQ(wordsIn(folder / "out.bag", "/b"), "early late ");
}

// Two recordings of the same messages that arrived in different orders are the same file.
TEST(StampedWriter, ArrivalDoesNotShow) {
  const TemporaryFolder folder;
  const auto record = [&](const std::string& name, bool swapped) {
    OutputBag output(folder / name);
    StampedWriter writer(output);
    for (int i = 0; i < 2; ++i) {
      const std::string topic = (i == 1) != swapped ? "/a" : "/b";
      writer.add<std_msgs::String>(topic, ros::Time(1.0), "", text(topic));
    }
    writer.flushAll();
    output.finish();
    std::ifstream file(folder / name, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  EXPECT_EQ(record("one.bag", false), record("other.bag", true));
}

TEST(ReadEdits, NoneMeansNone) {
  EXPECT_TRUE(readEdits("", sceneWithPear(), ros::Time(1.0)).empty());
  EXPECT_TRUE(readEdits("", sceneWithPear(), ros::Time(1.0)).empty());
}

TEST(ReadEdits, YamlTimesCountFromTheFirstFrame) {
  const TemporaryFolder folder;
  std::ofstream(folder / "edits.yaml")
      << "- {t: 0.5, object: pear, kind: material, mode: factor, youngs_modulus: 2}\n"
         "- {t: 0.25, object: pear, kind: remove}\n";
  const auto edits = readEdits(folder / "edits.yaml", sceneWithPear(), ros::Time(10.0));
  ASSERT_EQ(edits.size(), 2u);
  EXPECT_EQ(edits[0].kind, "remove");
  EXPECT_EQ(edits[0].header.stamp, ros::Time(10.25));
  EXPECT_EQ(edits[1].header.stamp, ros::Time(10.5));
  EXPECT_DOUBLE_EQ(edits[1].youngs_modulus, 2.0);
}

TEST(ReadEdits, AnEditedBagRepeatsWhatWasApplied) {
  const TemporaryFolder folder;
  calipso_msgs::EditReport report;
  report.header.stamp = ros::Time(10.3);
  report.accepted = true;
  report.edit.object = "pear";
  report.edit.kind = calipso_msgs::Edit::REMOVE;
  calipso_msgs::EditReport refused = report;
  refused.accepted = false;
  {
    rosbag::Bag bag(folder / "edited.bag", rosbag::bagmode::Write);
    bag.write("/calipso/edits/applied", ros::Time(10.3), report);
    bag.write("/calipso/edits/applied", ros::Time(10.4), refused);
  }
  const auto edits = readEdits(folder / "edited.bag", sceneWithPear(), ros::Time(10.0));
  ASSERT_EQ(edits.size(), 1u);
  EXPECT_EQ(edits[0].header.stamp, ros::Time(10.3)) << "sent for the next frame: that one";
}

TEST(ReadEdits, NamesFileAndUnknownObject) {
  const TemporaryFolder folder;
  std::ofstream(folder / "edits.yaml") << "- {t: 0, object: plum, kind: remove}\n";
  const std::string text =
      messageOf([&] { readEdits(folder / "edits.yaml", sceneWithPear(), ros::Time(10.0)); });
  EXPECT_NE(text.find("edits.yaml"), std::string::npos) << text;
  EXPECT_NE(text.find("plum"), std::string::npos) << text;
  EXPECT_NE(text.find("pear"), std::string::npos) << text;
}
