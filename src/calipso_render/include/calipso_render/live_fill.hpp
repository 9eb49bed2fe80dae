#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

namespace calipso::render {

// Fills holes of a place that moves by itself (clouds, water) from the frame at hand: every hole
// pixel shows what this frame shows at its origin, so that it moves like its surroundings. To every
// copy one offset of colour is added (as gains are to pictures of a panorama, Brown & Lowe 2007) so
// that it meets the picture and the other copies as it does in the key frame: where it comes from a
// cloud may pass, or the water mirror another part of the sky. What mean colours still differ by
// where copies meet fades out beside the seams.
class LiveFill {
 public:
  LiveFill() = default;
  // @param origin CV_16SC2: what a hole pixel is a copy of; (-1, -1): it is no hole, or nothing
  // that moves
  // @param lift CV_32FC3: what is added to a hole pixel's origin at its place, code values
  // @param hole CV_8UC1, all that is not seen
  // @param key_bgr, key_labels of the key frame, as of corrections()
  LiveFill(const cv::Mat& origin, const cv::Mat& lift, const cv::Mat& hole, const cv::Mat& key_bgr,
           const cv::Mat& key_labels);

  bool empty() const { return origin_.empty(); }

  // What a frame's copies are corrected by, code values.
  struct Corrections {
    std::vector<cv::Vec3f> copies;  // each as a whole
    std::vector<cv::Vec3f> seams;   // besides, at every seam
  };

  // @param bgr CV_8UC3; labels CV_8UC1, 0: the place itself is seen
  Corrections corrections(const cv::Mat& bgr, const cv::Mat& labels) const;

  // The pixel's colour in code values, with the camera's noise smoothed away. @param noise its
  // deviation, code values
  // @return false where this fill has none, or the frame hides its origin
  bool at(const cv::Mat& bgr, const cv::Mat& labels, const Corrections& corrections, float noise,
          int u, int v, cv::Vec3f& colour) const;

 private:
  struct Seam {
    cv::Point other,
        own;  // places that should look alike: beyond the seam, and what this side's copy has there
    float share;       // of the difference that this side takes
    int copy, beyond;  // on this side; beyond the seam, kPicture: the picture itself
    cv::Vec3f lift;    // how much more of it the other side has
  };
  // By how much the two sides of a seam differ; none where the frame hides one of them.
  using Misses = std::vector<std::optional<cv::Vec3f>>;
  void findCopies();
  void addSeams(const cv::Mat& hole);
  Misses missesIn(const cv::Mat& bgr, const cv::Mat& labels) const;
  std::vector<cv::Vec3f> broughtBack(const Misses& misses) const;

  cv::Mat origin_, seam_, weight_;  // CV_16SC2; CV_32SC1, -1: none near; CV_32FC1
  cv::Mat lift_;                    // CV_32FC3
  cv::Mat copy_;                    // CV_32SC1: connected pixels copied by the same offset
  int copies_ = 0;
  std::vector<Seam> seams_;
  Misses at_key_;
};

}  // namespace calipso::render
