#pragma once

#include "texture/texture_fill.hpp"

namespace calipso::render {

// A picture's reflectance with what the texture misses of it added once more: a texture made of such
// pictures, which blurs them as this one does, comes nearer to them when it is drawn (iterative back
// projection, Irani & Peleg 1991).
// @param shown CV_32FC4, of the picture's region
cv::Mat sharpened(const cv::Mat& shown, const Reflectance& picture, const Actor& actor,
                  const SurfaceTexture& texture);

}  // namespace calipso::render
