#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace calipso::bag {

// Finds where a clip goes over to another shot: there a frame has little to do with the one before,
// while the frames before and after follow each other closely. Light that is switched on leaves the
// picture's structure, and what flashes up is gone again with the next frame.
class ShotChanges {
 public:
  void add(const cv::Mat& frame);  // 8 bit, one to four channels; frames in order
  // Indices of the frames with which a new shot begins, ascending.
  std::vector<int> found() const;

 private:
  cv::Mat previous_;                   // CV_32F, small
  std::vector<double> dissimilarity_;  // 1 - correlation of frames k and k + 1
};

}  // namespace calipso::bag
