#pragma once

#include <ros/time.h>

#include <functional>
#include <opencv2/core.hpp>
#include <string>

namespace calipso::bag {

// Calls `use(image as BGR, its stamp)` for every image of a topic, raw or compressed.
// @throw std::runtime_error naming bag and topic when there is no such image
void forEachImage(const std::string& bag_path, const std::string& topic,
                  const std::function<void(const cv::Mat&, const ros::Time&)>& use);

}  // namespace calipso::bag
