#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

#include "calipso_render/relief.hpp"
#include "calipso_render/visibility.hpp"

namespace calipso::render {

// What passing shade tells of the sun at a pixel, CV_8UC1: nothing, that it has none anyhow, that it
// has some.
constexpr std::uint8_t kSunUntold = 0, kNoSun = 1, kSun = 2;

struct CastersShade {
  cv::Mat hidden;  // CV_8UC1: hidden part of the sun, 255 all; empty: nowhere
  cv::Mat known;   // CV_8UC1: 255 on surfaces on which the sun and its absence are told apart
};

// Where something that no frame shows keeps the sun off the place (a window's frame, a tree behind
// the camera): where passing shade left it as bright as it was, and what of the same surface is as
// dark as that, if brightness tells the two apart there.
// @param told what passing shade tells @param plate CV_32FC3, code values
// @param surface CV_8UC1, from 1 on; may be empty: nothing is inferred for more than what was told
CastersShade unseenCastersShade(const cv::Mat& told, const cv::Mat& plate, const cv::Mat& surface);

// Its hidden part of the sun with that on relief where brightness does not tell: what is kept off a
// place is kept off what stands before it. @param unseen made of the shade
cv::Mat hiddenOnRelief(const CastersShade& shade, const Visibility& unseen, const Relief& relief);

// CV_8UC1: lightLevel() of the sun below which no shade brings a place that part of the sun is hidden
// from anyhow. @param umbra CV_8UC1: what the sun's absence leaves of its brightness, 255 all
cv::Mat lowestSun(const cv::Mat& hidden, const cv::Mat& umbra);

}  // namespace calipso::render
