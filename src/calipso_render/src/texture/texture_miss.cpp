#include "texture/texture_miss.hpp"

#include <algorithm>

namespace calipso::render {
namespace {

// The picture's reflectance as the texture has it. CV_32FC4, the picture's own beside the object.
cv::Mat drawnInto(const Reflectance& picture, const Actor& actor, const SurfaceTexture& texture) {
  cv::Mat drawn = picture.albedo.clone();
#pragma omp parallel for schedule(static)
  for (int v = 0; v < drawn.rows; ++v) {
    for (int u = 0; u < drawn.cols; ++u) {
      const int triangle = picture.triangle.at<int>(v, u);
      if (triangle < 0) continue;
      const Eigen::Vector3f weights =
          barycentric(actor.screen, triangle, static_cast<float>(u + picture.region.x),
                      static_cast<float>(v + picture.region.y));
      drawn.at<cv::Vec4f>(v, u) = texture.at(triangle, weights);
    }
  }
  return drawn;
}

}  // namespace

cv::Mat sharpened(const cv::Mat& shown, const Reflectance& picture, const Actor& actor,
                  const SurfaceTexture& texture) {
  const cv::Mat drawn = drawnInto(picture, actor, texture);
  cv::Mat out = shown.clone();
  for (int v = 0; v < out.rows; ++v) {
    for (int u = 0; u < out.cols; ++u) {
      const float trust = picture.trust.at<float>(v, u);
      const cv::Vec4f &own = picture.albedo.at<cv::Vec4f>(v, u), &now = drawn.at<cv::Vec4f>(v, u);
      cv::Vec4f& colour = out.at<cv::Vec4f>(v, u);
      for (int c = 0; c < 3; ++c) colour[c] = std::max(0.0f, colour[c] + trust * (own[c] - now[c]));
    }
  }
  return out;
}

}  // namespace calipso::render
