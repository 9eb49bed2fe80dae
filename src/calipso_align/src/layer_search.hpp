#pragma once

#include <opencv2/core.hpp>
#include <opencv2/video/tracking.hpp>

#include "calipso_align/mask_tracker.hpp"
#include "calipso_align/segmentation_level.hpp"

// Where an object went from one frame to the next.
namespace calipso::align {

// A rectangle with a margin.
cv::Rect grown(const cv::Rect& rect, int px);
// The part of the picture around a mask; empty where the mask is.
cv::Rect around(const cv::Mat& mask, int margin);

// Parameters that are given for 640 px of a picture's longer side, for one of this size: in larger
// pictures objects go as many times as far.
TrackerParams forPicture(const cv::Size& size, TrackerParams params);

// Means over small blocks, which average the sensor's noise away: what stillness and large motions
// are told by.
cv::Mat blockMeans(const cv::Mat& image, int block_px);

// Whether nothing changed in an object and its rim since the frame of `reference_means`.
bool isStill(const cv::Mat& mask, const cv::Mat& means, const cv::Mat& reference_means,
             const TrackerParams& params);

// Blocks (CV_8U, as blockMeans()) that a known background does not account for, lit or shaded; all
// of them where so much differs that the background cannot be relied on.
cv::Mat foreignBlocks(const cv::Mat& means, const KnownBackground& background, int block_px);

// Translation of an object since the previous frame: best match of its pixels on a coarse picture,
// where there is something foreign; none where that is little enough to be the flow's to find.
cv::Point coarseShift(const cv::Mat& mask, const cv::Mat& means, const cv::Mat& previous_means,
                      const cv::Mat& foreign, const TrackerParams& params);

// Backward flow, current to previous frame, near where an object went; `shift` elsewhere. What the
// object moved as a whole is taken out first: the flow then has only the rest to find.
cv::Mat backwardFlow(const cv::Mat& grey, const cv::Mat& previous_grey, const cv::Mat& mask,
                     const cv::Point& shift, int margin_px, cv::DISOpticalFlow& search);

// Roughly where an object is now: where its pixels flowed, or where it went as a whole if that is
// far, for then the background's own flow leads back to where the object was. No flow reaches
// further than the margin.
cv::Mat roughlyMoved(const cv::Mat& mask, const cv::Mat& flow, const cv::Point& shift,
                     int margin_px);

}  // namespace calipso::align
