#include "place/plane_mirror.hpp"

#include <algorithm>
#include <vector>

#include "calipso_render/colour.hpp"
#include "place/drawn_out.hpp"

namespace calipso::render {

cv::Mat withCover(const MirrorImage& image) {
  cv::Mat out;
  cv::merge(std::vector<cv::Mat>{image.colour, image.cover}, out);
  return out;
}

cv::Mat addedBy(const PlaneMirror& mirror, const MirrorImage& image) {
  const cv::Mat drawn = DrawnOut(image.spread, image.across, mirror.slope)(withCover(image));
  cv::Mat added(drawn.size(), CV_32FC3);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < added.rows; ++v) {
    for (int u = 0; u < added.cols; ++u) {
      const cv::Vec4f& c = drawn.at<cv::Vec4f>(v, u);
      added.at<cv::Vec3f>(v, u) =
          mirror.strength * (cv::Vec3f(c[0], c[1], c[2]) - c[3] * mirror.surroundings);
    }
  }
  return added;
}

cv::Mat unmirrored(const PlaneMirror& mirror, const cv::Mat& picture) {
  cv::Mat out = picture.clone();
#pragma omp parallel for schedule(static)
  for (int v = 0; v < out.rows; ++v) {
    for (int u = 0; u < out.cols; ++u) {
      const cv::Vec3f& added = mirror.at_key.at<cv::Vec3f>(v, u);
      if (added == cv::Vec3f()) continue;
      cv::Vec3f& c = out.at<cv::Vec3f>(v, u);
      for (int k = 0; k < 3; ++k)
        c[k] = codeFromLinear(std::max(0.0f, linearFromRealCode(c[k]) - added[k]));
    }
  }
  return out;
}

cv::Mat unmirroredCodes(const PlaneMirror& mirror, const cv::Mat& bgr) {
  cv::Mat out = bgr.clone();
#pragma omp parallel for schedule(static)
  for (int v = 0; v < out.rows; ++v) {
    for (int u = 0; u < out.cols; ++u) {
      const cv::Vec3f& added = mirror.at_key.at<cv::Vec3f>(v, u);
      if (added == cv::Vec3f()) continue;
      cv::Vec3b& c = out.at<cv::Vec3b>(v, u);
      for (int k = 0; k < 3; ++k) c[k] = quantise(codeFromLinear(linearFromCode(c[k]) - added[k]));
    }
  }
  return out;
}

}  // namespace calipso::render
