#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace calipso::render {

// Which shift of the picture each pixel of a hole is copied by, so that the seams between shifts and towards the
// hole's rim show least: graph cuts by alpha expansion (Kwatra et al. 2003, Pritch et al. 2009).
class ShiftCut {
 public:
  static constexpr int kNone = 255;

  // @param image CV_32FC3; hole, source CV_8UC1: to be filled; may be copied from
  // @param shifts px, at most 254; scale: size of these pixels in the finest level's
  ShiftCut(const cv::Mat& image, const cv::Mat& hole, const cv::Mat& source, std::vector<cv::Point> shifts, float scale);

  // Every pixel takes the shift that fits it best alone.
  void start();
  // Labels of a level of half the size, with the same shifts in the same order.
  void startFrom(const ShiftCut& coarse);

  // Offers every shift once. @param reach only to pixels that have it within so many px; < 0: to all
  void sweep(int reach);

  const cv::Mat& labels() const { return labels_; }  // CV_8UC1, index of the shift; kNone outside the hole, and where none fits
  const std::vector<cv::Point>& shifts() const { return shifts_; }

  // The same shifts in pixels of half the size, each moved by up to a pixel to where its own pixels' surroundings,
  // or else the whole picture, agree best.
  std::vector<cv::Point> refinedShifts(const cv::Mat& fine_image, const cv::Mat& fine_source) const;

 private:
  struct Pixel {
    cv::Point at;
    int rim = -1;  // row in rim_costs_, -1: too deep in the hole
  };
  bool isSource(const cv::Point& p) const {
    return p.x >= 0 && p.y >= 0 && p.x < source_.cols && p.y < source_.rows && source_.at<std::uint8_t>(p) != 0;
  }
  const cv::Vec3f& colour(const cv::Point& p) const { return image_.at<cv::Vec3f>(p); }
  bool fits(const cv::Point& p, int label) const { return label != kNone && isSource(p + shifts_[label]); }
  float single(const Pixel& pixel, int label);
  float rimCost(const cv::Point& p, const cv::Point& shift) const;
  float pair(const cv::Point& p, const cv::Point& q, int a, int b) const;
  bool expand(int label, int reach);
  void repair();

  cv::Mat image_, hole_, source_;
  cv::Mat labels_, index_;  // index_: CV_32S, into pixels_
  std::vector<cv::Point> shifts_;
  float scale_;
  std::vector<Pixel> pixels_;
  std::vector<float> rim_costs_;  // per rim pixel and shift; < 0: not yet computed
};

}  // namespace calipso::render
