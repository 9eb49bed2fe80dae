#pragma once

#include <vector>

#include "texture/texture_fill.hpp"

namespace calipso::render {

// What a texture misses of the pictures that it was made from, found by drawing it into them.

// Adds to the pictures' reflectance what the texture misses of it: a texture made of such pictures,
// which blurs them as this one does, comes nearer to them when it is drawn (iterative back
// projection, Irani & Peleg 1991). Where a picture is darker or brighter all around than the
// texture, as in shade that no light tells of, it is first brought to its brightness: what is
// missed there is no blur.
// @param shown per picture, CV_32FC4, of its region
// @return the key frame's, at the texture's brightness, with nothing added: where it alone is copied
//   from, no mean takes back what is too much of that
cv::Mat sharpen(const SeenObject& object, const SurfaceTexture& texture,
                std::vector<cv::Mat>& shown);

// Deviation of pixels from the texture by themselves, code values, mean of the channels: the
// camera's noise and what the surface has of its own, which goes lost in a mean of pictures. By the
// median of where the texture is plainest; 0 when too little is seen.
float grainOf(const SeenObject& object, const SurfaceTexture& texture);

}  // namespace calipso::render
