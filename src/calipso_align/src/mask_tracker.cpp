#include "calipso_align/mask_tracker.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <set>
#include <stdexcept>
#include <string>

#include "background_evidence.hpp"
#include "calipso_align/layer_motion.hpp"
#include "layer_appearance.hpp"

namespace calipso::align {
namespace {

constexpr int kLeastFlowWidth = 32;  // px; DIS wants a few of its patches
// px; from here on half the resolution tells how a layer moves nearly as well
constexpr int kLargeView = 200;
constexpr int kMeanSize = 4;  // px; blocks over which stillness averages the sensor's noise away
constexpr size_t kMaxSamples = 2000;
constexpr float kLoosePrior = 1.5f;  // nats; what a prediction says that has proved wrong
// of 255: how likely a pixel may lie in a shadow where nothing is known of any
constexpr int kAnyShadow = 76;
constexpr float kSureEnough = 0.8f;  // confidence that lets colours be learnt anew

cv::Mat blockMeans(const cv::Mat& image) {
  cv::Mat means;
  cv::resize(image, means, cv::Size(), 1.0 / kMeanSize, 1.0 / kMeanSize, cv::INTER_AREA);
  return means;
}

cv::Mat grown(const cv::Mat& mask, int px) {
  cv::Mat result;
  cv::dilate(mask, result,
             cv::getStructuringElement(cv::MORPH_RECT, cv::Size(2 * px + 1, 2 * px + 1)));
  return result;
}

cv::Rect grown(const cv::Rect& rect, int px) {
  return {rect.x - px, rect.y - px, rect.width + 2 * px, rect.height + 2 * px};
}

std::vector<cv::Vec3f> coloursUnder(const cv::Mat& image, const cv::Mat& mask) {
  const int total = cv::countNonZero(mask);
  const int step = std::max<int>(1, total / static_cast<int>(kMaxSamples));
  std::vector<cv::Vec3f> colours;
  int met = 0;
  for (int y = 0; y < mask.rows; ++y)
    for (int x = 0; x < mask.cols; ++x)
      if (mask.at<uchar>(y, x) && met++ % step == 0) colours.push_back(image.at<cv::Vec3b>(y, x));
  return colours;
}

cv::Rect around(const cv::Mat& mask, int margin) {
  const cv::Rect box = cv::boundingRect(mask);
  return box.empty() ? box : grown(box, margin) & cv::Rect(cv::Point(), mask.size());
}

// Signed distance from the outline of a mask, px; negative inside.
cv::Mat signedDistance(const cv::Mat& mask) {
  cv::Mat outside, inside;
  cv::distanceTransform(mask == 0, outside, cv::DIST_L2, 3);
  cv::distanceTransform(mask, inside, cv::DIST_L2, 3);
  return outside - inside;
}

// A mask without its rim, where flow mixes both sides; the mask itself where nothing else is left.
cv::Mat insideOf(const cv::Mat& mask) {
  for (const int rim : {4, 2, 1}) {
    cv::Mat core;
    cv::erode(mask, core,
              cv::getStructuringElement(cv::MORPH_RECT, cv::Size(2 * rim + 1, 2 * rim + 1)));
    if (4 * cv::countNonZero(core) > cv::countNonZero(mask)) return core;
  }
  return mask;
}

// Mean over a mask, large differences cut off: an object that passes is no camera motion.
double meanDifference(const cv::Mat& a, const cv::Mat& b, const cv::Mat& mask) {
  constexpr double kMost = 20.0;  // grey levels
  cv::Mat difference;
  cv::absdiff(a, b, difference);
  cv::min(difference, cv::Scalar::all(kMost), difference);
  const cv::Scalar mean = cv::mean(difference, mask);
  return mean[0] + mean[1] + mean[2];
}

}  // namespace

MaskTracker::MaskTracker(const cv::Mat& image, const cv::Mat& labels, TrackerParams params)
    : params_(params), size_(image.size()) {
  checkInput(image, labels);
  previous_image_ = image.clone();
  cv::cvtColor(image, previous_grey_, cv::COLOR_BGR2GRAY);
  previous_means_ = blockMeans(image);
  std::set<int> found(labels.begin<uchar>(), labels.end<uchar>());
  found.erase(0);
  for (const int label : found) {
    Object object;
    object.label = label;
    object.mask = labels == label;
    object.coverage = object.mask.clone();
    object.reference_mean = previous_means_;
    object.flow = cv::DISOpticalFlow::create(cv::DISOpticalFlow::PRESET_MEDIUM);
    object.colours = GaussianMixture::fit(coloursUnder(image, object.mask), params_.components);
    object.recent_colours = object.colours;
    objects_.push_back(std::move(object));
  }
  rememberBackground(image);
}

void MaskTracker::checkInput(const cv::Mat& image, const cv::Mat& labels) const {
  const auto describe = [](const cv::Mat& m) {
    return std::to_string(m.cols) + "x" + std::to_string(m.rows) + ", OpenCV type " +
           std::to_string(m.type());
  };
  if (image.type() != CV_8UC3 || image.size() != size_)
    throw std::invalid_argument("tracker: the frame is " + describe(image) +
                                "; give 8 bit BGR of the key frame's size, " +
                                std::to_string(size_.width) + "x" + std::to_string(size_.height));
  if (!labels.empty() && (labels.type() != CV_8U || labels.size() != size_))
    throw std::invalid_argument("tracker: the label image is " + describe(labels) +
                                "; give 8 bit grey of the frame's size");
}

TrackedMask MaskTracker::track(const cv::Mat& image, const cv::Mat& prior) {
  checkInput(image, prior);
  const cv::Mat means = blockMeans(image);
  cv::Mat grey;
  cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  std::vector<Object*> moving;
  for (Object& object : objects_)
    if (!isStill(object, means)) moving.push_back(&object);

  occupied_ = cv::Mat::zeros(size_, CV_8U);
  for (const Object& object : objects_) occupied_ |= object.mask;
#pragma omp parallel for schedule(dynamic)
  for (size_t k = 0; k < moving.size(); ++k) {
    Object* object = moving[k];
    const cv::Point shift = coarseShift(*object, means);
    const cv::Mat flow = backwardFlow(grey, *object, shift);
    const bool told = !prior.empty() && cv::countNonZero(prior == object->label) > 0;
    follow(*object, image, flow,
           told ? cv::Mat(prior == object->label) : predict(*object, flow, shift), told);
    object->reference_mean = means;
  }
  rememberBackground(image);
  previous_image_ = image.clone();
  previous_grey_ = grey;
  previous_means_ = means;
  return combine(static_cast<int>(moving.size()));
}

TrackedMask MaskTracker::combine(int moved) const {
  TrackedMask result{cv::Mat::zeros(size_, CV_8U), 1.0f, moved};
  for (const Object& object : objects_) {
    result.labels.setTo(object.label, object.mask);
    result.confidence = std::min(result.confidence, object.confidence);
  }
  return result;
}

void MaskTracker::follow(Object& object, const cv::Mat& image, const cv::Mat& flow,
                         const cv::Mat& rough, bool exact) {
  const cv::Rect roi = around(rough, params_.margin_px);
  if (roi.empty())
    lose(object);
  else
    settle(object, image, flow, rough(roi), exact, roi);
}

void MaskTracker::lose(Object& object) const {
  object.mask = cv::Mat::zeros(size_, CV_8U);
  object.coverage = object.mask.clone();
  object.confidence = 0.0f;
}

void MaskTracker::rememberBackground(const cv::Mat& image) {
  constexpr int kClearance = 2;  // px; edge pixels show a bit of the object
  if (background_.image.empty()) {
    background_.image = image.clone();
    background_.known = cv::Mat::zeros(size_, CV_8U);
  }
  cv::Mat now = cv::Mat::zeros(size_, CV_8U);
  for (const Object& object : objects_) now |= object.mask;
  const cv::Mat seen = ~grown(now, kClearance);
  image.copyTo(background_.image, seen);
  background_.known.setTo(255, seen);
}

// The background in a part of the picture: as it is remembered, or as the previous frame shows it,
// moved along with its own flow; whichever the picture bears out.
KnownBackground MaskTracker::backgroundIn(const cv::Rect& roi, const cv::Mat& image,
                                          const cv::Mat& flow) const {
  constexpr int kClearance = 3;
  const KnownBackground remembered{background_.image(roi), background_.known(roi)};
  const cv::Mat free = ~grown(occupied_, kClearance), visible = free(roi);
  constexpr double kSensorNoise = 4.0;  // grey levels; not more differs where nothing moves
  if (cv::countNonZero(visible) == 0 ||
      noiseOf(image(roi), remembered.image, visible) <= kSensorNoise)
    return remembered;
  const cv::Mat motion = layerMotion(flow, free, roi);
  const KnownBackground moved{movedBack(previous_image_, motion, roi),
                              movedBack(free, motion, roi) > 250};
  return meanDifference(image(roi), remembered.image, visible) <=
                 meanDifference(image(roi), moved.image, visible)
             ? remembered
             : moved;
}

bool MaskTracker::isStill(const Object& object, const cv::Mat& means) const {
  const cv::Rect roi = around(object.mask, params_.band_px + kMeanSize);
  if (roi.empty()) return true;
  const cv::Rect cells((roi.x + kMeanSize - 1) / kMeanSize, (roi.y + kMeanSize - 1) / kMeanSize,
                       roi.width / kMeanSize - 1, roi.height / kMeanSize - 1);
  const cv::Rect part = cells & cv::Rect(cv::Point(), means.size());
  if (part.empty()) return false;
  cv::Mat difference, changed;
  cv::absdiff(means(part), object.reference_mean(part), difference);
  cv::Mat cell_mask;
  cv::resize(grown(object.mask, params_.band_px), cell_mask, means.size(), 0, 0, cv::INTER_NEAREST);
  cv::inRange(difference, cv::Scalar::all(0), cv::Scalar::all(params_.still_levels), changed);
  changed = (changed == 0) & cell_mask(part);
  const int counted = cv::countNonZero(cell_mask(part));
  return cv::countNonZero(changed) <= params_.still_share * counted;
}

// Translation of an object since the previous frame: best match of its pixels on a coarse picture.
cv::Point MaskTracker::coarseShift(const Object& object, const cv::Mat& means) const {
  const cv::Rect box = cv::boundingRect(object.mask);
  if (box.empty()) return {};
  const cv::Rect cells =
      cv::Rect(box.tl() / kMeanSize, box.size() / kMeanSize) & cv::Rect(cv::Point(), means.size());
  if (cells.width < 2 || cells.height < 2) return {};
  const int reach = params_.search_px / kMeanSize;
  const cv::Rect search = grown(cells, reach) & cv::Rect(cv::Point(), means.size());
  cv::Mat weight, score;
  cv::resize(object.mask, weight, means.size(), 0, 0, cv::INTER_AREA);
  cv::matchTemplate(means(search), previous_means_(cells), score, cv::TM_SQDIFF, weight(cells));
  cv::Point best;
  cv::minMaxLoc(score, nullptr, nullptr, &best);
  const cv::Point moved = search.tl() + best - cells.tl();
  // Motion of a cell or two is the flow's to find.
  return std::abs(moved.x) > 2 || std::abs(moved.y) > 2 ? moved * kMeanSize : cv::Point();
}

// Backward flow, current to previous frame, near where an object went; zero elsewhere. What the
// object moved as a whole is taken out first: the flow then has only the rest to find.
cv::Mat MaskTracker::backwardFlow(const cv::Mat& grey, const Object& object,
                                  const cv::Point& shift) const {
  const cv::Rect whole(cv::Point(), size_);
  const cv::Rect view = grown(cv::boundingRect(object.mask) + shift, params_.margin_px) & whole;
  cv::Mat flow(size_, CV_32FC2, cv::Scalar(-shift.x, -shift.y));
  if (view.width < kLeastFlowWidth || view.height < kLeastFlowWidth) return flow;
  cv::Mat before;
  const cv::Matx23d back(1, 0, -shift.x + view.x, 0, 1, -shift.y + view.y);
  cv::warpAffine(previous_grey_, before, back, view.size(), cv::INTER_LINEAR | cv::WARP_INVERSE_MAP,
                 cv::BORDER_REPLICATE);
  cv::Mat rest, now = grey(view).clone();  // flow wants whole rows
  const bool large = std::min(view.width, view.height) >= kLargeView;
  if (large) {
    cv::resize(now, now, cv::Size(), 0.5, 0.5, cv::INTER_AREA);
    cv::resize(before, before, cv::Size(), 0.5, 0.5, cv::INTER_AREA);
  }
  object.flow->calc(now, before, rest);
  if (large) cv::resize(2.0 * rest, rest, view.size());
  flow(view) += rest;
  return flow;
}

// Roughly where an object is now: where its pixels flowed, or where it went as a whole if that is
// far, for then the background's own flow leads back to where the object was.
cv::Mat MaskTracker::predict(const Object& object, const cv::Mat& flow,
                             const cv::Point& shift) const {
  if (shift == cv::Point()) return movedBack(object.mask, flow, cv::Rect(cv::Point(), size_)) > 127;
  cv::Mat moved;
  cv::warpAffine(object.mask, moved, cv::Matx23d(1, 0, shift.x, 0, 1, shift.y), size_);
  return moved > 127;
}

// Costs of a pixel's being background [0] or object [1], over a band along the predicted outline.
std::vector<cv::Mat> MaskTracker::costsOf(const cv::Mat& view, const cv::Mat& band,
                                          const cv::Mat& distance, const LayerAppearance& back,
                                          const LayerAppearance& fore, float prior_limit) const {
  // Log odds of a pixel's centre lying across the outline although it was predicted at this
  // distance.
  const auto prior = [&](float d) {
    return std::clamp(params_.prior_cost * (d - 0.5f), 0.0f, prior_limit);
  };
  std::vector<cv::Mat> costs = {cv::Mat::zeros(view.size(), CV_32F),
                                cv::Mat::zeros(view.size(), CV_32F)};
  for (int y = 0; y < view.rows; ++y)
    for (int x = 0; x < view.cols; ++x) {
      if (!band.at<uchar>(y, x)) continue;
      const cv::Vec3f colour = view.at<cv::Vec3b>(y, x);
      const float d = distance.at<float>(y, x);
      costs[0].at<float>(y, x) = back.cost(colour, x, y, params_.outlier_cost) + prior(-d);
      costs[1].at<float>(y, x) = fore.cost(colour, x, y, params_.outlier_cost) + prior(d);
    }
  return costs;
}

// Pixels (CV_8U, of roi's size) that are rather another object's, near where one was.
cv::Mat MaskTracker::othersIn(const Object& object, const cv::Mat& view,
                              const cv::Rect& roi) const {
  const cv::Mat near = grown(occupied_ & ~object.mask, params_.margin_px / 2)(roi);
  cv::Mat others = cv::Mat::zeros(view.size(), CV_8U);
  for (int y = 0; y < view.rows; ++y)
    for (int x = 0; x < view.cols; ++x) {
      if (!near.at<uchar>(y, x)) continue;
      const cv::Vec3f colour = view.at<cv::Vec3b>(y, x);
      const float own = object.colours.cost(colour);
      for (const Object& other : objects_)
        if (&other != &object && other.colours.cost(colour) < own) others.at<uchar>(y, x) = 255;
    }
  return others;
}

// Cuts where a prediction has proved wrong: by what is known of the background, in a shadow or not,
// and by the object's colours.
void MaskTracker::cutByLooks(const cv::Mat& view, const cv::Mat& free, const cv::Mat& distance,
                             const cv::Mat& known, LayerAppearance back,
                             const std::vector<const GaussianMixture*>& colours,
                             cv::Mat& labels) const {
  back.shadow.share = cv::max(back.shadow.share, known & kAnyShadow);
  const LayerAppearance looks{{}, colours};
  cutLabels(view, free, costsOf(view, free, distance, back, looks, kLoosePrior), params_.smoothness,
            labels);
}

void MaskTracker::settle(Object& object, const cv::Mat& image, const cv::Mat& flow,
                         const cv::Mat& rough, bool exact, const cv::Rect& roi) {
  const cv::Mat view = image(roi);
  const cv::Mat core = insideOf(rough);
  cv::Mat support = cv::Mat::zeros(size_, CV_8U);
  core.copyTo(support(roi));
  const cv::Mat motion = layerMotion(flow, support, roi);
  const cv::Mat coverage = movedBack(object.coverage, motion, roi);
  const cv::Mat predicted = exact ? rough.clone() : cv::Mat(coverage > 127);
  if (cv::countNonZero(predicted) == 0) {
    lose(object);
    return;
  }
  const cv::Mat distance = signedDistance(predicted);
  const cv::Mat band = cv::abs(distance) <= params_.band_px;
  const cv::Mat ring = (distance > params_.band_px) & (distance < params_.margin_px);
  const std::vector<cv::Vec3f> surroundings = coloursUnder(view, ring);
  if (surroundings.empty()) {
    object.confidence = 0.0f;
    return;
  }
  const KnownBackground background = backgroundIn(roi, image, flow);
  const cv::Mat moved = movedBack(previous_image_, motion, roi);
  const cv::Mat moved_relit = relit(moved, view, core);
  const double noise = noiseOf(view, moved_relit, core);
  const LayerAppearance fore{{{moved, coverage, 0.5f, noise}, {moved_relit, coverage, 0.3f, noise}},
                             {&object.colours, &object.recent_colours}};
  const GaussianMixture ring_colours = GaussianMixture::fit(surroundings, params_.components);
  const cv::Mat clear = background.known & (distance > 1.0);
  const double back_noise = noiseOf(view, background.image, clear);
  // What hides the object may move along with it.
  const Shadow shadow = shadowOn(background.image, view, clear, back_noise, fore.colours);
  const LayerAppearance back{
      {{background.image, background.known, 0.6f, back_noise},
       {relit(background.image, view, clear), background.known, 0.37f, back_noise},
       {moved, ~coverage, 0.02f, noise}},
      {&ring_colours},
      shadow};
  cv::Mat labels = predicted / 255;
  cutLabels(view, band, costsOf(view, band, distance, back, fore, params_.prior_limit),
            params_.smoothness, labels);

  const double area = cv::countNonZero(labels);
  if (!exact) {
    const cv::Mat apart = othersIn(object, view, roi);
    const cv::Mat wrong = contradicted(view, labels, background, apart, back_noise);
    if (cv::countNonZero(wrong) > params_.wrong_share * area) {
      const cv::Mat free = ((grown(wrong, 2) | ~background.known) & ~apart) | band;
      const LayerAppearance known{{back.accounts[0], back.accounts[1]}, {&ring_colours}, shadow};
      cutByLooks(view, free, distance, background.known, known, fore.colours, labels);
    }
  }
  const double flipped = cv::countNonZero((labels > 0) != (predicted > 0));
  object.confidence =
      static_cast<float>(std::clamp(1.0 - 4.0 * flipped / std::max(1.0, area), 0.0, 1.0));
  accept(object, view, background, back_noise, labels > 0, roi);
}

void MaskTracker::accept(Object& object, const cv::Mat& view, const KnownBackground& background,
                         double noise, cv::Mat mask, const cv::Rect& roi) const {
  object.coverage = cv::Mat::zeros(size_, CV_8U);
  settleEdge(view, cv::Mat(), background, noise, mask).copyTo(object.coverage(roi));
  object.mask = cv::Mat::zeros(size_, CV_8U);
  mask.copyTo(object.mask(roi));
  if (object.confidence > kSureEnough && cv::countNonZero(mask) > 0)
    object.recent_colours =
        GaussianMixture::fit(coloursUnder(view, insideOf(mask)), params_.components);
}

}  // namespace calipso::align
