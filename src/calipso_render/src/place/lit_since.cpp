#include "place/lit_since.hpp"

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "frame/mask_morphology.hpp"

namespace calipso::render {
namespace {

constexpr float kHardlyShaded = 0.9f;  // of the step from shade to light
constexpr int kAlike = 5;              // px over which it is told whether a place is lit

}  // namespace

cv::Mat litSince(const cv::Mat& picture, const cv::Mat& plate, const cv::Mat& left, double umbra,
                 int margin) {
  cv::Mat then, now, half_lit;  // half: of the steps from shade to light, which are ratios
  cv::blur(luminanceOf(picture), then, {kAlike, kAlike});
  cv::blur(luminanceOf(plate), now, {kAlike, kAlike});
  cv::sqrt(left, half_lit);
  // What is narrower than a prediction's error goes with what is around it.
  cv::Mat lit = (now.mul(half_lit) >= then) & (half_lit < kHardlyShaded);
  cv::morphologyEx(lit, lit, cv::MORPH_OPEN, disc(margin));
  // Beside it, where the key frame may be lit, too, the plate is if it is about as bright.
  const cv::Size around(3 * (2 * margin + 1), 3 * (2 * margin + 1));
  cv::Mat part, sum, count, beside;
  lit.convertTo(part, CV_32F, 1.0 / 255.0);
  cv::blur(now.mul(part), sum, around), cv::blur(part, count, around);
  cv::dilate(lit, beside, disc(margin)), cv::dilate(beside, beside, disc(margin));
  return lit | (beside & (now.mul(count) > std::sqrt(umbra) * sum));
}

}  // namespace calipso::render
