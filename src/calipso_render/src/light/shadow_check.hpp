#pragma once

#include <opencv2/core.hpp>

namespace calipso::render {

// Which of the predicted shadows a picture shows, decided region by region: a connected part of the
// prediction as a whole.
//   y' = b h' + e
//   y  -log of brightness        h  hidden part of the light
//   b  how dark the shadow is    '  less its mean around the pixel
// A shadow is dark from its border on; something that happens to be dark there, or gets darker, has
// a small b. The odds are those of b under a shadow and under none. A prediction may lie some
// pixels beside its shadow.
struct SeenShadows {
  cv::Mat sun, sky;     // CV_8UC1: the regions that are seen, or that nothing speaks against
  cv::Mat refuted;      // CV_8UC1: the others, without what small regions of the sky's leave
  bool none = false;    // there are predictions, and all of them were refuted
  bool no_sun = false;  // the same of the sun's
};

// CV_8UC1: 255 where so little of sun or sky is seen that a picture tells. @param sun, sky
// CV_32FC1, visible part of them, 0..1
cv::Mat isShaded(const cv::Mat& sun, const cv::Mat& sky);

// b of usual shadows
struct UsualDarkness {
  double mean, deviation;
};
constexpr UsualDarkness kOnGround{0.8, 0.45};  // a shadow takes 5 to 6 tenths of the light
constexpr UsualDarkness kOnWater{0.4, 0.25};   // less, as what is mirrored is not shaded

// @param sun, sky CV_32FC1, visible part of them, 0..1, as predicted
// @param picture CV_32FC3, code values
// @param unknown CV_8UC1, != 0: says nothing (objects, things off the planes)
// @param sun_is_sure false: of the sun's shadows those are believed that the picture shows, if it
//   tells anything of them
SeenShadows seenShadows(const cv::Mat& sun, const cv::Mat& sky, const cv::Mat& picture,
                        const cv::Mat& unknown, const UsualDarkness& usual = kOnGround,
                        bool sun_is_sure = true);

// CV_8UC1: of the places that see less of the sky the regions that a picture surely shows darker.
cv::Mat surelyDarker(const cv::Mat& sky, const cv::Mat& picture, const cv::Mat& unknown);

}  // namespace calipso::render
