#include "calipso_align/segmentation.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <set>
#include <opencv2/imgcodecs.hpp>
#include <cstdio>
#include <stdexcept>

#include "calipso_align/local_colour.hpp"
#include "calipso_align/shape_prior.hpp"

namespace calipso::align {

struct Segmenter::Level {
  cv::Mat image;                 // CV_8UC3
  cv::Mat seeds;                 // CV_8U: target number + 1 (1: background), 0 where not marked
  std::vector<cv::Mat> allowed;  // CV_8U per target
  cv::Mat free;                  // CV_8U
  cv::Mat labels;                // CV_8U, target numbers (0 background)
  std::vector<cv::Mat> odds;     // CV_32F per target, nats for the object by its shape; or empty
};

namespace {
constexpr size_t kMaxSamples = 12000;
constexpr double kSurroundings = 0.1;  // of the picture's width: what counts as near an object

std::vector<cv::Vec3f> sample(const cv::Mat& image, const cv::Mat& mask) {
  std::vector<cv::Vec3f> all;
  for (int y = 0; y < image.rows; ++y)
    for (int x = 0; x < image.cols; ++x)
      if (mask.at<uchar>(y, x)) all.push_back(image.at<cv::Vec3b>(y, x));
  if (all.size() <= kMaxSamples) return all;
  std::vector<cv::Vec3f> few;
  for (size_t i = 0; i < kMaxSamples; ++i) few.push_back(all[i * all.size() / kMaxSamples]);
  return few;
}
void checkTarget(const SegmentationTarget& t, const cv::Size& size, std::set<int>& seen) {
  const std::string who = "object '" + t.name + "': ";
  if (t.label < 1 || t.label > 254)
    throw std::invalid_argument(who + "index " + std::to_string(t.label) + " is not in 1..254");
  if (!seen.insert(t.label).second)
    throw std::invalid_argument(who + "index " + std::to_string(t.label) +
                                " is also another object's; give each its own");
  const cv::Rect inside = t.rect & cv::Rect(cv::Point(), size);
  if ((t.rect.width != 0 || t.rect.height != 0) && inside.area() < 4)
    throw std::invalid_argument(who + "rectangle " + std::to_string(t.rect.x) + " " +
                                std::to_string(t.rect.y) + " " + std::to_string(t.rect.width) +
                                " " + std::to_string(t.rect.height) +
                                " does not meet the picture of " + std::to_string(size.width) +
                                "x" + std::to_string(size.height) + "; correct it");
}

[[noreturn]] void failWithoutForeground(const SegmentationTarget& t) {
  throw std::invalid_argument("object '" + t.name +
                              "': the rectangle and strokes leave no foreground; draw a stroke on "
                              "the object, or enlarge its rectangle");
}

cv::Mat allowedRegion(const SegmentationTarget& t, cv::Size size) {
  const cv::Rect whole(cv::Point(), size);
  cv::Mat m(size, CV_8U, cv::Scalar(t.rect.empty() ? 255 : 0));
  if (!t.rect.empty()) m(t.rect & whole).setTo(255);
  if (!t.lasso.empty()) {
    cv::Mat inside = cv::Mat::zeros(size, CV_8U);
    cv::fillPoly(inside, std::vector<std::vector<cv::Point>>{t.lasso}, 255);
    m &= inside;
  }
  return m;
}
}  // namespace

Segmenter::Segmenter(const cv::Mat& image, std::vector<SegmentationTarget> targets, SegmenterParams params)
    : image_(image), targets_(std::move(targets)), params_(params) {
  if (image_.empty() || image_.type() != CV_8UC3)
    throw std::invalid_argument("segmentation: the picture is " +
                                (image_.empty() ? std::string("empty") : "of OpenCV type " + std::to_string(image_.type())) +
                                "; give 8 bit BGR");
  if (targets_.empty())
    throw std::invalid_argument("segmentation: no object to look for; list at least one");
  std::set<int> seen;
  for (const SegmentationTarget& t : targets_) checkTarget(t, image_.size(), seen);
}

void Segmenter::checkStrokes(const cv::Mat& strokes) const {
  if (strokes.empty()) {
    for (const SegmentationTarget& t : targets_)
      if (t.rect.empty() && t.lasso.empty())
        throw std::invalid_argument("object '" + t.name +
                                    "' has neither rectangle nor lasso nor stroke; give one");
    return;
  }
  if (strokes.type() != CV_8U || strokes.size() != image_.size())
    throw std::invalid_argument(
        "strokes: the image is " + std::to_string(strokes.cols) + "x" +
        std::to_string(strokes.rows) + " of OpenCV type " + std::to_string(strokes.type()) +
        "; give 8 bit grey of the picture's size, " + std::to_string(image_.cols) + "x" +
        std::to_string(image_.rows));
  const std::set<int> used(strokes.begin<uchar>(), strokes.end<uchar>());
  for (const int value : used) {
    const bool known = value == 0 || value == kBackgroundStroke ||
                       std::any_of(targets_.begin(), targets_.end(),
                                   [&](const SegmentationTarget& t) { return t.label == value; });
    if (!known)
      throw std::invalid_argument("strokes: value " + std::to_string(value) +
                                  " names no object; use 0 for none, 255 for background or an "
                                  "object's index");
  }
}

void Segmenter::checkResult() const {
  for (const SegmentationTarget& t : targets_)
    if (cv::countNonZero(labels_ == t.label) == 0) failWithoutForeground(t);
}

Segmenter::Level Segmenter::makeLevel(const cv::Mat& strokes, double scale) const {
  Level level;
  const cv::Size size(std::lround(image_.cols * scale), std::lround(image_.rows * scale));
  cv::resize(image_, level.image, size, 0, 0, scale < 1 ? cv::INTER_AREA : cv::INTER_NEAREST);
  cv::Mat seeds = cv::Mat::zeros(image_.size(), CV_8U);
  if (!strokes.empty()) {
    seeds.setTo(1, strokes == kBackgroundStroke);
    for (size_t k = 0; k < targets_.size(); ++k) seeds.setTo(k + 2, strokes == targets_[k].label);
  }
  cv::Mat any = cv::Mat::zeros(size, CV_8U);
  for (const auto& t : targets_) {
    cv::Mat a;
    cv::resize(allowedRegion(t, image_.size()), a, size, 0, 0, cv::INTER_NEAREST);
    level.allowed.push_back(a);
    any |= a;
  }
  cv::resize(seeds, level.seeds, size, 0, 0, cv::INTER_NEAREST);
  level.free = any & (level.seeds == 0);
  level.labels = cv::Mat::zeros(size, CV_8U);
  for (size_t k = 0; k < targets_.size(); ++k) level.labels.setTo(k + 1, level.seeds == int(k + 2));
  return level;
}

void Segmenter::initialiseModels(const Level& level) {
  models_.clear();
  cv::Mat any = cv::Mat::zeros(level.image.size(), CV_8U);
  for (auto& a : level.allowed) any |= a;
  cv::Mat bg = (any == 0) & (level.seeds <= 1);
  cv::Mat near;
  int r = std::max(3.0, kSurroundings * level.image.cols);
  cv::dilate(any, near, cv::Mat::ones(2 * r + 1, 2 * r + 1, CV_8U));
  bg &= near;
  bg |= level.seeds == 1;
  const std::vector<cv::Vec3f> surroundings = sample(level.image, bg);
  if (surroundings.empty())
    throw std::invalid_argument(
        "segmentation: rectangles and strokes leave no background to learn from; draw smaller "
        "rectangles or a background stroke");
  models_.push_back(ColourModel::fit(surroundings, params_.components));
  for (size_t k = 0; k < targets_.size(); ++k) {
    cv::Mat fg = level.seeds == int(k + 2);
    if (cv::countNonZero(fg) < 20) fg = level.allowed[k] & (level.seeds == 0);
    const std::vector<cv::Vec3f> colours = sample(level.image, fg);
    if (colours.empty()) failWithoutForeground(targets_[k]);
    models_.push_back(ColourModel::fit(colours, params_.components));
  }
}

void Segmenter::refitModels(const Level& level) {
  cv::Mat any = cv::Mat::zeros(level.image.size(), CV_8U), near;
  for (auto& a : level.allowed) any |= a;
  int r = std::max(3.0, kSurroundings * level.image.cols);
  cv::dilate(any, near, cv::Mat::ones(2 * r + 1, 2 * r + 1, CV_8U));
  for (size_t k = 0; k <= targets_.size(); ++k) {
    cv::Mat m = level.labels == int(k);
    if (k == 0) m &= near;
    if (cv::countNonZero(m) < 20) continue;
    models_[k] = ColourModel::fit(sample(level.image, m), params_.components);
  }
}

std::vector<cv::Mat> Segmenter::costs(const Level& level) const {
  std::vector<cv::Mat> out;
  cv::Mat any = cv::Mat::zeros(level.image.size(), CV_8U);
  for (auto& a : level.allowed) any |= a;
  for (size_t k = 0; k <= targets_.size(); ++k) {
    cv::Mat c(level.image.size(), CV_32F, cv::Scalar(0));
    const cv::Mat& a = k == 0 ? any : level.allowed[k - 1];
    for (int y = 0; y < c.rows; ++y)
      for (int x = 0; x < c.cols; ++x)
        c.at<float>(y, x) = a.at<uchar>(y, x) ? std::min(params_.outlier_cost, models_[k].cost(cv::Vec3f(level.image.at<cv::Vec3b>(y, x)))) : kForbidden;
    if (k > 0 && !level.odds.empty() && !level.odds[k - 1].empty()) c -= level.odds[k - 1];
    out.push_back(c);
  }
  return out;
}

// What the colours say for one object against everything else, nats per pixel.
cv::Mat Segmenter::evidence(const Level& level, size_t k, const std::vector<cv::Mat>& cost) const {
  constexpr double kMaxEvidence = 6.0;
  cv::Mat result = cost[0] - cost[k + 1];
  for (size_t j = 0; j < targets_.size(); ++j)
    if (j != k) result = cv::min(result, cv::max(cost[j + 1] - cost[k + 1], 0));
  const cv::Mat own = level.seeds == static_cast<int>(k + 2);
  result.setTo(-kMaxEvidence, (level.allowed[k] == 0) | (level.seeds != 0));
  result.setTo(kMaxEvidence, own);
  return cv::min(cv::max(result, -kMaxEvidence), kMaxEvidence);
}

void Segmenter::placeSilhouettes(const Level& coarse) {
  const double factor = static_cast<double>(image_.cols) / coarse.image.cols;
  const std::vector<cv::Mat> cost = costs(coarse);
  shapes_.resize(targets_.size());
  for (size_t k = 0; k < targets_.size(); ++k) {
    const cv::Mat& full = targets_[k].silhouette;
    if (full.empty() || cv::countNonZero(full) == 0) continue;
    cv::Mat silhouette;
    cv::resize(full, silhouette, cv::Size(), 1.0 / factor, 1.0 / factor, cv::INTER_AREA);
    const cv::Matx23d start(1, 0, -0.5 * (full.cols - image_.cols), 0, 1,
                            -0.5 * (full.rows - image_.rows));
    PlacedShape shape =
        placeSilhouette(silhouette, evidence(coarse, k, cost), scaled(start, 1.0 / factor));
    shape.map = scaled(shape.map, factor);
    shapes_[k] = shape;
  }
}

void Segmenter::addShapeOdds(Level& level) const {
  constexpr double kNoAgreement = 0.5, kFullAgreement = 0.8;
  const double factor = static_cast<double>(level.image.cols) / image_.cols;
  level.odds.assign(targets_.size(), cv::Mat());
  for (size_t k = 0; k < targets_.size(); ++k) {
    if (shapes_.empty() || !shapes_[k]) continue;
    const double trust = std::clamp(
        (shapes_[k]->agreement - kNoAgreement) / (kFullAgreement - kNoAgreement), 0.0, 1.0);
    cv::Mat placed, resized;
    cv::warpAffine(targets_[k].silhouette, placed, shapes_[k]->map, image_.size());
    cv::resize(placed, resized, level.image.size(), 0, 0, cv::INTER_AREA);
    level.odds[k] = shapeOdds(resized > 127, static_cast<float>(trust * params_.shape_weight),
                              static_cast<float>(params_.shape_tolerance * level.image.cols));
    (void)factor;
    if (getenv("PR")) { printf("agree %.2f ", shapes_[k]->agreement); cv::imwrite(("/tmp/seg/sil_"+targets_[k].name+".png"), resized); }
  }
}

const cv::Mat& Segmenter::segment(const cv::Mat& strokes) {
  checkStrokes(strokes);
  const double scale = std::min(1.0, std::sqrt(double(params_.coarse_pixels) / image_.total()));
  Level coarse = makeLevel(strokes, scale);
  initialiseModels(coarse);
  for (int r = 0; r < params_.rounds; ++r) {
    if (r > 0) refitModels(coarse);
    cutLabels(coarse.image, coarse.free, costs(coarse), params_.smoothness, coarse.labels);
    if (r < 2) {
      refitModels(coarse);
      coarse.odds.clear();
      placeSilhouettes(coarse);
      addShapeOdds(coarse);
    }
  }
  Level fine = makeLevel(strokes, 1.0);
  addShapeOdds(fine);
  refitModels(coarse);
  cv::Mat up;
  cv::resize(coarse.labels, up, image_.size(), 0, 0, cv::INTER_NEAREST);
  up.copyTo(fine.labels, fine.free);
  cv::Mat band = fine.free.clone();
  auto ev=[](const char*n,double d){const char*q=getenv(n);return q?atof(q):d;};
  int passes=ev("LP",2), cell=ev("CELL",16), lc=ev("LC",2); double mix=ev("MIX",0.5); SmoothnessParams sp=params_.smoothness; sp.gamma=ev("FG",sp.gamma);
  std::vector<cv::Mat> global = costs(fine);
  if(ev("FIRST",1)) cutLabels(fine.image, band, global, params_.smoothness, fine.labels);
  for (int pass = 0; pass < passes; ++pass) {
    std::vector<cv::Mat> c2;
    for (size_t k = 0; k <= targets_.size(); ++k) {
      LocalColourModel local(fine.image, fine.labels == int(k), cell, lc, models_[k]);
      cv::Mat c = global[k].clone();
      for (int y = 0; y < c.rows; ++y) for (int x = 0; x < c.cols; ++x) if (band.at<uchar>(y, x) && c.at<float>(y,x) < kForbidden/2) {
        cv::Vec3f col = fine.image.at<cv::Vec3b>(y, x);
        float odds = k > 0 && !fine.odds[k-1].empty() ? fine.odds[k-1].at<float>(y, x) : 0.f;
        c.at<float>(y, x) = (1-mix)*c.at<float>(y,x) + mix*(std::min(params_.outlier_cost, local.cost(col, x, y)) - odds);
      }
      c2.push_back(c);
    }
    cutLabels(fine.image, band, c2, sp, fine.labels);
  }
  labels_ = cv::Mat::zeros(image_.size(), CV_8U);
  for (size_t k = 0; k < targets_.size(); ++k) labels_.setTo(targets_[k].label, fine.labels == int(k + 1));
  checkResult();
  return labels_;
}

}  // namespace calipso::align
