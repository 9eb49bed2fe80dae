#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "calipso_align/gaussian_mixture.hpp"
#include "calipso_align/mask_edge.hpp"

namespace calipso::align {

// Pieces of an object may lie so far apart where it looks as its background does, px.
constexpr int kLookAlikeGap = 8;

// What a pixel is as far as the background tells.
enum Account : uchar { kUnknown, kBackground, kOther };

// The account of every pixel of a picture (CV_8UC3), as CV_8U. A shadow that has come is
// background; so is one that has gone, unless the pixel looks like the object (its colours).
cv::Mat accountsOf(const cv::Mat& view, const KnownBackground& background, double noise,
                   const std::vector<const GaussianMixture*>& object);

// Where a background that is known contradicts a mask: pixels beside it, in one piece with it, that
// the background cannot be, and pixels of it that are the background, lit or in a shadow.
// view         CV_8UC3
// mask, apart  CV_8U, non-zero: the object, what belongs to something else
// noise        of the background, grey levels
// colours      of the object
// Returns CV_8U 0 or 255; nothing where so much else differs that the background cannot be relied
// on.
cv::Mat contradicted(const cv::Mat& view, const cv::Mat& mask, const KnownBackground& background,
                     const cv::Mat& apart, double noise,
                     const std::vector<const GaussianMixture*>& colours);

// Pixels beside a mask, in one piece with it, where no background is known, and which look like the
// object rather than like the background elsewhere. CV_8U 0 or 255.
cv::Mat unseenParts(const cv::Mat& view, const cv::Mat& mask, const cv::Mat& known,
                    const cv::Mat& apart, const std::vector<const GaussianMixture*>& object,
                    const GaussianMixture& background);

}  // namespace calipso::align
