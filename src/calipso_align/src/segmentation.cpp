#include "calipso_align/segmentation.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <utility>

#include "segmentation_checks.hpp"

namespace calipso::align {
namespace {

// A mask of fewer pixels does not tell what something looks like.
constexpr int kMinModelPixels = 20;

}  // namespace

Segmenter::Segmenter(const cv::Mat& image, std::vector<SegmentationTarget> targets,
                     SegmenterParams params, const cv::Mat& depth)
    : size_(image.size()), targets_(std::move(targets)), params_(params) {
  checkPicture(image);
  checkTargets(targets_, size_);
  checkDepth(depth, size_);
  const Relief relief = makeRelief(image, depth);
  view_ = viewOf(targets_, size_);
  image_ = image(view_);
  const double share = static_cast<double>(params_.coarse_pixels) / view_.area();
  coarse_ = makeLevel(image, targets_, relief, view_, std::min(1.0, std::sqrt(share)));
  fine_ = makeLevel(image, targets_, relief, view_, 1.0);
}

const cv::Mat& Segmenter::segment(const cv::Mat& strokes) {
  checkStrokes(strokes, targets_, size_);
  const cv::Mat seen = strokes.empty() ? strokes : strokes(view_);
  setSeeds(targets_, seen, coarse_);
  setSeeds(targets_, seen, fine_);
  if (models_.empty() || strokesContradictModels())
    learn();
  else
    cut(freePixels(coarse_), coarse_);
  cutFine();
  adoptLabels();
  return labels_;
}

// Alternates colour models and cuts on the coarse picture, as GrabCut does; silhouettes join once the
// first cut says where the objects are.
void Segmenter::learn() {
  constexpr int kPlacements = 2;
  coarse_.labels.setTo(0);
  for (size_t k = 0; k < targets_.size(); ++k)
    coarse_.labels.setTo(static_cast<double>(k + 1), coarse_.seeds == static_cast<int>(k + 2));
  shapes_.assign(targets_.size(), std::nullopt);
  initialiseModels();
  for (int round = 0; round < params_.rounds; ++round) {
    evaluate(coarse_);
    cut(freePixels(coarse_), coarse_);
    const cv::Mat contradicted = contradictedPixels(coarse_);
    refitColours();
    if (round < kPlacements) placeSilhouettes();
    refitSurfaces(round == 0 ? certainPixels(contradicted) : std::vector<cv::Mat>());
  }
  evaluate(coarse_);
  evaluate(fine_);
}

// From strokes and from what lies outside of the rectangles.
void Segmenter::initialiseModels() {
  const cv::Mat outside = surroundings(coarse_) & (coarse_.region == 0) & (coarse_.seeds <= 1);
  const cv::Mat background = outside | (coarse_.seeds == 1);
  if (cv::countNonZero(background) == 0)
    throw std::invalid_argument(
        "segmentation: rectangles and strokes leave no background to learn from; draw smaller "
        "rectangles or a background stroke");
  models_.assign(targets_.size() + 1, {});
  fitColours(coarse_, background, params_.components, models_[0]);
  for (size_t k = 0; k < targets_.size(); ++k) {
    cv::Mat own = coarse_.seeds == static_cast<int>(k + 2);
    if (cv::countNonZero(own) < kMinModelPixels) own |= coarse_.allowed[k] & (coarse_.seeds == 0);
    if (cv::countNonZero(own) == 0) {
      models_.clear();
      failWithoutForeground(targets_[k]);
    }
    fitColours(coarse_, own, params_.components, models_[k + 1]);
  }
}

void Segmenter::refitColours() {
  const cv::Mat near = surroundings(coarse_);
  for (size_t k = 0; k < models_.size(); ++k) {
    const cv::Mat own = (coarse_.labels == static_cast<int>(k)) & near;
    if (cv::countNonZero(own) >= kMinModelPixels)
      fitColours(coarse_, own, params_.components, models_[k]);
  }
}

// Colours alone may have given parts of an object to the background and the reverse. Per label what
// is its own beyond doubt, should it have that label: of the background what lies clear of all
// silhouettes, of an object what lies in its silhouette and is there for its own colour's sake.
std::vector<cv::Mat> Segmenter::certainPixels(const cv::Mat& contradicted) const {
  const cv::Size size = coarse_.image.size();
  const int margin = static_cast<int>(0.5 * params_.shape_tolerance * size.width);
  std::vector<cv::Mat> certain = {cv::Mat(size, CV_8U, cv::Scalar(255))};
  for (size_t k = 0; k < targets_.size(); ++k) {
    const cv::Mat placed =
        shapes_[k] ? cv::Mat(placedSilhouette(k, size) > 127) : coarse_.allowed[k];
    certain[0].setTo(0, grown(placed, shapes_[k] ? margin : 0));
    certain.push_back(placed & ~contradicted);
  }
  for (size_t k = 0; k < certain.size(); ++k) certain[k] |= coarse_.seeds == static_cast<int>(k + 1);
  return certain;
}

void Segmenter::refitSurfaces(const std::vector<cv::Mat>& certain) {
  if (coarse_.relief.empty()) return;
  const cv::Mat near = surroundings(coarse_);
  const double area = cv::countNonZero(coarse_.region);
  for (size_t k = 0; k < models_.size(); ++k) {
    cv::Mat own = (coarse_.labels == static_cast<int>(k)) & near;
    const double share = cv::countNonZero(own & coarse_.region) / area;
    if (!certain.empty()) own &= certain[k];
    if (cv::countNonZero(own) >= kMinModelPixels)
      models_[k].surfaces = SurfaceModel::fit(coarse_.relief, own, share, params_.surfaces);
  }
}

// Whether most of some label's stroke looks more like another label.
bool Segmenter::strokesContradictModels() const {
  std::vector<int> marked(models_.size(), 0), contradicting(models_.size(), 0);
  for (int y = 0; y < coarse_.seeds.rows; ++y)
    for (int x = 0; x < coarse_.seeds.cols; ++x) {
      const int seed = coarse_.seeds.at<uchar>(y, x);
      if (seed == 0 || !coarse_.region.at<uchar>(y, x)) continue;
      const float own = coarse_.costs[seed - 1].at<float>(y, x);
      ++marked[seed - 1];
      contradicting[seed - 1] +=
          std::any_of(coarse_.costs.begin(), coarse_.costs.end(),
                      [&](const cv::Mat& cost) { return cost.at<float>(y, x) < own; });
    }
  for (size_t k = 0; k < models_.size(); ++k)
    if (2 * contradicting[k] > marked[k]) return true;
  return false;
}

// What colours and strokes say for one target against everything else, nats per coarse pixel.
cv::Mat Segmenter::evidence(size_t k) const {
  constexpr double kMaxEvidence = 6.0;
  const std::vector<cv::Mat>& cost = coarse_.costs;
  cv::Mat result = cost[0] - cost[k + 1];
  for (size_t j = 0; j < targets_.size(); ++j)
    if (j != k) result = cv::min(result, cv::max(cost[j + 1] - cost[k + 1], 0));
  const cv::Mat own = coarse_.seeds == static_cast<int>(k + 2);
  result.setTo(-kMaxEvidence, (coarse_.allowed[k] == 0) | (coarse_.seeds != 0));
  result.setTo(kMaxEvidence, own);
  return cv::min(cv::max(result, -kMaxEvidence), kMaxEvidence);
}

void Segmenter::placeSilhouettes() {
  evaluateCosts(models_, params_.outlier_cost, coarse_);
  const double factor = static_cast<double>(image_.cols) / coarse_.image.cols;
  for (size_t k = 0; k < targets_.size(); ++k) {
    const cv::Mat& full = targets_[k].silhouette;
    if (full.empty() || cv::countNonZero(full) == 0) continue;
    cv::Mat silhouette;
    cv::resize(full, silhouette, cv::Size(), 1.0 / factor, 1.0 / factor, cv::INTER_AREA);
    const cv::Matx23d start(1, 0, -0.5 * (full.cols - size_.width) - view_.x,  //
                            0, 1, -0.5 * (full.rows - size_.height) - view_.y);
    shapes_[k] = placeSilhouette(silhouette, evidence(k), scaled(start, 1.0 / factor));
    shapes_[k]->map = scaled(shapes_[k]->map, factor);
  }
}

// Target k's silhouette where it was placed, in a picture of another size.
cv::Mat Segmenter::placedSilhouette(size_t k, const cv::Size& size) const {
  cv::Mat placed, resized;
  cv::warpAffine(targets_[k].silhouette, placed, shapes_[k]->map, image_.size());
  cv::resize(placed, resized, size, 0, 0, cv::INTER_AREA);
  return resized;
}

// A silhouette that does not fit what the colours say has no say.
void Segmenter::addShapeOdds(SegmentationLevel& level) const {
  constexpr double kNoAgreement = 0.5, kFullAgreement = 0.8;
  for (size_t k = 0; k < targets_.size(); ++k) {
    if (!shapes_[k]) continue;
    const double trust = std::clamp(
        (shapes_[k]->agreement - kNoAgreement) / (kFullAgreement - kNoAgreement), 0.0, 1.0);
    level.costs[k + 1] -=
        shapeOdds(placedSilhouette(k, level.image.size()) > 127, static_cast<float>(trust * params_.shape_weight),
                  params_.shape_tolerance * static_cast<float>(size_.width) * static_cast<float>(level.image.cols) /
                      static_cast<float>(image_.cols));
  }
}

void Segmenter::evaluate(SegmentationLevel& level) const {
  evaluateCosts(models_, params_.outlier_cost, level);
  addShapeOdds(level);
}

void Segmenter::cut(const cv::Mat& free, SegmentationLevel& level) const {
  SmoothnessParams smoothness = params_.smoothness;
  smoothness.contrast_scale = level.contrast_scale;
  smoothness.jump_scale = level.jump_scale;
  cutLabels(level.image, free, level.costs, smoothness, level.labels,
            level.relief.empty() ? nullptr : &level.relief);
}

// Settles on the full picture what the coarse one leaves open.
void Segmenter::cutFine() {
  cv::Mat enlarged;
  cv::resize(coarse_.labels, enlarged, image_.size(), 0, 0, cv::INTER_NEAREST);
  enlarged.copyTo(fine_.labels, freePixels(fine_));
  const double factor = static_cast<double>(image_.cols) / coarse_.image.cols;
  const int band = static_cast<int>(std::ceil(params_.band_px * factor));
  cut(uncertainPixels(fine_, band), fine_);
}

void Segmenter::adoptLabels() {
  labels_ = cv::Mat::zeros(size_, CV_8U);
  for (size_t k = 0; k < targets_.size(); ++k) {
    const cv::Mat own = fine_.labels == static_cast<int>(k + 1);
    if (cv::countNonZero(own) == 0) failWithoutForeground(targets_[k]);
    labels_(view_).setTo(targets_[k].label, own);
  }
}

}  // namespace calipso::align
