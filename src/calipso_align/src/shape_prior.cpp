#include "calipso_align/shape_prior.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace calipso::align {
namespace {

// Change of a map, about the silhouette's centre: shift (px), turn (rad), log scale, log aspect,
// shear.
using Change = std::array<double, 6>;

class SilhouetteScore {
 public:
  SilhouetteScore(const cv::Mat& silhouette, const cv::Mat& evidence, const cv::Matx23d& start)
      : silhouette_(silhouette), evidence_(evidence), start_(start) {
    const cv::Rect box = cv::boundingRect(silhouette);
    centre_ = start * cv::Vec3d(box.x + 0.5 * (box.width - 1), box.y + 0.5 * (box.height - 1), 1);
    radius_ = 0.5 * std::hypot(box.width, box.height);
  }

  double radius() const { return radius_; }

  cv::Matx23d map(const Change& change) const {
    const double c = std::cos(change[2]), d = std::sin(change[2]), s = std::exp(change[3]);
    const double stretch = std::exp(change[4]);
    const cv::Matx22d linear =
        cv::Matx22d(c, -d, d, c) * cv::Matx22d(s * stretch, change[5], 0.0, s / stretch);
    const cv::Matx22d first(start_(0, 0), start_(0, 1), start_(1, 0), start_(1, 1));
    const cv::Matx22d a = linear * first;
    const cv::Vec2d t = linear * (cv::Vec2d(start_(0, 2), start_(1, 2)) - centre_) + centre_ +
                        cv::Vec2d(change[0], change[1]);
    return {a(0, 0), a(0, 1), t[0], a(1, 0), a(1, 1), t[1]};
  }

  cv::Mat place(const Change& change) const {
    cv::Mat placed;
    cv::warpAffine(silhouette_, placed, map(change), evidence_.size());
    return placed;
  }

  // Log likelihood ratio of the placed silhouette against an empty picture, nats.
  double operator()(const Change& change) const {
    const cv::Mat placed = place(change);
    double sum = 0.0;
    for (int y = 0; y < placed.rows; ++y) {
      const uchar* inside = placed.ptr<uchar>(y);
      const float* gain = evidence_.ptr<float>(y);
      for (int x = 0; x < placed.cols; ++x) sum += inside[x] * gain[x];
    }
    return sum / 255.0;
  }

 private:
  const cv::Mat& silhouette_;
  const cv::Mat& evidence_;
  cv::Matx23d start_;
  cv::Vec2d centre_;
  double radius_ = 0.0;
};

double overlap(const cv::Mat& a, const cv::Mat& b) {
  return cv::countNonZero(a & b) / static_cast<double>(std::max(1, cv::countNonZero(a | b)));
}

}  // namespace

PlacedShape placeSilhouette(const cv::Mat& silhouette, const cv::Mat& evidence,
                            const cv::Matx23d& start) {
  constexpr double kFirstStep = 0.2, kLastStep = 0.004, kShrink = 0.6;  // of the radius
  constexpr int kMaxSweeps = 6;
  const SilhouetteScore score(silhouette, evidence, start);
  Change best_change = {};
  double best = score(best_change);
  for (double step = kFirstStep; step > kLastStep; step *= kShrink) {
    const double shift = step * score.radius(), turn = 0.5 * step;
    const Change steps = {shift, shift, turn, turn, 0.5 * turn, 0.5 * turn};
    bool improved = true;
    for (int sweep = 0; improved && sweep < kMaxSweeps; ++sweep) {
      improved = false;
      for (size_t axis = 0; axis < steps.size(); ++axis)
        for (const double sign : {-1.0, 1.0}) {
          Change candidate = best_change;
          candidate[axis] += sign * steps[axis];
          const double value = score(candidate);
          if (value <= best) continue;
          best = value;
          best_change = candidate;
          improved = true;
        }
    }
  }
  const cv::Mat placed = score.place(best_change) > 127;
  return {score.map(best_change), overlap(placed, evidence > 0)};
}

// Pixel centres lie at integers, so that small = large / factor + c with c = (1 / factor - 1) / 2.
cv::Matx23d scaled(const cv::Matx23d& map, double factor) {
  const double c = 0.5 * (1.0 / factor - 1.0);
  cv::Matx23d result = map;
  for (int row = 0; row < 2; ++row)
    result(row, 2) = factor * (map(row, 2) + c * (map(row, 0) + map(row, 1)) - c);
  return result;
}

cv::Mat shapeOdds(const cv::Mat& silhouette, float weight, float tolerance_px) {
  cv::Mat inside, outside, odds(silhouette.size(), CV_32F);
  cv::distanceTransform(silhouette, inside, cv::DIST_L2, 3);
  cv::distanceTransform(silhouette == 0, outside, cv::DIST_L2, 3);
  for (int y = 0; y < odds.rows; ++y)
    for (int x = 0; x < odds.cols; ++x) {
      const float depth = inside.at<float>(y, x) - outside.at<float>(y, x);
      odds.at<float>(y, x) = weight * std::tanh(depth / tolerance_px);
    }
  return odds;
}

}  // namespace calipso::align
