#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "fill/inpaint_at_size.hpp"
#include "working_size.hpp"

namespace calipso::render {
namespace {

// From a picture that is `times` as large, and what is known of it, to the one that is filled:
// there lines, patterns, planes and patches have the size that they are sought with.
class Reduction {
 public:
  Reduction(const cv::Size& large, int times)
      : times_(times),
        large_(large),
        small_((large.width + times - 1) / times, (large.height + times - 1) / times) {}

  // Means. @param picture of any type; may be empty
  cv::Mat means(const cv::Mat& picture) const { return reducedMeans(padded(picture), times_); }
  // The values in the squares' middles.
  cv::Mat middles(const cv::Mat& picture) const { return reducedValues(padded(picture), times_); }
  // CV_8UC1: 255 where any pixel of a square is set.
  cv::Mat any(const cv::Mat& mask) const {
    return mask.empty() ? mask : cv::Mat(means(mask != 0) > 0);
  }
  cv::Matx33d fromSmall(const cv::Matx33d& from_pixels) const {
    const double t = times_, middle = 0.5 * (times_ - 1);
    return from_pixels * cv::Matx33d(t, 0, middle, 0, t, middle, 0, 0, 1);
  }
  // Smooth. @param picture CV_32F
  cv::Mat enlarged(const cv::Mat& picture) const {
    cv::Mat out;
    cv::resize(picture, out, small_ * times_, 0.0, 0.0, cv::INTER_LINEAR);
    return out(cv::Rect({0, 0}, large_));
  }
  cv::Point squareOf(int u, int v) const { return {u / times_, v / times_}; }
  // The pixel that lies in a square as (u, v) does in its own.
  cv::Point alike(const cv::Vec2s& square, int u, int v) const {
    return {std::min(square[0] * times_ + u % times_, large_.width - 1),
            std::min(square[1] * times_ + v % times_, large_.height - 1)};
  }

 private:
  // To whole squares.
  cv::Mat padded(const cv::Mat& picture) const {
    if (picture.empty()) return picture;
    const cv::Size more = small_ * times_ - large_;
    cv::Mat out;
    cv::copyMakeBorder(picture, out, 0, more.height, 0, more.width, cv::BORDER_REPLICATE);
    return out;
  }

  int times_;
  cv::Size large_, small_;
};

InpaintParams reduced(const InpaintParams& params, const Reduction& reduction) {
  InpaintParams small = params;
  small.nearness = reduction.middles(params.nearness);
  small.surface = reduction.middles(params.surface);
  small.sky = reduction.middles(params.sky);
  small.sure = reduction.middles(params.sure);
  for (cv::Matx33d& plane : small.planes) plane = reduction.fromSmall(plane);
  return small;
}

// What the small picture was filled with, and the detail that its copies have in the large one.
InpaintResult enlarged(const cv::Mat& image, const cv::Mat& hole, const InpaintResult& small,
                       const Reduction& reduction) {
  const cv::Mat smooth = reduction.enlarged(small.image);
  InpaintResult large{image.clone(), cv::Mat(image.size(), CV_16SC2, cv::Scalar(-1, -1)),
                      reduction.enlarged(small.lift).clone(), small.patches_found};
#pragma omp parallel for schedule(static)
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      if (hole.at<std::uint8_t>(v, u) == 0) continue;
      cv::Vec3f& colour = large.image.at<cv::Vec3f>(v, u);
      colour = smooth.at<cv::Vec3f>(v, u);
      const cv::Vec2s square = small.origin.at<cv::Vec2s>(reduction.squareOf(u, v));
      if (square[0] < 0) continue;
      const cv::Point from = reduction.alike(square, u, v);
      const cv::Vec3f detail = image.at<cv::Vec3f>(from) - smooth.at<cv::Vec3f>(from);
      for (int c = 0; c < 3; ++c) colour[c] = std::clamp(colour[c] + detail[c], 0.0f, 255.0f);
      large.origin.at<cv::Vec2s>(v, u) = {static_cast<short>(from.x), static_cast<short>(from.y)};
    }
  }
  return large;
}

}  // namespace

InpaintResult inpaint(const cv::Mat& image, const cv::Mat& hole, const cv::Mat& banned,
                      const InpaintParams& params) {
  return inpaintAsIn(image.size(), image, hole, banned, params);
}

InpaintResult inpaintAsIn(const cv::Size& picture, const cv::Mat& image, const cv::Mat& hole,
                          const cv::Mat& banned, const InpaintParams& params) {
  CV_Assert(image.type() == CV_32FC3 && hole.type() == CV_8UC1 && image.size() == hole.size());
  const int times = timesTooLarge(picture);
  if (times == 1) return inpaintAtSize(image, hole, banned, params);
  const Reduction reduction(image.size(), times);
  return enlarged(image, hole,
                  inpaintAtSize(reduction.means(image), reduction.any(hole), reduction.any(banned),
                                reduced(params, reduction)),
                  reduction);
}

}  // namespace calipso::render
