#pragma once

#include <opencv2/core.hpp>
#include <optional>

namespace calipso::render {

// What lies in shade of objects is seen, but darker. Taken off, that shade leaves more of the place
// than can be invented:
//   I = L (U (1 - B (1 - k)) + (1 - U) s)
//   I  linear colour seen     s, k  visible part of sun and sky, as predicted
//   L  in full light          U     what the sun's absence leaves, per channel
//      where something else keeps the sun off, L is the light without it, and U 1
//   B  part of the light from above that an object hides, less what it throws back itself
// Only where s is 0 or 1 for certain: borders of shadows are off by some pixels.
struct ShadedPlace {
  const cv::Mat& picture;    // CV_32FC3, code values
  const cv::Mat &sun, &sky;  // CV_32FC1, s and k
  const cv::Mat& sunless;    // CV_8UC1, != 0: has no sun anyhow, s is 1; may be empty
  const cv::Mat& unclear;    // CV_8UC1, != 0: covered, moves by itself or is no support plane
  int margin;                // px by which the sun's shadows may be off
};

// U, from pairs of places on either side of the shadows' borders: the median of their ratios, if
// most of what is beside each other is alike. nullopt: too few are.
// @param predicted U as the light has it
std::optional<cv::Vec3f> umbraAtBorders(const ShadedPlace& place, const cv::Vec3f& predicted);

// Planes of which shade leaves less than a third of what is seen: there is little to copy from.
// @param surface CV_8UC1, PlaceSurfaces::label, may be empty; planes: its labels from 1 on
// @param covered CV_8UC1, != 0: not seen @return CV_8UC1: 255 all over such planes
cv::Mat mostlyShaded(const cv::Mat& surface, int planes, const cv::Mat& traces,
                     const cv::Mat& covered);

// Takes the shade off the plate where that can be done.
// @param traces CV_8UC1: what is shaded at all @return CV_8UC1: 255 where it was taken off
cv::Mat liftShade(const ShadedPlace& place, const cv::Mat& traces, const cv::Vec3f& predicted,
                  cv::Mat& plate);

}  // namespace calipso::render
