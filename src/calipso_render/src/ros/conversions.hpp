#pragma once

#include <calipso_msgs/AlignedModels.h>
#include <calipso_msgs/ClipDynamics.h>
#include <calipso_msgs/ObjectState.h>
#include <calipso_msgs/SimulationState.h>
#include <sensor_msgs/Image.h>

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/clip_poses.hpp"
#include "calipso_render/pixel_format.hpp"
#include "calipso_render/renderer.hpp"

namespace calipso::render {

// The message's bytes as a matrix that shares them. The message must outlive it.
// @throw std::invalid_argument naming encoding, or a data size that does not fit height and step
cv::Mat viewOf(const sensor_msgs::Image& image, PixelFormat format);

// The picture as CV_8UC3 BGR. @throw as viewOf() and pixelFormat()
cv::Mat bgrFromMsg(const sensor_msgs::Image& image);

// Labels of a Segmentation, CV_8UC1. @throw std::invalid_argument unless mono8
cv::Mat labelsFromMsg(const sensor_msgs::Image& image);

// `original` with the pixels of `output` that changed; every other byte as it was.
sensor_msgs::Image editedMsg(const sensor_msgs::Image& original, const FrameOutput& output);

// 8-bit picture: CV_8UC1 as mono8, CV_8UC3 as bgr8.
sensor_msgs::Image imageMsg(const std_msgs::Header& header, const cv::Mat& image);

std::vector<ObjectModel> fromMsg(const calipso_msgs::AlignedModels& models);

// Of the objects that were followed as rigid bodies: the key frame's if none says that it moves, as
// poses at rest err.
PosesByStamp posesFromMsg(const calipso_msgs::ClipDynamics& dynamics,
                          const std::vector<ObjectModel>& models);

SunChange sunFromMsg(const calipso_msgs::SimulationState& state);
ObjectInFrame fromMsg(const calipso_msgs::ObjectState& state);

}  // namespace calipso::render
