#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calipso_align/gaussian_mixture.hpp"
#include "calipso_align/model_view.hpp"
#include "calipso_align/relief.hpp"

namespace calipso::align {

// What the user marks in a stroke image (CV_8U): 0 nothing, kBackgroundStroke, or an object's
// label.
constexpr int kBackgroundStroke = 255;

// An object to be found in the picture, and where the user says that it lies.
struct SegmentationTarget {
  std::string name;
  int label = 0;  // 1..254, distinct
  cv::Rect rect;  // px; empty: anywhere
  // CV_8U: roughly its shape and place, or empty. May be larger than the picture, with an equal
  // margin on opposite sides.
  cv::Mat silhouette = {};
  ModelFitter fit_model = {};  // or none
};

// The picture at one resolution and all that a cut needs there. Label number 0 is the background,
// number k is targets[k - 1].
struct SegmentationLevel {
  cv::Mat image;                 // CV_8UC3
  std::vector<cv::Mat> allowed;  // CV_8U per target: where it may lie
  cv::Mat region;                // CV_8U: where any target may lie
  int near_px = 3;               // what is this close to the region counts as its surroundings
  cv::Mat seeds;                 // CV_8U: label number + 1 where a stroke says so, else 0
  cv::Mat labels;                // CV_8U: label numbers
  std::vector<cv::Mat> costs;    // CV_32F per label number, nats
  float contrast_scale = 0.0f;   // beta of label_cut.hpp over the region
  Relief relief;                 // empty without a depth image
  // CV_32F per label number, as the relief's inverse depth: where a fitted model has its surface, 0
  // outside of it; or empty
  std::vector<cv::Mat> expected;
  float jump_scale = 0.0f;  // of label_cut.hpp over the region
  cv::Mat mixed;  // CV_8U: where a jump of the relief makes a colour a mixture; empty: unknown
  // CV_8U: as seeds, of the flat piece or island of the relief that a pixel is in; or empty
  cv::Mat stroked;
  cv::Mat floating;  // CV_8U: as seeds, of the island of the relief that a pixel is in; or empty
  // per label number: its strokes lie on support planes themselves, as a cloth's do
  std::vector<char> lies_flat;
};

// Where the targets may lie in a picture and what is near.
cv::Rect viewOf(const std::vector<SegmentationTarget>& targets, const cv::Size& size);

// Takes part `view` of the picture. scale: of the level's picture to the view, at most 1; relief:
// of the picture, or empty.
SegmentationLevel makeLevel(const cv::Mat& image, const std::vector<SegmentationTarget>& targets,
                            const Relief& relief, const cv::Rect& view, double scale);

// Takes the strokes (CV_8U of the view, or empty) over into seeds and labels; an object's count
// where it may lie.
void setSeeds(const std::vector<SegmentationTarget>& targets, const cv::Mat& strokes,
              SegmentationLevel& level);

// How well a fitted model's surface is met by the relief.
struct ExpectedSurface {
  float sigma = 1.0f;         // of the relief's inverse depth about it
  float nearest_cost = 0.0f;  // nats, of a pixel that lies on it
  float before = 0.0f;        // inverse depth from which on something else stands before all of it
};

// What a label looks like, and where its surfaces lie once that is known.
struct LabelModel {
  std::optional<GaussianMixture> colours;  // all of them, or of surfaces where a relief tells them
  std::optional<GaussianMixture> open_colours;  // where a registered relief has no surface: sky
  std::optional<SurfaceModel> surfaces;
  std::optional<ExpectedSurface> expected;
};

// Colours of the pixels under a mask; where a registered relief tells sky from surfaces, of both.
void fitColours(const SegmentationLevel& level, const cv::Mat& mask, int components,
                LabelModel& model);

// Costs of every label number, of colours at most `outlier_cost`, kForbidden where a label may not
// be.
void evaluateCosts(const std::vector<LabelModel>& models, float outlier_cost,
                   SegmentationLevel& level);

// Label k's pixels for learning: an island of the relief is its object's whatever a cut left of it.
cv::Mat believedPixels(const SegmentationLevel& level, size_t k);

// Those of label k's pixels that are about as far away as its islands of the relief, if most lie on
// them: what else looks like the label may be something else. Else all of them.
cv::Mat nearIslands(const SegmentationLevel& level, const cv::Mat& own, size_t k);

// Pixels without a seed in the region.
cv::Mat freePixels(const SegmentationLevel& level);

// Pixels that would cost less with another label.
cv::Mat contradictedPixels(const SegmentationLevel& level);

// Free pixels near a change of label, or whose colour speaks against their label: what a finer
// level has to decide anew, thin parts included.
cv::Mat uncertainPixels(const SegmentationLevel& level, int band_px);

// The colours under a mask, evenly thinned out to what a model needs.
std::vector<cv::Vec3f> sampleColours(const cv::Mat& image, const cv::Mat& mask);

// Whatever lies near the region, objects and background.
cv::Mat surroundings(const SegmentationLevel& level);

}  // namespace calipso::align
