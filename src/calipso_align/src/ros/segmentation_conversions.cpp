#include "ros/segmentation_conversions.hpp"

#include <cv_bridge/cv_bridge.h>
#include <sensor_msgs/image_encodings.h>

#include <stdexcept>
#include <string>

namespace calipso::align {
namespace {

void checkSize(const sensor_msgs::Image& image) {
  if (image.width == 0 || image.height == 0 ||
      image.data.size() < static_cast<size_t>(image.step) * image.height)
    throw std::invalid_argument(
        "image of " + std::to_string(image.width) + "x" + std::to_string(image.height) + " with " +
        std::to_string(image.data.size()) + " bytes is empty or cut short; publish whole frames");
}

calipso_msgs::Contour toMsg(const ContourLoop& loop) {
  calipso_msgs::Contour msg;
  for (size_t i = 0; i < loop.points.size(); ++i) {
    msg.u.push_back(static_cast<float>(loop.points[i].x()));
    msg.v.push_back(static_cast<float>(loop.points[i].y()));
    msg.confidence.push_back(loop.confidence[i]);
    msg.known.push_back(loop.known[i]);
  }
  msg.hole = loop.hole;
  return msg;
}

}  // namespace

calipso_msgs::ObjectContour toMsg(const ObjectContour& contour) {
  calipso_msgs::ObjectContour msg;
  msg.object = contour.object;
  msg.index = static_cast<std::uint8_t>(contour.label);
  for (const ContourLoop& loop : contour.loops) msg.loops.push_back(toMsg(loop));
  return msg;
}

ObjectContour fromMsg(const calipso_msgs::ObjectContour& msg) {
  ObjectContour contour{msg.object, msg.index, {}};
  for (size_t k = 0; k < msg.loops.size(); ++k) {
    const calipso_msgs::Contour& loop = msg.loops[k];
    const size_t n = loop.u.size();
    if (loop.v.size() != n || loop.confidence.size() != n || loop.known.size() != n)
      throw std::invalid_argument("contour of '" + msg.object + "', loop " + std::to_string(k) +
                                  ": u, v, confidence and known have lengths " + std::to_string(n) +
                                  ", " + std::to_string(loop.v.size()) + ", " +
                                  std::to_string(loop.confidence.size()) + ", " +
                                  std::to_string(loop.known.size()) + "; make them equal");
    ContourLoop points;
    points.hole = loop.hole;
    points.confidence = loop.confidence;
    for (size_t i = 0; i < n; ++i) {
      points.points.emplace_back(loop.u[i], loop.v[i]);
      points.known.push_back(loop.known[i]);
    }
    contour.loops.push_back(std::move(points));
  }
  return contour;
}

calipso_msgs::Segmentation toMsg(const std_msgs::Header& header, const cv::Mat& labels,
                                 const std::vector<ObjectContour>& contours, float confidence) {
  calipso_msgs::Segmentation msg;
  msg.header = header;
  cv_bridge::CvImage(header, sensor_msgs::image_encodings::MONO8, labels).toImageMsg(msg.labels);
  for (const ObjectContour& contour : contours) msg.contours.push_back(toMsg(contour));
  msg.confidence = confidence;
  return msg;
}

cv::Mat colourImageFromMsg(const sensor_msgs::ImageConstPtr& image) {
  checkSize(*image);
  try {
    return cv_bridge::toCvShare(image, sensor_msgs::image_encodings::BGR8)->image;
  } catch (const std::exception& error) {
    throw std::invalid_argument("image encoding '" + image->encoding +
                                "' is no colour or grey picture; publish bgr8 or rgb8 (" +
                                error.what() + ")");
  }
}

cv::Mat labelsFromMsg(const sensor_msgs::Image& image) {
  checkSize(image);
  if (image.encoding != sensor_msgs::image_encodings::MONO8)
    throw std::invalid_argument(
        "label image has encoding '" + image.encoding +
        "'; publish mono8 (0 none, 255 background, else the object's index)");
  return cv_bridge::toCvCopy(image)->image;
}

}  // namespace calipso::align
