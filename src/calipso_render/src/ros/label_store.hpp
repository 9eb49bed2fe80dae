#pragma once

#include <ros/time.h>

#include <cstdint>
#include <map>
#include <opencv2/core.hpp>
#include <vector>

namespace calipso::render {

// The label image of every frame of a clip, packed (a few kilobytes each), by stamp.
class LabelStore {
 public:
  // limit: label images kept; the oldest go first. 0: no limit
  explicit LabelStore(std::size_t limit = 0) : limit_(limit) {}

  void put(const ros::Time& stamp, const cv::Mat& labels);

  void forgetAfter(const ros::Time& stamp) {
    packed_.erase(packed_.upper_bound(stamp), packed_.end());
  }

  bool has(const ros::Time& stamp) const { return packed_.count(stamp) > 0; }

  ros::Time newest() const { return packed_.empty() ? ros::Time() : packed_.rbegin()->first; }

  // Labels at `stamp`, else the nearest before it, else an empty matrix.
  cv::Mat at(const ros::Time& stamp) const;
  // Their stamp: in slow motion that of the frame whose picture is shown again. Else `stamp`.
  ros::Time stampAt(const ros::Time& stamp) const;

 private:
  std::size_t limit_;
  std::map<ros::Time, std::vector<std::uint8_t>> packed_;
};

}  // namespace calipso::render
