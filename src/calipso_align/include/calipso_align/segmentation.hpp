#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calipso_align/colour_model.hpp"
#include "calipso_align/label_cut.hpp"
#include "calipso_align/shape_prior.hpp"

namespace calipso::align {

// What the user marks in a stroke image (CV_8U): 0 nothing, kBackgroundStroke, or an object's label.
constexpr int kBackgroundStroke = 255;

// An object to be found in the picture, and where the user says that it lies.
struct SegmentationTarget {
  std::string name;
  int label = 0;                 // 1..254, distinct
  cv::Rect rect;                 // px; empty: anywhere
  std::vector<cv::Point> lasso;  // px, polygon; empty: none. The object lies inside both.
  cv::Mat silhouette;            // CV_8U: roughly its shape and place, or empty. May be larger than
                                 // the picture, with an equal margin on opposite sides.
};

struct SegmenterParams {
  int components = 6;             // Gaussians per colour model
  int rounds = 4;                 // of colour model and cut on the coarse picture
  int coarse_pixels = 40000;      // the coarse picture has at most about this many
  int band_px = 3;                // half width of the band around the coarse boundary, coarse pixels
  float outlier_cost = 18.0f;     // nats; cost of a colour that a model does not know
  float shape_weight = 4.0f;      // nats; the most that a silhouette says about a pixel
  float shape_tolerance = 0.04f;  // of the picture's width; how wrong a silhouette's outline may be
  SmoothnessParams smoothness;
};

// Interactive segmentation of one picture into several objects and the background: coarse first,
// then a narrow band with the colour models frozen. Colour models are kept between calls, so that
// a further stroke is cheap. One thread at a time.
class Segmenter {
 public:
  // image: CV_8UC3 BGR, kept by reference count.
  // @throw std::invalid_argument naming the target, the value and the remedy
  Segmenter(const cv::Mat& image, std::vector<SegmentationTarget> targets,
            SegmenterParams params = {});

  // Segments with these strokes (CV_8U, the picture's size, or empty for none). Returns CV_8U: 0
  // none, else the object's label. The first call fits the colour models, further ones refine them.
  // @throw std::invalid_argument naming the object and the remedy, for strokes that name no object,
  //        contradict the rectangles or leave an object without a pixel
  const cv::Mat& segment(const cv::Mat& strokes);

  const cv::Mat& labels() const { return labels_; }
  const std::vector<SegmentationTarget>& targets() const { return targets_; }

 private:
  struct Level;  // picture, constraints and labels at one resolution

  void checkStrokes(const cv::Mat& strokes) const;
  void checkResult() const;
  Level makeLevel(const cv::Mat& strokes, double scale) const;
  void initialiseModels(const Level& level);
  void refitModels(const Level& level);
  std::vector<cv::Mat> costs(const Level& level) const;
  cv::Mat evidence(const Level& level, size_t k, const std::vector<cv::Mat>& cost) const;
  void placeSilhouettes(const Level& coarse);
  void addShapeOdds(Level& level) const;

  cv::Mat image_;
  std::vector<SegmentationTarget> targets_;
  SegmenterParams params_;
  std::vector<ColourModel> models_;  // 0: background, k: targets_[k - 1]; empty before the first call
  std::vector<std::optional<PlacedShape>> shapes_;  // in pixels of `image_`
  cv::Mat labels_;
};

}  // namespace calipso::align
