#pragma once

#include <map>
#include <opencv2/core.hpp>
#include <opencv2/video/tracking.hpp>
#include <vector>

#include "calipso_align/gaussian_mixture.hpp"
#include "calipso_align/label_cut.hpp"

namespace calipso::align {

struct TrackerParams {
  int components = 5;              // Gaussians per colour model
  int margin_px = 40;              // surroundings of an object that are looked at
  int band_px = 5;                 // the outline is looked for this close to where the flow puts it
  int search_px = 96;              // how far an object can go from one frame to the next
  float still_levels = 5.0f;       // grey levels; what changes less than this (4 x 4 px mean) is still
  float still_share = 0.002f;      // ... in all but this share of the object and its rim
  float prior_cost = 1.0f;         // nats per pixel of distance from the predicted outline
  float outlier_cost = 18.0f;      // nats; cost of a colour that a model does not know
  SmoothnessParams smoothness;
};

struct TrackedMask {
  cv::Mat labels;          // CV_8U: 0 none, else the object's label
  float confidence = 1.0f; // 0..1, of the least certain object
  int moved = 0;           // objects that were looked for anew; the others kept their mask
};

// Carries a label image through a video: backward flow predicts where each object went, a cut in a
// narrow band around the predicted outline settles it. An object whose surroundings do not change
// keeps its mask at hardly any cost. One thread at a time; frames in order.
class MaskTracker {
 public:
  // image: CV_8UC3, labels: CV_8U, of equal size.
  // @throw std::invalid_argument naming size or type
  MaskTracker(const cv::Mat& image, const cv::Mat& labels, TrackerParams params = {});

  // The next frame. `prior`: CV_8U labels where something better than the flow predicts them (the
  // aligned models' silhouettes), or empty.
  // @throw std::invalid_argument naming size or type of what does not fit the key frame
  TrackedMask track(const cv::Mat& image, const cv::Mat& prior = {});

 private:
  struct Object {
    int label = 0;
    GaussianMixture colours;
    cv::Mat mask;            // CV_8U, the whole picture
    cv::Mat reference_mean;  // 4 x 4 px means of the frame in which `mask` was found
    double key_area = 0.0;   // px
    float confidence = 1.0f;
  };

  bool isStill(const Object& object, const cv::Mat& means) const;
  cv::Point coarseShift(const Object& object, const cv::Mat& means) const;
  cv::Mat backwardFlow(const cv::Mat& grey, const cv::Mat& means,
                       const std::vector<Object*>& moving) const;
  cv::Mat predict(const Object& object, const cv::Mat& flow) const;
  void follow(Object& object, const cv::Mat& image, const cv::Mat& predicted);
  TrackedMask combine(int moved) const;
  void settle(Object& object, const cv::Mat& image, const cv::Mat& predicted, const cv::Rect& roi);
  void checkInput(const cv::Mat& image, const cv::Mat& labels) const;

  TrackerParams params_;
  cv::Size size_;
  std::vector<Object> objects_;
  cv::Mat previous_grey_, previous_means_;
  cv::Ptr<cv::DISOpticalFlow> flow_;
};

}  // namespace calipso::align
