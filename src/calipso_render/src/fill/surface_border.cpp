#include "fill/surface_border.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "calipso_render/inpaint.hpp"

namespace calipso::render {
namespace {

// px on either side of an edge by which labels may be off, and by which they are at most where one
// surface is a narrow strip
constexpr int kOff = 6, kOffOfStrip = 2;
constexpr float kParted = 0.7f;  // part of the way on which an edge parts surfaces

bool isGuess(int label) { return label == 0 || label == InpaintParams::kNoPlane; }

// The way from one end to the other.
struct Way {
  const LineEnd &from, &to;
  float gap = static_cast<float>(cv::norm(to.at - from.at));
  cv::Point2f along = (to.at - from.at) / gap;
};

// Is most of [first, last] px along a way beside `own`, and across the way not?
// @param aside to the side that is to be `own`
// @param guesses are taken for it
bool isBeside(const Way& way, const cv::Point2f& aside, int own, float first, float last,
              bool guesses, const cv::Mat& surface) {
  const int steps = std::max(2, cvRound(last - first));
  int parted = 0;
  for (int i = 0; i <= steps; ++i) {
    const cv::Point2f p = way.from.at + (first + (last - first) * i / steps) * way.along;
    const int here = surfaceAt(surface, p + aside), there = surfaceAt(surface, p - aside);
    parted += there != own && (here == own || (guesses && isGuess(here)));
  }
  return parted > kParted * steps;
}

// All along where it is hidden, and where one of its ends is seen: labels of what lies almost in a
// plane are unsure.
bool isAllAlong(const Way& way, const cv::Point2f& aside, int own, const cv::Mat& surface) {
  return !isGuess(own) && isBeside(way, aside, own, 0.0f, way.gap, true, surface) &&
         (isBeside(way, aside, own, -way.from.length, 0.0f, false, surface) ||
          isBeside(way, aside, own, way.gap, way.gap + way.to.length, false, surface));
}

}  // namespace

std::optional<SurfaceBorder> borderAlong(const LineEnd& from, const LineEnd& to,
                                         const cv::Mat& surface) {
  const Way way{from, to};
  const cv::Point2f seen[] = {from.at - kLineHalf * from.into, to.at - kLineHalf * to.into};
  for (const int off : {kOff, kOffOfStrip}) {
    const cv::Point2f aside = (static_cast<float>(off) + 1.0f) * leftOf(way.along);
    for (const cv::Point2f& p : seen) {
      const int left = surfaceAt(surface, p + aside), right = surfaceAt(surface, p - aside);
      if (left == 0 || right == 0 || left == right) continue;
      if (isAllAlong(way, aside, left, surface) || isAllAlong(way, -aside, right, surface))
        return SurfaceBorder{left, right, off};
    }
  }
  return std::nullopt;
}

void setSides(const SurfaceBorder& border, const LineEnd& from, const LineEnd& to,
              const cv::Mat& hole, cv::Mat& surface) {
  const Way way{from, to};
  const cv::Point2f start = from.at - from.length * way.along;
  const float length = from.length + way.gap + to.length;
  constexpr int kMargin = kOff + 1;
  const cv::Point2f stop = start + length * way.along;
  const cv::Rect ends = cv::boundingRect(std::vector<cv::Point2f>{start, stop}),
                 near = cv::Rect(ends.x - kMargin, ends.y - kMargin, ends.width + 2 * kMargin,
                                 ends.height + 2 * kMargin) &
                        cv::Rect({0, 0}, surface.size());
  for (int v = near.y; v < near.br().y; ++v) {
    for (int u = near.x; u < near.br().x; ++u) {
      std::uint8_t& label = surface.at<std::uint8_t>(v, u);
      const bool guess = hole.at<std::uint8_t>(v, u) != 0 && isGuess(label);
      if (label != border.left && label != border.right && !guess) continue;
      const cv::Point2f d = cv::Point2f(static_cast<float>(u), static_cast<float>(v)) - start;
      const float t = d.dot(way.along), s = d.dot(leftOf(way.along));
      if (t >= 0.0f && t <= length && std::abs(s) <= static_cast<float>(guess ? kOff : border.off))
        label = static_cast<std::uint8_t>(s > 0.0f ? border.left : border.right);
    }
  }
}

int surfaceAt(const cv::Mat& surface, const cv::Point2f& p) {
  return isSet(surface, p) ? surface.at<std::uint8_t>(cvRound(p.y), cvRound(p.x)) : 0;
}

}  // namespace calipso::render
