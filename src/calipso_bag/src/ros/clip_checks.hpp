#pragma once

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <set>
#include <string>

#include "calipso_scene/scene.hpp"

namespace calipso::bag {

// Each throws std::runtime_error naming what is wrong, the value and the remedy.
// `where`: what is being checked, e.g. "in.bag: image 12".

// A picture that belongs to the video: of its size, and deep enough. bits: 8 or 16 per channel.
// path: "" for none
void checkPicture(const std::string& path, int bits, int width, int height);

// Strokes mark nothing but background and these objects.
// path: of a readable picture (checkPicture), "" for none; indices: of the scene's objects
void checkStrokes(const std::string& path, const std::set<int>& indices);

// At its rough place the model is about as large as the object's rectangle: models are in metres.
void checkModelSize(const SceneObject& object, const TriangleMesh& model, const Camera& camera);

// Encoding known, 8 bit, data complete.
void checkImage(const sensor_msgs::Image& image, const std::string& where);

// Same size and frame as the clip's first image, and later than the one before.
void checkFollows(const sensor_msgs::Image& image, const sensor_msgs::Image& first,
                  const ros::Time& previous, const std::string& where);

// Calibrated, without distortion, and for images of this size.
void checkCameraInfo(const sensor_msgs::CameraInfo& info, const sensor_msgs::Image& image,
                     const std::string& where);

}  // namespace calipso::bag
