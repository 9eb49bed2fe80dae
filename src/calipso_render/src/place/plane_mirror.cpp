#include "place/plane_mirror.hpp"

#include <algorithm>
#include <vector>

#include "calipso_render/colour.hpp"
#include "place/drawn_out.hpp"

namespace calipso::render {

namespace {

constexpr float kReach = 3.0f;  // standard deviations

}  // namespace

// To whole squares of DrawnOut::kCoarsest px.
cv::Rect reachedBy(const MirrorImage& image, float slope) {
  double spread = 0.0;
  cv::minMaxLoc(image.spread, nullptr, &spread);
  const int reach = static_cast<int>(kReach * slope * spread) + 1;
  constexpr int kSquare = DrawnOut::kCoarsest;
  const auto down = [](int x) { return std::max(0, x) / kSquare * kSquare; };
  const cv::Point low(down(image.box.x - reach), down(image.box.y - reach)),
      high(down(image.box.br().x + reach) + kSquare, down(image.box.br().y + reach) + kSquare);
  return cv::Rect(low, high) & cv::Rect({0, 0}, image.spread.size());
}

cv::Mat withCover(const MirrorImage& image, const cv::Rect& box) {
  cv::Mat out;
  cv::merge(std::vector<cv::Mat>{image.colour(box), image.cover(box)}, out);
  return out;
}

cv::Mat addedBy(const PlaneMirror& mirror, const MirrorImage& image) {
  cv::Mat added = cv::Mat::zeros(image.colour.size(), CV_32FC3);
  const cv::Rect box = reachedBy(image, mirror.slope);
  const cv::Mat drawn =
      DrawnOut(image.spread(box), image.across, mirror.slope)(withCover(image, box));
#pragma omp parallel for schedule(static)
  for (int v = 0; v < box.height; ++v) {
    const cv::Vec4f* c = drawn.ptr<cv::Vec4f>(v);
    cv::Vec3f* to = added.ptr<cv::Vec3f>(box.y + v) + box.x;
    for (int u = 0; u < box.width; ++u)
      to[u] = mirror.strength *
              (cv::Vec3f(c[u][0], c[u][1], c[u][2]) - c[u][3] * mirror.surroundings);
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
