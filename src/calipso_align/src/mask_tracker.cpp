#include "calipso_align/mask_tracker.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <set>
#include <stdexcept>
#include <string>

#include "background_evidence.hpp"
#include "calipso_align/layer_motion.hpp"
#include "calipso_align/mask_edge.hpp"
#include "layer_appearance.hpp"
#include "layer_search.hpp"
#include "standing_before.hpp"

namespace calipso::align {
namespace {

constexpr size_t kMaxSamples = 2000;
constexpr float kLoosePrior = 1.5f;  // nats; what a prediction says that has proved wrong
// of 255: how likely a pixel may lie in a shadow where nothing is known of any
constexpr int kAnyShadow = 76;
constexpr float kClearly = 3.0f;     // nats by which a colour is one object's rather than another's
constexpr float kSureEnough = 0.8f;  // confidence that lets colours be learnt anew

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

// A part of a mask that was grown.
cv::Mat grownIn(const cv::Rect& roi, const cv::Mat& mask, int px) {
  const cv::Rect near = grown(roi, px) & cv::Rect(cv::Point(), mask.size());
  return grown(mask(near), px)(roi - near.tl());
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

// What object and background look like on a part of the picture.
struct MaskTracker::Layers {
  LayerAppearance fore, back;
  double back_noise;  // grey levels
};

MaskTracker::MaskTracker(const cv::Mat& image, const cv::Mat& labels,
                         const std::map<int, ModelSurface>& models, TrackerParams params)
    : params_(forPicture(image.size(), params)), size_(image.size()) {
  checkInput(image, labels);
  previous_image_ = image.clone();
  cv::cvtColor(image, previous_grey_, cv::COLOR_BGR2GRAY);
  previous_means_ = blockMeans(image, params_.block_px);
  std::set<int> found(labels.begin<uchar>(), labels.end<uchar>());
  found.erase(0);
  for (const int label : found) {
    Object object;
    object.label = label;
    object.mask = labels == label;
    object.key_area = cv::countNonZero(object.mask);
    object.coverage = object.mask.clone();
    object.expected = object.mask.clone();
    object.reference_mean = previous_means_;
    object.flow = cv::DISOpticalFlow::create(cv::DISOpticalFlow::PRESET_MEDIUM);
    object.colours = GaussianMixture::fit(coloursUnder(image, object.mask), params_.components);
    object.recent_colours = object.colours;
    const auto model = models.find(label);
    if (model != models.end()) object.shape.emplace(model->second, object.mask);
    if (object.shape && !object.shape->holds()) object.shape.reset();
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

TrackedMask MaskTracker::track(const cv::Mat& image) {
  checkInput(image, {});
  const cv::Mat means = blockMeans(image, params_.block_px);
  cv::Mat grey;
  cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  std::vector<Object*> moving;
  for (Object& object : objects_)
    if (!isStill(object.mask, means, object.reference_mean, params_)) moving.push_back(&object);

  occupied_ = cv::Mat::zeros(size_, CV_8U);
  for (const Object& object : objects_) occupied_ |= object.mask;
  as_before_ = asBeforeAround(moving, image);
  const cv::Mat foreign =
      moving.empty() ? cv::Mat() : foreignBlocks(means, background_, params_.block_px);
// A single object leaves the processors to the loops over its pixels.
#pragma omp parallel for schedule(dynamic) if (moving.size() > 1)
  for (size_t k = 0; k < moving.size(); ++k) {
    Object* object = moving[k];
    const cv::Point shift = coarseShift(object->mask, means, previous_means_, foreign, params_);
    const cv::Mat flow =
        backwardFlow(grey, previous_grey_, object->mask, shift, params_.margin_px, *object->flow);
    cv::Mat rough = roughlyMoved(object->mask, flow, shift, params_.margin_px);
    if (object->shape) {
      object->shape->moveAlong(previous_grey_, grey, flow, insideOf(rough), object->hidden,
                               as_before_);
      rough = object->shape->silhouette();
      // What stood before it stands there still.
      if (!object->hidden.empty()) rough.setTo(0, object->hidden);
    }
    follow(*object, image, flow, rough);
    object->reference_mean = means;
  }
  settleClaims();
  takeUpAgain(image, means);
  rememberBackground(image);
  image.copyTo(previous_image_);
  previous_grey_ = grey;
  previous_means_ = means;
  return combine();
}

TrackedMask MaskTracker::combine() const {
  TrackedMask result{cv::Mat::zeros(size_, CV_8U), 1.0f};
  for (const Object& object : objects_) {
    result.labels.setTo(object.label, object.mask);
    result.confidence = std::min(result.confidence, object.confidence);
  }
  return result;
}

// asBefore() where objects that move as their models do may be now.
cv::Mat MaskTracker::asBeforeAround(const std::vector<Object*>& objects,
                                    const cv::Mat& image) const {
  cv::Rect part;
  for (const Object* object : objects)
    if (object->shape) part |= around(object->mask, params_.search_px + params_.margin_px);
  if (part.empty()) return {};
  return asBefore(image, background_, ~grown(occupied_, params_.margin_px), part);
}

void MaskTracker::follow(Object& object, const cv::Mat& image, const cv::Mat& flow,
                         const cv::Mat& rough) {
  const cv::Rect roi = around(rough, params_.margin_px);
  if (roi.empty())
    lose(object);
  else
    settle(object, image, flow, rough(roi), roi);
}

void MaskTracker::rememberBackground(const cv::Mat& image) {
  constexpr int kClearance = 2;  // px; edge pixels show a bit of the object
  if (background_.image.empty()) {
    background_.image = image.clone();
    background_.known = cv::Mat::zeros(size_, CV_8U);
  }
  cv::Mat now = cv::Mat::zeros(size_, CV_8U);
  for (const Object& object : objects_) now |= object.mask;
  if (!suspects_.empty()) now |= suspects_;
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
  const cv::Mat visible = ~grownIn(roi, occupied_, kClearance);
  constexpr double kSensorNoise = 4.0;  // grey levels; not more differs where nothing moves
  if (cv::countNonZero(visible) == 0 ||
      noiseOf(image(roi), remembered.image, visible) <= kSensorNoise)
    return remembered;
  const cv::Mat free = ~grown(occupied_, kClearance), motion = layerMotion(flow, free, roi);
  const KnownBackground moved{movedBack(previous_image_, motion, roi),
                              movedBack(free, motion, roi) > 250};
  return meanDifference(image(roi), remembered.image, visible) <=
                 meanDifference(image(roi), moved.image, visible)
             ? remembered
             : moved;
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
#pragma omp parallel for schedule(dynamic, 16)
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

// Pixels (CV_8U, of roi's size) that are rather another object's, near where one was. Two cars'
// windows look alike: where colours do not tell clearly, a pixel is whose it was or is predicted.
cv::Mat MaskTracker::othersIn(const Object& object, const cv::Mat& view, const cv::Mat& predicted,
                              const cv::Rect& roi) const {
  cv::Mat others = cv::Mat::zeros(view.size(), CV_8U);
  if (objects_.size() == 1) return others;
  const cv::Mat theirs = occupied_ & ~object.mask;
  const cv::Mat near = grownIn(roi, theirs, params_.margin_px / 2);
  for (int y = 0; y < view.rows; ++y)
    for (int x = 0; x < view.cols; ++x) {
      if (!near.at<uchar>(y, x)) continue;
      const cv::Vec3b colour = view.at<cv::Vec3b>(y, x);
      float own = object.colours.cost(colour);
      if (predicted.at<uchar>(y, x)) own -= kClearly;
      if (theirs.at<uchar>(roi.y + y, roi.x + x)) own += kClearly;
      for (const Object& other : objects_)
        if (&other != &object && other.colours.cost(colour) < own) others.at<uchar>(y, x) = 255;
    }
  return others;
}

MaskTracker::Prediction MaskTracker::predict(const Object& object, const cv::Mat& flow,
                                             const cv::Mat& rough, const cv::Rect& roi) const {
  Prediction p;
  p.core = insideOf(rough);
  cv::Mat support = cv::Mat::zeros(size_, CV_8U);
  p.core.copyTo(support(roi));
  p.motion = layerMotion(flow, support, roi);
  p.coverage = movedBack(object.coverage, p.motion, roi);
  p.mask = p.coverage > 127;
  if (cv::countNonZero(p.mask) == 0) return p;
  p.distance = signedDistance(p.mask);
  p.band = cv::abs(p.distance) <= params_.band_px;
  return p;
}

MaskTracker::Layers MaskTracker::layersOf(const Object& object, const cv::Mat& view,
                                          const Prediction& p, const KnownBackground& background,
                                          const GaussianMixture& surroundings,
                                          const cv::Rect& roi) const {
  const cv::Mat moved = movedBack(previous_image_, p.motion, roi);
  const cv::Mat moved_relit = relit(moved, view, p.core);
  const double noise = noiseOf(view, moved_relit, p.core);
  const std::vector<const GaussianMixture*> colours = {&object.colours, &object.recent_colours};
  const cv::Mat clear = background.known & (p.distance > 1.0);
  const double back_noise = noiseOf(view, background.image, clear);
  return {{{{moved, p.coverage, 0.5f, noise}, {moved_relit, p.coverage, 0.3f, noise}}, colours},
          {{{background.image, background.known, 0.6f, back_noise},
            {relit(background.image, view, clear), background.known, 0.37f, back_noise},
            // What hides the object may move along with it; what was taken for it but stays where
            // it was is none of it.
            {moved, ~p.coverage, 0.02f, noise},
            {previous_image_(roi), object.coverage(roi), 0.02f, back_noise}},
           {&surroundings},
           shadowOn(background.image, view, clear, back_noise, colours)},
          back_noise};
}

// Where the background contradicts what was found, cuts by what is known of the background, in a
// shadow or not, and by the object's colours.
void MaskTracker::cutContradicted(const Object& object, const cv::Mat& view, const Prediction& p,
                                  const KnownBackground& background, const Layers& layers,
                                  const cv::Rect& roi, cv::Mat& labels) const {
  const cv::Mat apart = othersIn(object, view, p.mask, roi);
  const std::vector<cv::Vec3f> known =
      coloursUnder(background.image, background.known & (p.distance > params_.band_px));
  if (known.empty()) return;
  const GaussianMixture known_colours = GaussianMixture::fit(known, params_.components);
  const cv::Mat wrong =
      contradicted(view, labels, background, apart, layers.back_noise, layers.fore.colours) |
      unseenParts(view, labels, background.known, apart, layers.fore.colours, known_colours);
  if (cv::countNonZero(wrong) <= params_.wrong_share * cv::countNonZero(labels)) return;
  cv::Mat between;  // what was gained and the rest, where the two look alike
  cv::morphologyEx((labels > 0) | wrong, between, cv::MORPH_CLOSE,
                   cv::Mat::ones(kLookAlikeGap + 1, kLookAlikeGap + 1, CV_8U));
  const cv::Mat free = ((grown(wrong, 2) | between | ~background.known) & ~apart) | p.band;
  LayerAppearance back = layers.back;
  back.accounts.resize(2);          // those of the known background
  back.colours = {&known_colours};  // around it there may be some of the object
  back.shadow.share = cv::max(back.shadow.share, background.known & kAnyShadow);
  const LayerAppearance looks{{}, layers.fore.colours};
  cutLabels(view, free, costsOf(view, free, p.distance, back, looks, kLoosePrior),
            params_.smoothness, labels);
}

// Takes the outline from the object's model, moved to where the colours have it, as long as it
// meets what they say.
bool MaskTracker::fitShape(Object& object, const cv::Mat& view, const KnownBackground& background,
                           const Layers& layers, const cv::Rect& roi, Prediction& p) const {
  const cv::Mat known_look = p.coverage > 127, look = layers.fore.accounts.front().colour;
  const auto standing = [&](const cv::Mat& distance) {
    return as_before_.empty() ? cv::Mat::zeros(roi.size(), CV_8U)
                              : standingBefore({distance, look, known_look}, background,
                                               as_before_(roi), layers.back_noise);
  };
  object.hidden = cv::Mat();
  if (!object.shape) return false;
  object.shape->carryDetails(p.motion, roi);
  const cv::Mat expected = object.shape->distance(roi);
  const std::vector<cv::Mat> costs = costsOf(view, cv::abs(expected) <= params_.shape_search_px,
                                             expected, layers.back, layers.fore, 0.0f);
  const cv::Mat others = grownIn(roi, occupied_ & ~object.mask, params_.band_px) |
                         grown(standing(expected), params_.band_px);
  object.shape->meetOutline(costs[0] - costs[1], others, roi);
  if (!object.shape->holds()) {
    object.shape.reset();
    return false;
  }
  p.distance = object.shape->distance(roi);
  p.mask = p.distance < 0.0;
  const cv::Mat hidden = standing(p.distance);
  if (cv::countNonZero(hidden) > 0) {
    object.hidden = cv::Mat::zeros(size_, CV_8U);
    hidden.copyTo(object.hidden(roi));
    p.mask.setTo(0, hidden);
    p.distance = signedDistance(p.mask);
  }
  p.band = cv::abs(p.distance) <= params_.shape_band_px;
  return true;
}

void MaskTracker::settle(Object& object, const cv::Mat& image, const cv::Mat& flow,
                         const cv::Mat& rough, const cv::Rect& roi) {
  const cv::Mat view = image(roi);
  Prediction p = predict(object, flow, rough, roi);
  if (p.distance.empty()) return lose(object);
  object.expected = cv::Mat::zeros(size_, CV_8U);
  p.mask.copyTo(object.expected(roi));
  const std::vector<cv::Vec3f> surroundings =
      coloursUnder(view, (p.distance > params_.band_px) & (p.distance < params_.margin_px));
  if (surroundings.empty()) {
    object.confidence = 0.0f;
    return;
  }
  const KnownBackground background = backgroundIn(roi, image, flow);
  const GaussianMixture ring_colours = GaussianMixture::fit(surroundings, params_.components);
  const Layers layers = layersOf(object, view, p, background, ring_colours, roi);
  const bool shaped = fitShape(object, view, background, layers, roi, p);
  cv::Mat labels = p.mask / 255;
  cutLabels(view, p.band,
            costsOf(view, p.band, p.distance, layers.back, layers.fore, params_.prior_limit),
            params_.smoothness, labels);
  const double area = std::max(1, cv::countNonZero(labels));
  if (!shaped) cutContradicted(object, view, p, background, layers, roi, labels);
  const double flipped = cv::countNonZero((labels > 0) != (p.mask > 0));
  object.confidence = static_cast<float>(std::clamp(1.0 - 4.0 * flipped / area, 0.0, 1.0));
  accept(object, view, background, layers.back_noise,
         withoutStrays(labels > 0, p.distance < params_.band_px), roi);
}

void MaskTracker::accept(Object& object, const cv::Mat& view, const KnownBackground& background,
                         double noise, cv::Mat mask, const cv::Rect& roi) const {
  object.coverage = cv::Mat::zeros(size_, CV_8U);
  settleEdge(view, background, noise, mask).copyTo(object.coverage(roi));
  object.mask = cv::Mat::zeros(size_, CV_8U);
  mask.copyTo(object.mask(roi));
  if (object.confidence > kSureEnough && cv::countNonZero(mask) > 0)
    object.recent_colours =
        GaussianMixture::fit(coloursUnder(view, insideOf(mask)), params_.components);
}

}  // namespace calipso::align
