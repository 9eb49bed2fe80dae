#include "calipso_render/drifting_background.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "fill/inpaint_at_size.hpp"
#include "place/drift_search.hpp"
#include "place/key_cover.hpp"
#include "place/place_samples.hpp"

namespace calipso::render {
namespace {

constexpr int kInterpolated = 2;  // px around a place that its value hangs on
// px beside both what covers and what rests, of which nobody knows whether it drifts: the search
// looks at cells, and less near to what covers
constexpr int kUntold = 8;
constexpr int kMatched = 16;  // px of the squares in which frame and plate are compared
constexpr float kMostOff =
    0.1f;  // of the plate's brightness; what is off by more is something else
constexpr double kMostArea = 4.0;  // times the picture that a panorama may have

cv::Point rounded(const cv::Point2f& p) {
  return {static_cast<int>(std::lround(p.x)), static_cast<int>(std::lround(p.y))};
}

// The part of a mask that is seen of it when it is displaced: out(p) = mask(p + by), else 0.
cv::Mat displacedMask(const cv::Mat& mask, const cv::Point& by, const cv::Size& out) {
  cv::Mat moved = cv::Mat::zeros(out, CV_8U);
  const cv::Rect from = cv::Rect(by, out) & cv::Rect({0, 0}, mask.size());
  if (!from.empty()) mask(from).copyTo(moved(from - by));
  return moved;
}

}  // namespace

DriftingBackground::DriftingBackground(const std::vector<ClipFrame>& frames, int margin,
                                       const cv::Mat& ground) {
  if (frames.size() < 2) return;
  std::vector<cv::Mat> covered;
  for (const ClipFrame& f : frames) {
    stamps_.push_back(f.stamp_ns);
    covered.push_back(grown(f.labels != 0, std::max(margin, kInterpolated + 1)));
  }
  const Drift drift = findDrift(frames, covered, ground);
  if (drift.where.empty()) return;
  untimed_ =
      std::adjacent_find(stamps_.begin(), stamps_.end(), std::greater_equal<>()) != stamps_.end();
  if (untimed_) return;
  shifts_ = drift.shifts, where_ = drift.where;
  layOver(frames, covered);
  if (established()) invent();
}

// Lays the frames over each other: at a place of the panorama all show the same.
void DriftingBackground::layOver(const std::vector<ClipFrame>& frames,
                                 const std::vector<cv::Mat>& covered) {
  cv::Point low, high;
  for (const cv::Point2f& s : shifts_) {
    const cv::Point at = rounded(s);
    low = {std::min(low.x, -at.x), std::min(low.y, -at.y)};
    high = {std::max(high.x, -at.x), std::max(high.y, -at.y)};
  }
  const cv::Point more = high - low;
  const cv::Size size = where_.size() + cv::Size(more.x, more.y);
  origin_ = low;
  if (static_cast<double>(size.width) * size.height > kMostArea * where_.size().area()) {
    where_.release();
    return;
  }
  std::vector<cv::Mat> pictures(frames.size()), shown(frames.size());
#pragma omp parallel for schedule(dynamic, 1)
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const cv::Point2f by = cv::Point2f(origin_) + shifts_[i];
    cv::Mat picture;
    frames[i].bgr.convertTo(picture, CV_32F);
    displaced(picture, by, size).convertTo(pictures[i], CV_8U);
    const cv::Mat untold = grown(~where_, kUntold) & grown(covered[i], kUntold);
    shown[i] = displacedMask((grown(~where_, kInterpolated) | covered[i] | untold) == 0,
                             rounded(by), size);
  }
  panorama_ = cv::Mat::zeros(size, CV_32FC3), invented_ = cv::Mat(size, CV_8U, cv::Scalar(255));
#pragma omp parallel for schedule(dynamic, 8)
  for (int v = 0; v < size.height; ++v) {
    Samples values;
    float spread;
    for (int u = 0; u < size.width; ++u) {
      values.clear();
      for (std::size_t i = 0; i < frames.size(); ++i) {
        if (shown[i].at<std::uint8_t>(v, u) != 0) values.push_back(pictures[i].at<cv::Vec3b>(v, u));
      }
      if (values.empty()) continue;
      panorama_.at<cv::Vec3f>(v, u) = robustMean(values, spread);
      invented_.at<std::uint8_t>(v, u) = 0;
    }
  }
}

void DriftingBackground::invent() {
  if (cv::countNonZero(invented_) > 0)
    panorama_ = inpaintAsIn(where_.size(), panorama_, invented_, cv::Mat()).image;
  panorama_ = linearFromRealCodes(panorama_);
}

std::optional<cv::Point2f> DriftingBackground::shiftAt(std::int64_t stamp_ns) const {
  if (!established()) return std::nullopt;
  const std::size_t last = stamps_.size() - 1;
  const std::int64_t step = (stamps_[last] - stamps_[0]) / static_cast<std::int64_t>(last);
  if (stamp_ns < stamps_[0] - step || stamp_ns > stamps_[last] + step) return std::nullopt;
  const auto next = std::upper_bound(stamps_.begin() + 1, stamps_.end() - 1, stamp_ns);
  const std::size_t i = static_cast<std::size_t>(next - stamps_.begin());
  const std::int64_t between = std::max<std::int64_t>(1, stamps_[i] - stamps_[i - 1]);
  const float part = static_cast<float>(stamp_ns - stamps_[i - 1]) / static_cast<float>(between);
  return shifts_[i - 1] + part * (shifts_[i] - shifts_[i - 1]);
}

void DriftingBackground::draw(const cv::Point2f& shift, cv::Mat& plate, cv::Mat& invented) const {
  const cv::Point2f by = -shift - cv::Point2f(origin_);
  cv::Mat now = displaced(panorama_, by, plate.size());
  cv::max(now, 0.0, now);
  now.copyTo(plate, where_);
  const cv::Mat seen = displacedMask(invented_ == 0, rounded(by), plate.size());
  cv::Mat(seen == 0).copyTo(invented, where_);
}

void DriftingBackground::matchTo(const cv::Mat& bgr, const cv::Mat& covered, cv::Mat& plate) const {
  const cv::Size size(bgr.cols / kMatched + 1, bgr.rows / kMatched + 1);
  cv::Mat off = cv::Mat::zeros(size, CV_32FC3), weight = cv::Mat::zeros(size, CV_32F);
#pragma omp parallel for schedule(static)
  for (int j = 0; j < size.height; ++j) {
    cv::Vec3f* offs = off.ptr<cv::Vec3f>(j);
    float* weights = weight.ptr<float>(j);
    std::vector<float> light(size.width, 0.0f);  // of the plate
    for (int v = j * kMatched; v < std::min(bgr.rows, (j + 1) * kMatched); ++v) {
      for (int u = 0; u < bgr.cols; ++u) {
        if (where_.at<std::uint8_t>(v, u) == 0 || covered.at<std::uint8_t>(v, u) != 0) continue;
        const cv::Vec3b& c = bgr.at<cv::Vec3b>(v, u);
        const cv::Vec3f now(linearFromCode(c[0]), linearFromCode(c[1]), linearFromCode(c[2])),
            &drawn = plate.at<cv::Vec3f>(v, u);
        offs[u / kMatched] += now - drawn, light[u / kMatched] += luminance(drawn);
        weights[u / kMatched] += 1.0f;
      }
    }
    for (int i = 0; i < size.width; ++i) {
      if (weights[i] == 0.0f) continue;
      const bool other = cv::norm(offs[i], cv::NORM_INF) > kMostOff * light[i];
      offs[i] *= 1.0f / weights[i];
      weights[i] = other ? 0.0f : weights[i] / (kMatched * kMatched);
    }
  }
  cv::Mat correction;
  cv::resize(pushPull(off, weight), correction, size * kMatched, 0, 0, cv::INTER_LINEAR);
  const cv::Mat matched = plate + correction(cv::Rect({0, 0}, plate.size()));
  cv::Mat(cv::max(matched, 0.0)).copyTo(plate, where_);
}

}  // namespace calipso::render
