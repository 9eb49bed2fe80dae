#include <algorithm>
#include <cstdio>
#include <iostream>
#include <iterator>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "calipso_bag/arguments.hpp"
#include "ros/bag_images.hpp"
#include "ros/guarded_main.hpp"

using namespace calipso::bag;

namespace {

constexpr char kUsage[] =
    "usage: compare_bags ORIGINAL.bag TOPIC EDITED.bag TOPIC OUT.png [--rows N]\n"
    "  original and edited frames side by side, at N times spread over the clip (default 3)";

std::vector<ros::Time> stampsOf(const std::string& bag, const std::string& topic) {
  std::vector<ros::Time> stamps;
  forEachImage(bag, topic,
               [&](const cv::Mat&, const ros::Time& stamp) { stamps.push_back(stamp); });
  return stamps;
}

// Per stamp the image that is shown then: the last one up to it.
std::map<ros::Time, cv::Mat> imagesAt(const std::string& bag, const std::string& topic,
                                      const std::vector<ros::Time>& stamps) {
  std::map<ros::Time, cv::Mat> images;
  cv::Mat shown;
  std::size_t next = 0;
  const auto takeBefore = [&](const ros::Time& end) {
    for (; next < stamps.size() && stamps[next] < end; ++next)
      if (!shown.empty()) images[stamps[next]] = shown.clone();
  };
  forEachImage(bag, topic, [&](const cv::Mat& image, const ros::Time& stamp) {
    takeBefore(stamp);
    image.copyTo(shown);
  });
  takeBefore(ros::TIME_MAX);
  return images;
}

void label(cv::Mat& image, const std::string& text) {
  const cv::Point corner(12, 28);
  cv::putText(image, text, corner, cv::FONT_HERSHEY_SIMPLEX, 0.7, {0, 0, 0}, 4, cv::LINE_AA);
  cv::putText(image, text, corner, cv::FONT_HERSHEY_SIMPLEX, 0.7, {255, 255, 255}, 1, cv::LINE_AA);
}

cv::Mat sideBySide(cv::Mat original, cv::Mat edited, double seconds) {
  char time[32];
  std::snprintf(time, sizeof time, ", %.2f s", seconds);
  label(original, std::string("original") + time);
  label(edited, std::string("edited") + time);
  cv::Mat row;
  cv::hconcat(original, edited, row);
  return row;
}

std::string sizeOf(const cv::Mat& image) {
  return std::to_string(image.cols) + "x" + std::to_string(image.rows);
}

void checkSizes(const cv::Mat& original, const cv::Mat& edited) {
  if (original.size() == edited.size()) return;
  throw std::runtime_error("images of " + sizeOf(original) + " and of " + sizeOf(edited) +
                           "; give an original and what was made of it");
}

void compare(const Arguments& arguments) {
  if (!cv::haveImageWriter(arguments.word(4)))
    throw std::invalid_argument(arguments.word(4) + ": no kind of picture; end its name in .png");
  const int rows = std::max(1, static_cast<int>(arguments.positive("rows", 3)));
  const std::vector<ros::Time> stamps = stampsOf(arguments.word(2), arguments.word(3));
  std::vector<ros::Time> chosen;
  for (int i = 1; i <= rows; ++i)
    chosen.push_back(
        stamps[(stamps.size() - 1) * static_cast<std::size_t>(i) / static_cast<std::size_t>(rows)]);
  const auto original = imagesAt(arguments.word(0), arguments.word(1), chosen),
             edited = imagesAt(arguments.word(2), arguments.word(3), chosen);
  std::vector<cv::Mat> sheet;
  for (const ros::Time& stamp : chosen) {
    const auto before = original.find(stamp);
    if (before == original.end())
      throw std::runtime_error("the bags' stamps differ; give an original and what was made of it");
    checkSizes(before->second, edited.at(stamp));
    sheet.push_back(sideBySide(before->second.clone(), edited.at(stamp).clone(),
                               (stamp - stamps.front()).toSec()));
  }
  cv::Mat picture;
  cv::vconcat(sheet, picture);
  if (!cv::imwrite(arguments.word(4), picture)) {
    throw std::runtime_error(arguments.word(4) + ": cannot be written; check the folder");
  }
  std::cout << arguments.word(4) << ": " << rows << " times, original | edited\n";
}

}  // namespace

int main(int argc, char** argv) {
  return runTool([&] { compare(Arguments(argc, argv, 5, {"rows"}, {}, kUsage)); });
}
