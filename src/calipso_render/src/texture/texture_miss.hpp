#pragma once

#include <vector>

#include "texture/texture_fill.hpp"

namespace calipso::render {

// What a texture misses of the pictures that it was made from, found by drawing it into them.

// A picture's reflectance with what the texture misses of it added once more: a texture made of
// such pictures, which blurs them as this one does, comes nearer to them when it is drawn
// (iterative back projection, Irani & Peleg 1991). Where the picture is darker or brighter all
// around than the texture, as in shade that no light tells of, it is first brought to its
// brightness: what is missed there is no blur.
// @param shown CV_32FC4, of the picture's region
cv::Mat sharpened(const cv::Mat& shown, const Reflectance& picture, const Actor& actor,
                  const SurfaceTexture& texture);

// Deviation of pixels from the texture by themselves, code values, mean of the channels: the
// camera's noise and what the surface has of its own, which goes lost in a mean of pictures. By the
// median of where the texture is plainest; 0 when too little is seen.
float grainOf(const SeenObject& object, const SurfaceTexture& texture);

}  // namespace calipso::render
