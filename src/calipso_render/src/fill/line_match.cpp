#include "fill/line_match.hpp"

#include <algorithm>
#include <cmath>

namespace calipso::render {
namespace {

constexpr float kTurn = 0.04f;        // kLineStray grows by this part of the way between two ends
constexpr float kBesideAlike = 0.5f;  // difference of what is beside lines, to their contrast

// Sum over `count` places across them from the first, of squares.
float squaresAcross(const LineEnd& a, const LineEnd& b, int first, int count) {
  float sum = 0.0f;
  for (int s = first; s < first + count; ++s)
    sum +=
        static_cast<float>(cv::norm(a.profile[s] - b.profile[2 * kLineHalf - s], cv::NORM_L2SQR)) /
        3.0f;
  return sum;
}

}  // namespace

float strayOf(const LineEnd& a, const LineEnd& b) {
  const cv::Point2f way = b.at - a.at;
  return std::max(std::abs(cross(a.into, way)), std::abs(cross(b.into, way)));
}

float allowedStray(float gap) { return kLineStray + kTurn * gap; }

bool areInLine(const LineEnd& a, const LineEnd& b, float gap) {
  const cv::Point2f way = b.at - a.at;
  return gap >= 2.0f && a.into.dot(way) >= 0.9f * gap && b.into.dot(way) <= -0.9f * gap &&
         strayOf(a, b) <= allowedStray(gap);
}

bool besideAlike(const LineEnd& a, const LineEnd& b) {
  return besideAlike(a, b, 0) && besideAlike(a, b, 1);
}

bool besideAlike(const LineEnd& a, const LineEnd& b, int side) {
  return rms(a.beside[side] - b.beside[1 - side]) <=
         kBesideAlike * std::min(a.contrast, b.contrast);
}

bool standOut(const LineEnd& a, const LineEnd& b, int side) {
  return a.stands_out[side] && b.stands_out[1 - side];
}

float differenceAcross(const LineEnd& a, const LineEnd& b) {
  constexpr int kCount = 2 * kLineHalf + 1;
  return std::sqrt(squaresAcross(a, b, 0, kCount) / kCount) / std::min(a.contrast, b.contrast);
}

float differenceAlone(const LineEnd& a, const LineEnd& b) {
  cv::Vec3f sum;
  for (int s = -1; s <= 1; ++s) sum += a.profile[kLineHalf + s] - b.profile[kLineHalf - s];
  return rms(sum / 3.0f) / std::max(a.contrast, b.contrast);
}

float differenceOfSide(const LineEnd& a, const LineEnd& b, int side) {
  constexpr int kCount = kLineHalf + 1;
  const float squares = squaresAcross(a, b, side * kLineHalf, kCount);
  return std::sqrt(squares / kCount) / std::min(a.contrast, b.contrast);
}

}  // namespace calipso::render
