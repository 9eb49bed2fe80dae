#pragma once

#include <map>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calipso_align/gaussian_mixture.hpp"
#include "calipso_align/label_cut.hpp"
#include "calipso_align/segmentation_level.hpp"
#include "calipso_align/shape_prior.hpp"

namespace calipso::align {

struct SegmenterParams {
  int components = 6;          // Gaussians per colour model
  int surfaces = 24;           // Gaussians per model of surfaces
  int rounds = 4;              // of colour model and cut on the coarse picture
  int coarse_pixels = 40000;   // the coarse view has at most about this many
  int band_px = 2;             // half width of the band around the coarse boundary, coarse pixels
  float outlier_cost = 18.0f;  // nats; cost of a colour that a model does not know
  float shape_weight = 4.0f;   // nats; the most that a silhouette says about a pixel
  float shape_tolerance = 0.04f;  // of the picture's width; how wrong its outline may be
  SmoothnessParams smoothness;
};

// A model that was fitted to the first contour, in pixels of the view.
struct FittedShape {
  ModelView view;
  double agreement = 0.0;  // 0..1: overlap with the labels it was fitted to
};

// Interactive segmentation of one picture into several objects and the background (after GrabCut,
// Rother et al. 2004): coarse first, then a narrow band with the colour models frozen. Colour
// models are kept between calls, so that a further stroke costs two cuts only. One thread at a
// time.
class Segmenter {
 public:
  // image: CV_8UC3 BGR, kept by reference count; depth: CV_32F, m, 0 unknown, of the same size, or
  // empty; supports: as `depth`, of each plane that carries objects.
  // @throw std::invalid_argument naming the target, the value and the remedy
  Segmenter(const cv::Mat& image, std::vector<SegmentationTarget> targets,
            SegmenterParams params = {}, const cv::Mat& depth = {},
            const std::vector<cv::Mat>& supports = {});

  // Segments with these strokes (CV_8U, the picture's size, or empty for none): all of them, not
  // only the new ones. Returns CV_8U: 0 none, else the object's label. The first call learns the
  // colours; later ones learn anew only if a stroke contradicts what was learnt.
  // @throw std::invalid_argument naming the object and the remedy, for strokes that name no object
  //        or leave an object without a pixel
  const cv::Mat& segment(const cv::Mat& strokes);

  const cv::Mat& labels() const { return labels_; }
  const std::vector<SegmentationTarget>& targets() const { return targets_; }
  // What the user should know: objects that colours and depth hardly tell from their surroundings,
  // so that it is the rough placement that says where they are; and what was added.
  std::vector<std::string> remarks() const;
  void addRemark(const std::string& remark) { added_remarks_.push_back(remark); }
  // Per label, the models that were fitted to the first contours; none before the first call.
  std::map<int, ModelSurface> models() const;

 private:
  void learn();
  void initialiseModels();
  void refitColours();
  std::vector<cv::Mat> certainPixels(const cv::Mat& contradicted) const;
  void refitSurfaces(const std::vector<cv::Mat>& certain);
  bool strokesContradictModels() const;
  cv::Mat evidence(size_t k) const;
  void placeSilhouettes();
  cv::Mat placedSilhouette(size_t k, const cv::Size& size) const;
  void guide();
  void relearnColours();
  std::optional<FittedShape> fitModel(size_t k) const;
  void fitModels();
  void expectSurfaces(SegmentationLevel& level) const;
  void measureSurfaces();
  std::vector<cv::Mat> guidedPixels() const;
  void addShapeOdds(SegmentationLevel& level) const;
  void addSupportOdds(SegmentationLevel& level) const;
  void evaluate(SegmentationLevel& level) const;
  void cut(const cv::Mat& free, SegmentationLevel& level) const;
  void cutFine();
  void adoptLabels();

  cv::Size size_;  // of the picture
  cv::Mat picture_;
  cv::Rect view_;  // what matters of it: where targets may lie and what is near
  cv::Mat image_;  // the view
  std::vector<SegmentationTarget> targets_;
  SegmenterParams params_;
  SegmentationLevel coarse_, fine_;
  std::vector<LabelModel> models_;                  // per label number; empty before the first call
  std::vector<std::optional<PlacedShape>> shapes_;  // per target, in pixels of the view
  std::vector<std::optional<FittedShape>> fitted_;  // per target, of the view
  cv::Mat labels_;
  std::vector<std::string> added_remarks_;
};

}  // namespace calipso::align
