#include "place/mended_depth.hpp"

#include <opencv2/imgproc.hpp>

#include "calipso_render/background.hpp"

namespace calipso::render {
namespace {

constexpr double kGap = 0.03;      // of the picture's width: radius of discs that fit into no gap
constexpr double kOnPlane = 0.03;  // of the nearness: measured ones spread

}  // namespace

cv::Mat mendedDepth(const cv::Mat& depth, const cv::Mat& labels,
                    const std::vector<SupportPlane>& planes, const Camera& camera) {
  const cv::Mat ground = depth.empty() ? cv::Mat() : groundNearness(planes, camera, cv::Mat());
  if (ground.empty()) return depth;
  cv::Mat plane_depth = 1.0 / ground;
  plane_depth.setTo(0.0f, ground == 0.0f);
  const cv::Mat on = (plane_depth > 0.0f) & (cv::abs(depth - plane_depth) < kOnPlane * depth),
                gap = (plane_depth > 0.0f) & (labels == 0) & ~on &
                      ((depth == 0.0f) | (depth > plane_depth));
  if (cv::countNonZero(gap) == 0) return depth;
  const int radius = cvRound(kGap * depth.cols);
  cv::Mat closed;
  cv::copyMakeBorder(on | (labels != 0), closed, radius, radius, radius, radius,
                     cv::BORDER_CONSTANT);
  cv::morphologyEx(closed, closed, cv::MORPH_CLOSE,
                   cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * radius + 1, 2 * radius + 1}));
  cv::Mat mended = depth.clone();
  plane_depth.copyTo(mended, gap & closed(cv::Rect({radius, radius}, depth.size())));
  return mended;
}

}  // namespace calipso::render
