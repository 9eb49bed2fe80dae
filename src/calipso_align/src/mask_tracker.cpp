#include "calipso_align/mask_tracker.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <set>
#include <stdexcept>
#include <string>

namespace calipso::align {
namespace {

constexpr int kMeanSize = 4;  // px; blocks over which stillness averages the sensor's noise away
constexpr size_t kMaxSamples = 4000;

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

}  // namespace

MaskTracker::MaskTracker(const cv::Mat& image, const cv::Mat& labels, TrackerParams params)
    : params_(params),
      size_(image.size()),
      flow_(cv::DISOpticalFlow::create(cv::DISOpticalFlow::PRESET_FAST)) {
  checkInput(image, labels);
  cv::cvtColor(image, previous_grey_, cv::COLOR_BGR2GRAY);
  previous_means_ = blockMeans(image);
  std::set<int> found(labels.begin<uchar>(), labels.end<uchar>());
  found.erase(0);
  for (const int label : found) {
    Object object;
    object.label = label;
    object.mask = labels == label;
    object.reference_mean = previous_means_;
    object.key_area = cv::countNonZero(object.mask);
    object.colours = GaussianMixture::fit(coloursUnder(image, object.mask), params_.components);
    objects_.push_back(std::move(object));
  }
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

  const cv::Mat flow = moving.empty() ? cv::Mat() : backwardFlow(grey, means, moving);
  for (Object* object : moving) {
    const bool told = !prior.empty() && cv::countNonZero(prior == object->label) > 0;
    follow(*object, image, told ? cv::Mat(prior == object->label) : predict(*object, flow));
    object->reference_mean = means;
  }
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

void MaskTracker::follow(Object& object, const cv::Mat& image, const cv::Mat& predicted) {
  const cv::Rect roi = around(predicted, params_.margin_px);
  object.mask = cv::Mat::zeros(size_, CV_8U);
  if (roi.empty()) object.confidence = 0.0f;
  else settle(object, image, predicted(roi), roi);
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
  const cv::Rect cells = cv::Rect(box.tl() / kMeanSize, box.size() / kMeanSize) &
                         cv::Rect(cv::Point(), means.size());
  if (cells.width < 2 || cells.height < 2) return {};
  const int reach = params_.search_px / kMeanSize;
  const cv::Rect search = grown(cells, reach) & cv::Rect(cv::Point(), means.size());
  cv::Mat weight, score;
  cv::resize(object.mask, weight, means.size(), 0, 0, cv::INTER_AREA);
  cv::matchTemplate(means(search), previous_means_(cells), score, cv::TM_SQDIFF, weight(cells));
  cv::Point best;
  cv::minMaxLoc(score, nullptr, nullptr, &best);
  return (search.tl() + best - cells.tl()) * kMeanSize;
}

// Backward flow, current to previous frame, started from the moving objects' coarse shifts.
cv::Mat MaskTracker::backwardFlow(const cv::Mat& grey, const cv::Mat& means,
                                  const std::vector<Object*>& moving) const {
  cv::Mat flow = cv::Mat::zeros(size_, CV_32FC2);
  for (const Object* object : moving) {
    const cv::Point shift = coarseShift(*object, means);
    const cv::Rect whole(cv::Point(), size_);
    const cv::Rect target = (cv::boundingRect(object->mask) + shift) & whole;
    if (!target.empty()) flow(target).setTo(cv::Scalar(-shift.x, -shift.y));
  }
  flow_->calc(grey, previous_grey_, flow);
  return flow;
}

cv::Mat MaskTracker::predict(const Object& object, const cv::Mat& flow) const {
  cv::Mat map(size_, CV_32FC2);
  for (int y = 0; y < map.rows; ++y)
    for (int x = 0; x < map.cols; ++x)
      map.at<cv::Vec2f>(y, x) = flow.at<cv::Vec2f>(y, x) + cv::Vec2f(x, y);
  cv::Mat warped;
  cv::remap(object.mask, warped, map, cv::noArray(), cv::INTER_LINEAR);
  return warped > 127;
}

void MaskTracker::settle(Object& object, const cv::Mat& image, const cv::Mat& predicted,
                         const cv::Rect& roi) {
  const cv::Mat view = image(roi);
  const cv::Mat distance = signedDistance(predicted);
  const cv::Mat band = cv::abs(distance) <= params_.band_px;
  const cv::Mat ring = (distance > params_.band_px) & (distance < params_.margin_px);
  const std::vector<cv::Vec3f> surroundings = coloursUnder(view, ring);
  if (surroundings.empty()) {
    object.confidence = 0.0f;
    return;
  }
  const GaussianMixture background = GaussianMixture::fit(surroundings, params_.components);

  std::vector<cv::Mat> costs = {cv::Mat::zeros(roi.size(), CV_32F), cv::Mat::zeros(roi.size(), CV_32F)};
  for (int y = 0; y < roi.height; ++y)
    for (int x = 0; x < roi.width; ++x) {
      if (!band.at<uchar>(y, x)) continue;
      const cv::Vec3f colour = view.at<cv::Vec3b>(y, x);
      const float d = distance.at<float>(y, x);
      costs[0].at<float>(y, x) = std::min(params_.outlier_cost, background.cost(colour)) + std::max(0.0f, -d) * params_.prior_cost;
      costs[1].at<float>(y, x) = std::min(params_.outlier_cost, object.colours.cost(colour)) + std::max(0.0f, d) * params_.prior_cost;
    }
  cv::Mat labels = predicted / 255;
  cutLabels(view, band, costs, params_.smoothness, labels);

  const double area = cv::countNonZero(labels);
  const double flipped = cv::countNonZero((labels > 0) != (predicted > 0));
  object.confidence = static_cast<float>(std::clamp(1.0 - 4.0 * flipped / std::max(1.0, area), 0.0, 1.0));
  object.mask(roi).setTo(255, labels);
}

}  // namespace calipso::align
