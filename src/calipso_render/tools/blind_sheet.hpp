#pragma once

#include <opencv2/core.hpp>
#include <random>
#include <string>
#include <vector>

namespace calipso::render {

// Pairs of crops, one of the video and one composed, side by side in random order: somebody who
// does not know the key is to tell which is which. The key goes to another file.
class BlindSheet {
 public:
  explicit BlindSheet(const std::string& name) : name_(name) {}

  // @param place of the object; empty: nothing is added. @param frame its number, for the key
  void add(const cv::Mat& video, const cv::Mat& composed, const cv::Rect& place, int frame);

  // NAME_blind.png, and NAME_blind_key.txt: per pair, from the top, which side is the video's.
  void write(const std::string& folder) const;

 private:
  std::string name_;
  std::mt19937 random_{std::random_device{}()};
  std::vector<cv::Mat> pairs_;
  std::vector<std::string> key_;
};

}  // namespace calipso::render
