#include "fill/plane_pattern.hpp"

#include <opencv2/imgproc.hpp>

#include "draw/side_by_side.hpp"
#include "fill/plane_chart.hpp"

namespace calipso::render {
namespace {

constexpr double kMistaken = 0.5;  // of a plane's pixels that repeat themselves as another does

// Planes, none of them a support plane, most of which repeat themselves as a support plane does.
// @param repeats CV_8UC1, != 0: what is seen does
cv::Mat mistakenPlanes(const cv::Mat& repeats, const cv::Mat& source, const InpaintParams& params) {
  cv::Mat mistaken = cv::Mat::zeros(repeats.size(), CV_8U);
  for (int k = params.supports + 1; k <= static_cast<int>(params.planes.size()); ++k) {
    const cv::Mat here = params.surface == k, seen = here & source;
    if (cv::countNonZero(seen & repeats) > kMistaken * cv::countNonZero(seen)) mistaken |= here;
  }
  return mistaken;
}

}  // namespace

InpaintParams supposedSupports(const InpaintParams& params, const cv::Size& size) {
  InpaintParams supposed = params;
  // No cv::Mat::zeros: that would write into what the copy shares with its original.
  supposed.surface = cv::Mat(size, CV_8U, cv::Scalar(0)),
  supposed.sure = cv::Mat(size, CV_8U, cv::Scalar(0));
  for (int k = 0; k < params.supports; ++k) {
    const cv::Matx33d& plane = params.planes[k];
    for (int v = 0; v < size.height; ++v) {
      for (int u = 0; u < size.width; ++u) {
        std::uint8_t& label = supposed.surface.at<std::uint8_t>(v, u);
        if (label == 0 && plane(2, 0) * u + plane(2, 1) * v + plane(2, 2) > 0.0)
          label = static_cast<std::uint8_t>(k + 1);
      }
    }
  }
  return supposed;
}

bool followPattern(const PatternedPlane& plane, const PictureToFill& picture, int fewest,
                   InpaintParams& params) {
  const cv::Size size = picture.hole.size();
  // As the lattice's, but of all that is around.
  const auto chart = planeChart(plane.to_plane, plane.hole, picture.source | picture.hole);
  if (!chart) return false;
  const cv::Mat known = chart->whole(picture.source), hole = chart->any(picture.hole),
                look = chart->carried(picture.look), sample = chart->whole(plane.seen);
  cv::Mat repeats, lively;
  doAll(true, {[&] { repeats = repeatsBy(plane.lattice, look, known, sample); },
               [&] { lively = asLively(look, known, sample); }});
  repeats &= lively & ~hole;
  cv::Mat seen, behind;
  cv::warpPerspective(repeats, seen, chart->to_picture, size, cv::INTER_NEAREST);
  cv::warpPerspective(goesOnByPattern(repeats, known, hole), behind, chart->to_picture, size,
                      cv::INTER_NEAREST);
  const cv::Mat mistaken = mistakenPlanes(seen, picture.source, params),
                untold = mistaken | (params.surface == 0) | ~params.sure |
                         (params.surface > static_cast<double>(params.planes.size()));
  cv::Mat found = (seen & picture.source) | (behind & picture.hole & untold);
  found.setTo(0, (params.surface > 0) & (params.surface <= params.supports) & params.sure);
  if (cv::countNonZero(found & picture.hole) < fewest) return false;
  params.surface.setTo(0, mistaken & picture.hole);
  params.surface.setTo(plane.label, found), params.sure.setTo(255, found);
  params.surface.setTo(0, (params.surface == plane.label) & ~params.sure & picture.source);
  return true;
}

}  // namespace calipso::render
