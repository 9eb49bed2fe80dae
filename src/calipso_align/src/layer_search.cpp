#include "layer_search.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_align/layer_motion.hpp"
#include "calipso_align/mask_edge.hpp"
#include "layer_appearance.hpp"

namespace calipso::align {
namespace {

constexpr double kUsualSide = 640.0;  // px of a picture's longer side, that TrackerParams are for
constexpr int kLeastFlowWidth = 32;   // px; DIS wants a few of its patches
// px; from here on half the resolution tells how a layer moves nearly as well
constexpr int kLargeView = 200;

// A part of a picture, continued beyond its border.
cv::Mat shifted(const cv::Mat& image, const cv::Rect& part) {
  const cv::Rect there = part & cv::Rect(cv::Point(), image.size());
  if (there == part) return image(part);
  cv::Mat result;
  const cv::Matx23d back(1, 0, part.x, 0, 1, part.y);
  cv::warpAffine(image, result, back, part.size(), cv::INTER_LINEAR | cv::WARP_INVERSE_MAP,
                 cv::BORDER_REPLICATE);
  return result;
}

}  // namespace

cv::Rect grown(const cv::Rect& rect, int px) {
  return {rect.x - px, rect.y - px, rect.width + 2 * px, rect.height + 2 * px};
}

cv::Rect around(const cv::Mat& mask, int margin) {
  const cv::Rect box = cv::boundingRect(mask);
  return box.empty() ? box : grown(box, margin) & cv::Rect(cv::Point(), mask.size());
}

TrackerParams forPicture(const cv::Size& size, TrackerParams params) {
  const int times =
      std::max(1, static_cast<int>(std::lround(std::max(size.width, size.height) / kUsualSide)));
  params.search_px *= times, params.block_px *= times;
  return params;
}

cv::Mat blockMeans(const cv::Mat& image, int block_px) {
  cv::Mat means;
  cv::resize(image, means, cv::Size(), 1.0 / block_px, 1.0 / block_px, cv::INTER_AREA);
  return means;
}

bool isStill(const cv::Mat& mask, const cv::Mat& means, const cv::Mat& reference_means,
             const TrackerParams& params) {
  const int block = params.block_px;
  const cv::Rect roi = around(mask, params.band_px + block);
  if (roi.empty()) return true;
  const cv::Rect cells((roi.x + block - 1) / block, (roi.y + block - 1) / block,
                       roi.width / block - 1, roi.height / block - 1);
  const cv::Rect part = cells & cv::Rect(cv::Point(), means.size());
  if (part.empty()) return false;
  cv::Mat difference, changed, cell_mask;
  cv::absdiff(means(part), reference_means(part), difference);
  cv::resize(grown(mask, params.band_px), cell_mask, means.size(), 0, 0, cv::INTER_NEAREST);
  cv::inRange(difference, cv::Scalar::all(0), cv::Scalar::all(params.still_levels), changed);
  changed = (changed == 0) & cell_mask(part);
  const int counted = cv::countNonZero(cell_mask(part));
  return cv::countNonZero(changed) <= params.still_share * counted;
}

cv::Mat foreignBlocks(const cv::Mat& means, const KnownBackground& background, int block_px) {
  constexpr float kNoise = 3.0f;        // grey levels, of a block's mean and of what moves a bit
  constexpr double kMostForeign = 0.1;  // of the picture
  cv::Mat known, behind = blockMeans(background.image, block_px);
  cv::resize(background.known, known, means.size(), 0, 0, cv::INTER_AREA);
  cv::Mat foreign(means.size(), CV_8U, cv::Scalar(255));
  for (int y = 0; y < means.rows; ++y)
    for (int x = 0; x < means.cols; ++x) {
      if (known.at<uchar>(y, x) < 255) continue;
      const cv::Vec3f lit(behind.at<cv::Vec3b>(y, x)), seen(means.at<cv::Vec3b>(y, x));
      const cv::Vec3f d = seen - lit;
      if (d.dot(d) < 27.0f * kNoise * kNoise || isShadowed(lit, seen, kNoise))
        foreign.at<uchar>(y, x) = 0;
    }
  const cv::Mat apart = foreign & (known == 255);
  if (cv::countNonZero(apart) > kMostForeign * static_cast<double>(apart.total())) foreign = 255;
  return foreign;
}

cv::Point coarseShift(const cv::Mat& mask, const cv::Mat& means, const cv::Mat& previous_means,
                      const cv::Mat& foreign, const TrackerParams& params) {
  const int block = params.block_px;
  constexpr double kLeastForeign = 0.5;  // of what there is of it in the best place
  const cv::Rect box = cv::boundingRect(mask);
  if (box.empty()) return {};
  const cv::Rect cells =
      cv::Rect(box.tl() / block, box.size() / block) & cv::Rect(cv::Point(), means.size());
  if (cells.width < 2 || cells.height < 2) return {};
  const cv::Rect search =
      grown(cells, params.search_px / block) & cv::Rect(cv::Point(), means.size());
  cv::Mat weight, score;
  cv::resize(mask, weight, means.size(), 0, 0, cv::INTER_AREA);
  cv::matchTemplate(means(search), previous_means(cells), score, cv::TM_SQDIFF, weight(cells));
  cv::Mat there, own, met;
  foreign(search).convertTo(there, CV_32F);
  weight(cells).convertTo(own, CV_32F);
  cv::matchTemplate(there, own, met, cv::TM_CCORR);
  double most = 0.0;
  cv::minMaxLoc(met, nullptr, &most);
  cv::Point best;
  cv::minMaxLoc(score, nullptr, nullptr, &best, nullptr, cv::Mat(met >= kLeastForeign * most));
  const cv::Point moved = search.tl() + best - cells.tl();
  // Motion of a cell or two is the flow's to find.
  return std::abs(moved.x) > 2 || std::abs(moved.y) > 2 ? moved * block : cv::Point();
}

cv::Mat backwardFlow(const cv::Mat& grey, const cv::Mat& previous_grey, const cv::Mat& mask,
                     const cv::Point& shift, int margin_px, cv::DISOpticalFlow& search) {
  const cv::Rect whole(cv::Point(), grey.size());
  const cv::Rect view = grown(cv::boundingRect(mask) + shift, margin_px) & whole;
  cv::Mat flow(grey.size(), CV_32FC2, cv::Scalar(-shift.x, -shift.y));
  if (view.width < kLeastFlowWidth || view.height < kLeastFlowWidth) return flow;
  cv::Mat rest, now = grey(view), before = shifted(previous_grey, view - shift);
  const bool large = std::min(view.width, view.height) >= kLargeView;
  if (large) {
    cv::resize(now, now, cv::Size(), 0.5, 0.5, cv::INTER_AREA);
    cv::resize(before, before, cv::Size(), 0.5, 0.5, cv::INTER_AREA);
  } else {
    now = now.clone();  // flow wants whole rows
    before = before.clone();
  }
  search.calc(now, before, rest);
  if (large) cv::resize(2.0 * rest, rest, view.size());
  flow(view) += rest;
  return flow;
}

cv::Mat roughlyMoved(const cv::Mat& mask, const cv::Mat& flow, const cv::Point& shift,
                     int margin_px) {
  cv::Mat moved;
  if (shift == cv::Point()) {
    moved = cv::Mat::zeros(mask.size(), CV_8U);
    const cv::Rect near = around(mask, margin_px);
    if (!near.empty()) moved(near) = movedBack(mask, flow(near), near) > 127;
    return moved;
  }
  cv::warpAffine(mask, moved, cv::Matx23d(1, 0, shift.x, 0, 1, shift.y), mask.size());
  return moved > 127;
}

}  // namespace calipso::align
