#include "calipso_align/segmentation.hpp"

#include <algorithm>
#include <cmath>
#include <future>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "calipso_align/mask_edge.hpp"
#include "segmentation_checks.hpp"

namespace calipso::align {
namespace {

// A mask of fewer pixels does not tell what something looks like.
constexpr int kMinModelPixels = 20;

}  // namespace

Segmenter::Segmenter(const cv::Mat& image, std::vector<SegmentationTarget> targets,
                     SegmenterParams params, const cv::Mat& depth,
                     const std::vector<cv::Mat>& supports)
    : size_(image.size()), picture_(image), targets_(std::move(targets)), params_(params) {
  checkPicture(image);
  checkTargets(targets_, size_);
  checkDepth(depth, size_);
  for (const cv::Mat& support : supports) checkDepth(support, size_);
  const Relief relief = makeRelief(image, depth, supports);
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
  if (models_.empty() || strokesContradictModels()) {
    learn();
    cutFine();
    adoptLabels();
    guide();
  } else {
    cut(freePixels(coarse_), coarse_);
  }
  cutFine();
  adoptLabels();
  return labels_;
}

// Alternates colour models and cuts on the coarse picture, as GrabCut does; silhouettes join once
// the first cut says where the objects are.
void Segmenter::learn() {
  constexpr int kPlacements = 2;
  coarse_.labels.setTo(0);
  for (size_t k = 0; k < targets_.size(); ++k)
    coarse_.labels.setTo(static_cast<double>(k + 1), coarse_.seeds == static_cast<int>(k + 2));
  shapes_.assign(targets_.size(), std::nullopt);
  fitted_.assign(targets_.size(), std::nullopt);
  coarse_.expected.clear();
  fine_.expected.clear();
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
  addSupportOdds(coarse_);
  addSupportOdds(fine_);
}

// From strokes and from what lies outside of the rectangles.
void Segmenter::initialiseModels() {
  const cv::Mat outside = surroundings(coarse_) & (coarse_.region == 0) & (coarse_.seeds <= 1);
  const cv::Mat background = outside | (coarse_.seeds == 1);
  if (cv::countNonZero(background) == 0) failWithoutBackground();
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
    const cv::Mat own = believedPixels(coarse_, k) & near;
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
  for (size_t k = 0; k < certain.size(); ++k)
    certain[k] |= coarse_.seeds == static_cast<int>(k + 1);
  return certain;
}

void Segmenter::refitSurfaces(const std::vector<cv::Mat>& certain) {
  if (coarse_.relief.empty()) return;
  const cv::Mat near = surroundings(coarse_);
  const double area = cv::countNonZero(coarse_.region);
  for (size_t k = 0; k < models_.size(); ++k) {
    cv::Mat own = believedPixels(coarse_, k) & near;
    const double share = cv::countNonZero(own & coarse_.region) / area;
    if (!certain.empty()) own &= certain[k];
    own = nearIslands(coarse_, own, k);
    if (cv::countNonZero(own) < kMinModelPixels) continue;
    // The background's strokes are drawn beside objects, and tell nothing of its shares.
    const cv::Mat strokes = k > 0 ? cv::Mat(coarse_.seeds == static_cast<int>(k + 1)) : cv::Mat();
    models_[k].surfaces = SurfaceModel::fit(coarse_.relief, own, strokes, share, params_.surfaces);
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
  result.setTo(-kMaxEvidence, (coarse_.allowed[k] == 0) | (coarse_.seeds != 0));
  result.setTo(kMaxEvidence, coarse_.seeds == static_cast<int>(k + 2));
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

// Models fitted to what was found say where the objects end beyond what a rough placement can,
// which colours are theirs where strokes did not go, and how deep in the scene they lie.
void Segmenter::guide() {
  fitModels();
  if (std::none_of(fitted_.begin(), fitted_.end(), [](const auto& f) { return f.has_value(); }))
    return;
  expectSurfaces(coarse_);
  expectSurfaces(fine_);
  measureSurfaces();
  // A depth image has told objects from background already, and better than an outline does.
  const bool relearn = coarse_.relief.empty();
  constexpr int kRounds = 2;
  for (int round = 0; round < kRounds; ++round) {
    if (relearn) relearnColours();
    evaluate(coarse_);
    addSupportOdds(coarse_);
    cut(freePixels(coarse_), coarse_);
  }
  evaluate(fine_);
  addSupportOdds(fine_);
}

void Segmenter::relearnColours() {
  const std::vector<cv::Mat> own = guidedPixels();
  for (size_t k = 0; k < models_.size(); ++k)
    if (cv::countNonZero(own[k]) >= kMinModelPixels)
      fitColours(coarse_, own[k], params_.components, models_[k]);
}

// Target k's model where the labels have it; nothing without a model or where it cannot be placed.
std::optional<FittedShape> Segmenter::fitModel(size_t k) const {
  if (!targets_[k].fit_model) return std::nullopt;
  const ObjectContour contour =
      extractContour(picture_, labels_, targets_[k].label, targets_[k].name);
  std::optional<ModelView> view = targets_[k].fit_model(contour.loops);
  if (!view) return std::nullopt;
  const cv::Mat silhouette = view->silhouette(view_), own = labels_(view_) == targets_[k].label;
  const double agreement = cv::countNonZero(silhouette & own) /
                           static_cast<double>(std::max(1, cv::countNonZero(silhouette | own)));
  return FittedShape{{silhouette, view->depth(view_), view->tolerance_px, view->surface},
                     agreement};
}

std::vector<std::string> Segmenter::remarks() const {
  if (models_.empty()) return added_remarks_;
  SegmentationLevel level = coarse_;
  evaluateCosts(models_, params_.outlier_cost, level);
  std::vector<std::string> remarks = indistinctTargets(targets_, level.costs, level.labels);
  remarks.insert(remarks.end(), added_remarks_.begin(), added_remarks_.end());
  return remarks;
}

std::map<int, ModelSurface> Segmenter::models() const {
  std::map<int, ModelSurface> models;
  for (size_t k = 0; k < fitted_.size(); ++k)
    if (fitted_[k] && fitted_[k]->view.surface.points.size() > 0)
      models[targets_[k].label] = fitted_[k]->view.surface;
  return models;
}

// Objects do not know of each other: side by side, the first in this thread.
void Segmenter::fitModels() {
  std::vector<std::future<std::optional<FittedShape>>> others;
  for (size_t k = 1; k < targets_.size(); ++k)
    others.push_back(std::async(std::launch::async, &Segmenter::fitModel, this, k));
  fitted_[0] = fitModel(0);
  for (size_t k = 1; k < targets_.size(); ++k) fitted_[k] = others[k - 1].get();
}

// Where fitted models have their surfaces, in the relief's units.
void Segmenter::expectSurfaces(SegmentationLevel& level) const {
  level.expected.assign(models_.size(), cv::Mat());
  if (level.relief.empty()) return;
  for (size_t k = 0; k < targets_.size(); ++k) {
    if (!fitted_[k]) continue;
    cv::Mat depth;
    cv::resize(fitted_[k]->view.depth, depth, level.image.size(), 0, 0, cv::INTER_NEAREST);
    cv::Mat& expected = level.expected[k + 1];
    expected = cv::Mat::zeros(depth.size(), CV_32F);
    cv::Mat(level.relief.units / depth).copyTo(expected, depth > 0.0f);
  }
}

// How far the relief is off the models' surfaces where the labels have the objects.
void Segmenter::measureSurfaces() {
  constexpr float kLeastSigma = 2.0f;                     // the relief's own noise
  constexpr float kBefore = 1.03f, kBeforeSigmas = 6.0f;  // times as near, and deviations more
  for (size_t k = 1; k < models_.size(); ++k) {
    models_[k].expected.reset();
    const cv::Mat& expected = coarse_.expected[k];
    if (expected.empty() || !models_[k].surfaces) continue;
    std::vector<float> errors;
    for (int y = 0; y < expected.rows; ++y)
      for (int x = 0; x < expected.cols; ++x)
        if (expected.at<float>(y, x) > 0.0f && coarse_.labels.at<uchar>(y, x) == k &&
            coarse_.relief.state.at<uchar>(y, x) == Relief::kSurface)
          errors.push_back(
              std::abs(coarse_.relief.surface.at<cv::Vec3f>(y, x)[2] - expected.at<float>(y, x)));
    if (errors.size() < static_cast<size_t>(kMinModelPixels)) continue;
    const auto middle = errors.begin() + errors.size() / 2;
    std::nth_element(errors.begin(), middle, errors.end());
    const float sigma = std::max(kLeastSigma, 1.4826f * *middle);
    const double area = cv::countNonZero(fitted_[k - 1]->view.silhouette);
    const double usual = std::log(area * sigma * std::sqrt(2.0 * CV_PI));
    double nearest = 0.0;
    cv::minMaxLoc(expected, nullptr, &nearest);
    models_[k].expected =
        ExpectedSurface{sigma, models_[k].surfaces->someCost() + static_cast<float>(usual),
                        kBefore * static_cast<float>(nearest) + kBeforeSigmas * sigma};
  }
}

// What is each label's beyond doubt now that its model stands: deep inside of the silhouette and
// not another's, or found there and not contradicted; of the background what is clear of all
// silhouettes.
std::vector<cv::Mat> Segmenter::guidedPixels() const {
  const cv::Size size = coarse_.image.size();
  const double scale = static_cast<double>(size.width) / image_.cols;
  const cv::Mat near = surroundings(coarse_), contradicted = contradictedPixels(coarse_);
  std::vector<cv::Mat> own = {near & (coarse_.labels == 0)};
  for (size_t k = 0; k < targets_.size(); ++k) {
    const cv::Mat found = (coarse_.labels == static_cast<int>(k + 1)) & ~contradicted;
    if (!fitted_[k]) {
      own.push_back(found);
      continue;
    }
    cv::Mat silhouette, depth;
    cv::resize(fitted_[k]->view.silhouette, silhouette, size, 0, 0, cv::INTER_NEAREST);
    cv::distanceTransform(silhouette, depth, cv::DIST_L2, 3);
    const double tolerance = std::max(1.0, fitted_[k]->view.tolerance_px * scale);
    const cv::Mat deep =
        (depth > tolerance) & ((coarse_.labels == 0) | (coarse_.labels == static_cast<int>(k + 1)));
    own.push_back(deep | (found & silhouette));
    own[0] &= ~grown(silhouette, static_cast<int>(std::ceil(tolerance)));
  }
  for (size_t k = 0; k < own.size(); ++k) {
    own[k].setTo(0, (coarse_.seeds != 0) & (coarse_.seeds != static_cast<int>(k + 1)));
    own[k] |= coarse_.seeds == static_cast<int>(k + 1);
  }
  return own;
}

// A silhouette that does not fit what the colours say has no say. That of a fitted model is wrong
// about a pixel as often as it was about those it was fitted to.
void Segmenter::addShapeOdds(SegmentationLevel& level) const {
  constexpr double kNoAgreement = 0.5, kFullAgreement = 0.8, kMostCertain = 0.95;
  const double scale = static_cast<double>(level.image.cols) / image_.cols;
  for (size_t k = 0; k < targets_.size(); ++k) {
    if (fitted_[k]) {
      const double p = std::clamp(fitted_[k]->agreement, kNoAgreement, kMostCertain);
      cv::Mat silhouette;
      cv::resize(fitted_[k]->view.silhouette, silhouette, level.image.size(), 0, 0, cv::INTER_AREA);
      level.costs[k + 1] -= shapeOdds(silhouette > 127, static_cast<float>(std::log(p / (1.0 - p))),
                                      static_cast<float>(fitted_[k]->view.tolerance_px * scale));
    } else if (shapes_[k]) {
      const double trust = std::clamp(
          (shapes_[k]->agreement - kNoAgreement) / (kFullAgreement - kNoAgreement), 0.0, 1.0);
      level.costs[k + 1] -=
          shapeOdds(placedSilhouette(k, level.image.size()) > 127,
                    static_cast<float>(trust * params_.shape_weight),
                    static_cast<float>(params_.shape_tolerance * size_.width * scale));
    }
  }
}

// What carries objects is none of them.
void Segmenter::addSupportOdds(SegmentationLevel& level) const {
  constexpr double kCarries = 20.0;  // nats: more than any colour says
  if (level.relief.on_support.empty()) return;
  for (size_t k = 1; k < models_.size(); ++k)
    if (!level.lies_flat[k])
      cv::add(level.costs[k], cv::Scalar(kCarries), level.costs[k], level.relief.on_support);
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
