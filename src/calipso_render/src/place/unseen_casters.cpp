#include "place/unseen_casters.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "place/masked_quantile.hpp"

namespace calipso::render {
namespace {

constexpr int kFewest = 200;     // px of either kind
constexpr int kAround = 9;       // px of the square over which verdicts and brightness are averaged
constexpr float kMost = 0.25;    // part of it that must be told
constexpr double kApart = 0.35;  // log brightness between what has the sun and what has not
constexpr double kMistaken = 0.1;  // part of what was told that brightness may tell wrongly
constexpr double kPenumbra = 2.5;  // px, deviation
constexpr float kLeastUmbra = 1e-3f;

// Noise decides single pixels: what most around say, as they do.
cv::Mat clearly(const cv::Mat& told, std::uint8_t what, std::uint8_t other) {
  cv::Mat here, there;
  cv::boxFilter(cv::Mat(told == what), here, CV_32F, {kAround, kAround});
  cv::boxFilter(cv::Mat(told == other), there, CV_32F, {kAround, kAround});
  return (told != kSunUntold) & (here > 2.0f * there) & (here > 255.0f * kMost);
}

// Logarithm of the mean brightness around, of what is part of `here`.
cv::Mat brightnessAround(const cv::Mat& brightness, const cv::Mat& here) {
  cv::Mat weight, sum, weights;
  here.convertTo(weight, CV_32F, 1.0 / 255.0);
  cv::boxFilter(brightness.mul(weight), sum, CV_32F, {kAround, kAround});
  cv::boxFilter(weight, weights, CV_32F, {kAround, kAround});
  cv::log(sum / cv::max(weights, 1e-3) + 1e-3, sum);
  return sum;
}

}  // namespace

cv::Mat unseenCastersShade(const cv::Mat& told, const cv::Mat& plate, const cv::Mat& surface) {
  if (told.empty()) return {};
  const cv::Mat dark = clearly(told, kNoSun, kSun), lit = clearly(told, kSun, kNoSun);
  if (cv::countNonZero(dark) < kFewest) return {};
  cv::Mat hidden = dark.clone();
  const cv::Mat brightness = luminanceOf(plate);
  double surfaces = 0.0;
  if (!surface.empty()) cv::minMaxLoc(surface, nullptr, &surfaces);
  for (int k = 1; k <= static_cast<int>(surfaces); ++k) {
    const cv::Mat here = surface == k, dark_here = here & dark, lit_here = here & lit;
    const int darks = cv::countNonZero(dark_here), lits = cv::countNonZero(lit_here);
    if (darks < kFewest || lits < kFewest) continue;
    const cv::Mat around = brightnessAround(brightness, here);
    const double low = quantileOf(around, dark_here, 0.5), high = quantileOf(around, lit_here, 0.5),
                 between = 0.5 * (low + high);
    const cv::Mat as_dark = around < between;
    const int mistaken =
        cv::countNonZero(dark_here & ~as_dark) + cv::countNonZero(lit_here & as_dark);
    if (high - low < kApart || mistaken > kMistaken * (darks + lits)) continue;
    hidden.setTo(255, here & as_dark);
    hidden.setTo(0, lit_here);
  }
  cv::GaussianBlur(hidden, hidden, {}, kPenumbra);
  return hidden;
}

cv::Mat lowestSun(const cv::Mat& hidden, float umbra) {
  // umbra + (1 - umbra) level = umbra / (umbra + (1 - umbra) (1 - hidden))
  cv::Mat part, level;
  umbra = std::max(umbra, kLeastUmbra);
  hidden.convertTo(part, CV_32F, umbra / 255.0);
  cv::divide(part, 1.0 - (1.0 / umbra - 1.0) * part, level, 255.0);
  level.convertTo(level, CV_8U);
  return level;
}

}  // namespace calipso::render
