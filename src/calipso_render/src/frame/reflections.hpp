#pragma once

#include <opencv2/core.hpp>

#include "frame/pixel.hpp"
#include "frame/seen_place.hpp"
#include "frame/staged_frame.hpp"

namespace calipso::render {

// What support planes mirror of a frame's objects: drawn anew, and taken off the video where it is
// of objects at rest. Nothing where the picture shows no reflection, or from another camera than
// the key frame's.
class Reflections {
 public:
  static constexpr std::uint8_t kChanged = 255, kSame = 1;  // of marks()

  // The frame must outlive this.
  Reflections(const StagedFrame& frame, const SeenPlace& place);

  // CV_8UC1, whole picture: whether what is mirrored differs from what the video has, 0 where
  // nothing is; empty: as in the video
  const cv::Mat& marks() const { return marks_; }
  // CV_8UC3: the frame without what it mirrors of objects at rest, where what comes to light is
  // found by it; else the frame
  const cv::Mat& unmirrored() const { return unmirrored_; }

  // The frame's pixel without it.
  cv::Vec3f takenOff(int u, int v) const;
  // Adds what the planes mirror now to what a pixel shows without it. Where nothing changed it is
  // the frame's own.
  void add(int u, int v, Pixel& pixel) const;
  // What that is where it is added to a place that comes to light.
  cv::Vec3f added(int u, int v) const;

 private:
  void draw();
  void mark(const cv::Rect& box);

  const StagedFrame& frame_;
  cv::Mat now_;  // CV_32FC3, whole picture; empty: as in the video
  cv::Mat marks_, unmirrored_;
};

}  // namespace calipso::render
