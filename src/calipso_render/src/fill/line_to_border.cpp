#include "fill/line_to_border.hpp"

namespace calipso::render {
namespace {

constexpr float kShortest = 2.0f;  // px

}  // namespace

std::optional<float> wayToBorder(const LineEnd& end, const cv::Mat& hole, const cv::Mat& source,
                                 float most) {
  const cv::Rect picture({0, 0}, hole.size());
  const auto at = [&](float t) { return end.at + t * end.into; };
  const auto inside = [&](float t) {
    return picture.contains(cv::Point(cvRound(at(t).x), cvRound(at(t).y)));
  };
  float t = 0.0f;
  while (inside(t) && !isSet(hole, at(t))) t += 1.0f;
  while (inside(t) && isSet(hole, at(t))) t += 1.0f;
  if (!inside(t) || isSet(source, at(t)) || t < kShortest || t > most) return std::nullopt;
  return t;
}

}  // namespace calipso::render
