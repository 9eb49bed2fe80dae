#pragma once

#include <calipso_msgs/ObjectContour.h>
#include <calipso_msgs/Segmentation.h>
#include <sensor_msgs/Image.h>
#include <std_msgs/Header.h>

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_align/contour.hpp"

namespace calipso::align {

calipso_msgs::ObjectContour toMsg(const ObjectContour& contour);
// @throw std::invalid_argument naming object and loop whose arrays differ in length
ObjectContour fromMsg(const calipso_msgs::ObjectContour& contour);

// labels: CV_8U. Frames that were only tracked have no contours.
calipso_msgs::Segmentation toMsg(const std_msgs::Header& header, const cv::Mat& labels,
                                 const std::vector<ObjectContour>& contours, float confidence);

// CV_8UC3, BGR; shares the message's memory where the encoding allows.
// @throw std::invalid_argument naming encoding or size of a message that is no colour or grey
// picture
cv::Mat colourImageFromMsg(const sensor_msgs::ImageConstPtr& image);

// CV_8U. @throw std::invalid_argument naming the encoding when it is not mono8
cv::Mat labelsFromMsg(const sensor_msgs::Image& image);

}  // namespace calipso::align
