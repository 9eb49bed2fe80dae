#include "calipso_flow/coarse_search.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace calipso::flow {
namespace {

constexpr double kClearlyBetter = 0.02;  // of correlation, before the prediction is given up
constexpr int kLeastSide = 8;            // px; a smaller object says too little
constexpr int kLeastTemplate = 12;       // px; it is not reduced to less

// Reduction by which the object is still large enough to be recognised.
int reduction(const cv::Size& object) {
  const int side = std::min(object.width, object.height);
  return side >= 4 * kLeastTemplate ? 4 : side >= 2 * kLeastTemplate ? 2 : 1;
}

cv::Rect boundingRect(const cv::Mat& weight) {
  cv::Mat known = weight > 0.5f;
  return cv::boundingRect(known);
}

// The part of the picture to search, black-free: the border is repeated where it reaches outside.
cv::Mat cutOut(const cv::Mat& picture, const cv::Rect& part) {
  const cv::Rect inside = part & cv::Rect({0, 0}, picture.size());
  if (inside.area() == 0) return {};
  cv::Mat result;
  cv::copyMakeBorder(picture(inside), result, inside.y - part.y, part.br().y - inside.br().y,
                     inside.x - part.x, part.br().x - inside.br().x, cv::BORDER_REPLICATE);
  return result;
}

// Offset of a parabola's top through three values at -1, 0, 1.
double parabolaTop(double before, double at, double after) {
  const double curvature = before - 2.0 * at + after;
  return curvature < 0.0 ? std::clamp(0.5 * (before - after) / curvature, -0.5, 0.5) : 0.0;
}

Eigen::Vector2d refinedPeak(const cv::Mat& score, const cv::Point& peak) {
  Eigen::Vector2d position(peak.x, peak.y);
  if (peak.x > 0 && peak.x + 1 < score.cols) {
    position.x() += parabolaTop(score.at<float>(peak.y, peak.x - 1), score.at<float>(peak),
                                score.at<float>(peak.y, peak.x + 1));
  }
  if (peak.y > 0 && peak.y + 1 < score.rows) {
    position.y() += parabolaTop(score.at<float>(peak.y - 1, peak.x), score.at<float>(peak),
                                score.at<float>(peak.y + 1, peak.x));
  }
  return position;
}

cv::Mat shrink(const cv::Mat& image, int factor) {
  if (factor == 1) return image;
  cv::Mat result;
  cv::resize(image, result, {image.cols / factor, image.rows / factor}, 0, 0, cv::INTER_AREA);
  return result;
}

// Whole multiple of `factor` that is not smaller.
int roundUp(double value, int factor) {
  return static_cast<int>(std::ceil(std::max(0.0, value) / factor)) * factor;
}

}  // namespace

CoarseMatch matchCoarsely(const ReferenceView::Warped& look, const cv::Mat& picture,
                          const Eigen::AlignedBox2d& reach, int factor) {
  const cv::Rect known = boundingRect(look.weight.image);
  cv::Rect object(known.x, known.y, known.width / factor * factor, known.height / factor * factor);
  if (object.width < kLeastSide || object.height < kLeastSide) {
    return {};
  }
  const int left = roundUp(-reach.min().x(), factor), up = roundUp(-reach.min().y(), factor);
  const int right = roundUp(reach.max().x(), factor), down = roundUp(reach.max().y(), factor);
  const cv::Point at(static_cast<int>(look.gray.origin.x) + object.x,
                     static_cast<int>(look.gray.origin.y) + object.y);
  const cv::Rect area(at.x - left, at.y - up, object.width + left + right,
                      object.height + up + down);
  const cv::Mat searched = cutOut(picture, area);
  if (searched.empty()) return {};

  cv::Mat mask = shrink(look.weight.image(object), factor) > 0.99f;
  if (cv::countNonZero(mask) < kLeastSide * kLeastSide / 2) return {};
  cv::Mat mask_float, score;
  mask.convertTo(mask_float, CV_32F, 1.0 / 255.0);
  cv::matchTemplate(shrink(searched, factor), shrink(look.gray.image(object), factor), score,
                    cv::TM_CCOEFF_NORMED, mask_float);
  score.setTo(-1.0f, (score != score) | (cv::abs(score) > 1.001f));  // flat areas divide by zero
  cv::Point peak;
  double best = 0.0;
  cv::minMaxLoc(score, nullptr, &best, nullptr, &peak);
  const cv::Point home(left / factor, up / factor);
  return {factor * (refinedPeak(score, peak) - Eigen::Vector2d(home.x, home.y)), best,
          score.at<float>(home)};
}

Eigen::Vector2d coarseDisplacement(const ReferenceView::Warped& look, const cv::Mat& picture,
                                   const Eigen::AlignedBox2d& reach) {
  const CoarseMatch match =
      matchCoarsely(look, picture, reach, reduction(boundingRect(look.weight.image).size()));
  return match.correlation < match.at_home + kClearlyBetter ? Eigen::Vector2d::Zero()
                                                            : match.displacement;
}

double correlationInPlace(const ReferenceView::Warped& look, const cv::Mat& picture) {
  if (look.coverage == 0.0) return -1.0;
  return matchCoarsely(look, picture, {Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero()},
                       reduction(boundingRect(look.weight.image).size()))
      .at_home;
}

}  // namespace calipso::flow
