#pragma once

#include <map>
#include <opencv2/core.hpp>
#include <opencv2/video/tracking.hpp>
#include <optional>
#include <vector>

#include "calipso_align/gaussian_mixture.hpp"
#include "calipso_align/label_cut.hpp"
#include "calipso_align/mask_edge.hpp"
#include "calipso_align/rigid_shape.hpp"

namespace calipso::align {

struct LayerAppearance;

// Search and block are for 640 px of the picture's longer side; MaskTracker multiplies them for larger
// pictures.
struct TrackerParams {
  int components = 5;          // Gaussians per colour model
  int margin_px = 40;          // surroundings of an object that are looked at
  int band_px = 5;             // the outline is looked for this close to where the flow puts it
  int search_px = 96;          // how far an object can go from one frame to the next
  int block_px = 4;            // side of the squares whose means tell stillness and large motions
  float still_levels = 5.0f;   // grey levels; means that change less than this are still
  float still_share = 0.002f;  // ... in all but this share of the object and its rim
  float prior_cost = 2.0f;     // nats per pixel of distance from the predicted outline
  // nats; the most that the prediction says, unless the background contradicts it
  float prior_limit = 9.0f;
  float wrong_share = 0.02f;   // of the object: what a known background contradicts is cut anew
  int shape_search_px = 8;     // the outline of a model that moves along is looked for this close
  int shape_band_px = 3;       // ... and then pixels this close to it are told by their colours
  float outlier_cost = 18.0f;  // nats; cost of a colour that a model does not know
  SmoothnessParams smoothness{4.0f, 0.02f, 0.0f, 0.0f};
};

struct TrackedMask {
  cv::Mat labels;           // CV_8U: 0 none, else the object's label
  float confidence = 1.0f;  // 0..1, of the least certain object
};

// Carries a label image through a video. Each object is a layer that moves by itself in front of a
// background that is remembered: a pixel near the predicted outline is the object's when the object
// of the previous frame, moved along, explains it better than the background does. What neither
// explains is left to colour models. A cut settles the labels, the coverage of the edge pixels the
// outline. An object whose surroundings do not change keeps its mask at hardly any cost. One that
// has gone is looked for wherever the background is not what it was. Objects of
// one frame are followed in parallel, each from where the others were. One caller at a time; frames
// in order.
class MaskTracker {
 public:
  // image: CV_8UC3, labels: CV_8U, of equal size.
  // @throw std::invalid_argument naming size or type
  MaskTracker(const cv::Mat& image, const cv::Mat& labels,
              const std::map<int, ModelSurface>& models = {}, TrackerParams params = {});

  // The next frame.
  // @throw std::invalid_argument naming size or type of what does not fit the key frame
  TrackedMask track(const cv::Mat& image);

 private:
  struct Object {
    int label = 0;
    GaussianMixture colours;         // of the key frame
    GaussianMixture recent_colours;  // of the last frame in which its mask was certain
    cv::Mat mask;                    // CV_8U, the whole picture
    cv::Mat expected;                // CV_8U, where its motion alone has put it
    cv::Mat coverage;        // CV_8U, as `mask` but with the share of the pixels along its edge
    cv::Mat reference_mean;  // means of squares of the frame in which `mask` was found
    int key_area = 0;        // px
    float confidence = 1.0f;
    cv::Ptr<cv::DISOpticalFlow> flow;  // has buffers of its own
    std::optional<RigidShape> shape;   // while the object moves as its model does
    cv::Mat hidden;  // CV_8U, or empty: what stands before it, as far as its shape tells
  };

  // Where the motion of an object's layer puts it, on a part of the picture.
  struct Prediction {
    cv::Mat core;      // CV_8U, surely the object's
    cv::Mat motion;    // CV_32FC2, backward
    cv::Mat coverage;  // CV_8U, the previous frame's, moved along
    cv::Mat mask;      // CV_8U 0 or 255
    cv::Mat distance;  // from its outline, px, negative inside; empty where there is no mask
    cv::Mat band;      // CV_8U, where the outline is looked for
  };
  struct Layers;

  void rememberBackground(const cv::Mat& image);
  KnownBackground backgroundIn(const cv::Rect& roi, const cv::Mat& image,
                               const cv::Mat& flow) const;
  void follow(Object& object, const cv::Mat& image, const cv::Mat& flow, const cv::Mat& rough);
  cv::Mat asBeforeAround(const std::vector<Object*>& objects, const cv::Mat& image) const;
  void lose(Object& object) const;
  // Takes up the lost objects that have come back.
  void takeUpAgain(const cv::Mat& image, const cv::Mat& means);
  // What two objects claim is left to one of them.
  void settleClaims();
  static void leave(Object& object, const cv::Mat& pixels);  // takes these from its mask
  TrackedMask combine() const;
  void settle(Object& object, const cv::Mat& image, const cv::Mat& flow, const cv::Mat& rough,
              const cv::Rect& roi);
  // Takes a mask as where the object is, with its edge settled.
  void accept(Object& object, const cv::Mat& view, const KnownBackground& background, double noise,
              cv::Mat mask, const cv::Rect& roi) const;
  std::vector<cv::Mat> costsOf(const cv::Mat& view, const cv::Mat& band, const cv::Mat& distance,
                               const LayerAppearance& back, const LayerAppearance& fore,
                               float prior_limit) const;
  Prediction predict(const Object& object, const cv::Mat& flow, const cv::Mat& rough,
                     const cv::Rect& roi) const;
  Layers layersOf(const Object& object, const cv::Mat& view, const Prediction& prediction,
                  const KnownBackground& background, const GaussianMixture& surroundings,
                  const cv::Rect& roi) const;
  void cutContradicted(const Object& object, const cv::Mat& view, const Prediction& prediction,
                       const KnownBackground& background, const Layers& layers, const cv::Rect& roi,
                       cv::Mat& labels) const;
  bool fitShape(Object& object, const cv::Mat& view, const KnownBackground& background,
                const Layers& layers, const cv::Rect& roi, Prediction& prediction) const;
  cv::Mat othersIn(const Object& object, const cv::Mat& view, const cv::Mat& predicted,
                   const cv::Rect& roi) const;
  void checkInput(const cv::Mat& image, const cv::Mat& labels) const;

  TrackerParams params_;
  cv::Size size_;
  std::vector<Object> objects_;
  cv::Mat previous_image_, previous_grey_, previous_means_;
  cv::Mat occupied_;            // CV_8U: any object of the previous frame
  cv::Mat as_before_;           // CV_8U, or empty: shows the background as it was
  cv::Mat suspects_;            // CV_8U, or empty: may be an object that was lost, and comes back
  KnownBackground background_;  // the whole picture
};

}  // namespace calipso::align
