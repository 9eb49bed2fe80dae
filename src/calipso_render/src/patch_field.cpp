#include "patch_field.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace calipso::render {
namespace {

constexpr int kBands = 4;            // rows searched independently; fixed, so the result is
constexpr float kInside = 1.15f;     // weight ratio per px towards the hole's rim
constexpr float kPerColumn = 0.3f, kPerRow = 1.5f;  // squared code values per px of the finest level
constexpr float kTolerance = 60.0f;  // squared code values: how fast a poor match loses its vote

}  // namespace

PatchField::PatchField(cv::Mat image, cv::Mat hole, cv::Mat source, int radius, float scale,
                       std::uint32_t seed)
    : image_(std::move(image)), hole_(std::move(hole)), source_(std::move(source)), radius_(radius),
      scale_(scale), seed_(seed), matches_(image_.total()) {
  const int side = 2 * radius + 1;
  cv::dilate(hole_, target_, cv::Mat::ones(side, side, CV_8U));
  cv::distanceTransform(hole_ != 0, depth_, cv::DIST_L2, 3);
  origin_ = cv::Mat(image_.size(), CV_16SC2, cv::Scalar(-1, -1));
  // Patches must lie inside the picture; targets at its rim are matched by their centre's neighbours.
  for (int v = 0; v < target_.rows; ++v) {
    for (int u = 0; u < target_.cols; ++u) {
      const bool inside = u >= radius && v >= radius && u + radius < target_.cols && v + radius < target_.rows;
      if (!inside) source_.at<std::uint8_t>(v, u) = 0;
      if (source_.at<std::uint8_t>(v, u) != 0) sources_.emplace_back(u, v);
    }
  }
}

std::uint32_t PatchField::random(int u, int v, int salt) const {
  std::uint32_t h = seed_ * 0x9e3779b9u ^ static_cast<std::uint32_t>(u) * 0x85ebca6bu ^
                    static_cast<std::uint32_t>(v) * 0xc2b2ae35u ^
                    static_cast<std::uint32_t>(salt + 64 * sweep_) * 0x27d4eb2fu;
  h ^= h >> 15, h *= 0x2c1b3c6du, h ^= h >> 12, h *= 0x297a2d39u, h ^= h >> 15;
  return h;
}

bool PatchField::isSource(int u, int v) const {
  return u >= 0 && v >= 0 && u < source_.cols && v < source_.rows && source_.at<std::uint8_t>(v, u) != 0;
}

float PatchField::squaredDistance(int u, int v, int su, int sv, float limit) const {
  const int top = std::max(-radius_, -v), bottom = std::min(radius_, image_.rows - 1 - v);
  const int left = std::max(-radius_, -u), right = std::min(radius_, image_.cols - 1 - u);
  const int count = (bottom - top + 1) * (right - left + 1);
  const float stop = limit * count;
  float sum = 0.0f;
  for (int dv = top; dv <= bottom && sum < stop; ++dv) {
    const float* a = image_.ptr<float>(v + dv) + Feature::channels * (u + left);
    const float* b = image_.ptr<float>(sv + dv) + Feature::channels * (su + left);
    float row = 0.0f;
    for (int i = 0; i < Feature::channels * (right - left + 1); ++i) row += (a[i] - b[i]) * (a[i] - b[i]);
    sum += row;
  }
  return sum / count;
}

// What looks alike is more plausible from near by, above all from the same height: places are layered.
float PatchField::cost(int u, int v, int su, int sv, float limit) const {
  const float way = scale_ * (kPerColumn * std::abs(su - u) + kPerRow * std::abs(sv - v));
  return way < limit ? way + squaredDistance(u, v, su, sv, limit - way) : way;
}

void PatchField::tryMatch(int u, int v, int su, int sv, Match& best) const {
  if (!isSource(su, sv) || (su == best.u && sv == best.v)) return;
  const float d = cost(u, v, su, sv, best.distance);
  if (d < best.distance) best = {su, sv, d};
}

void PatchField::initialiseRandomly() {
  for (int v = 0; v < image_.rows; ++v) {
    for (int u = 0; u < image_.cols; ++u) {
      if (target_.at<std::uint8_t>(v, u) == 0) continue;
      const cv::Point s = sources_[random(u, v, 1) % sources_.size()];
      at(u, v) = {s.x, s.y, cost(u, v, s.x, s.y, 1e30f)};
    }
  }
}

void PatchField::initialiseFrom(const PatchField& coarse) {
  for (int v = 0; v < image_.rows; ++v) {
    for (int u = 0; u < image_.cols; ++u) {
      if (target_.at<std::uint8_t>(v, u) == 0) continue;
      const int cu = std::min(u / 2, coarse.image_.cols - 1), cv = std::min(v / 2, coarse.image_.rows - 1);
      const Match& m = coarse.at(cu, cv);
      int su = 2 * m.u + u % 2, sv = 2 * m.v + v % 2;
      if (m.u < 0 || !isSource(su, sv)) {
        const cv::Point s = sources_[random(u, v, 1) % sources_.size()];
        su = s.x, sv = s.y;
      }
      at(u, v) = {su, sv, 1e30f};
    }
  }
}

void PatchField::searchRow(int v, bool backwards, int reach, const std::vector<Match>& before, int first,
                           int last) {
  const int step = backwards ? 1 : -1;  // towards the neighbours that were visited already
  const int above = v + step;
  for (int i = 0; i < image_.cols; ++i) {
    const int u = backwards ? image_.cols - 1 - i : i;
    if (target_.at<std::uint8_t>(v, u) == 0) continue;
    Match& best = at(u, v);
    best.distance = cost(u, v, best.u, best.v, 1e30f);
    const int beside = u + step;
    if (beside >= 0 && beside < image_.cols && at(beside, v).u >= 0) {
      tryMatch(u, v, at(beside, v).u - step, at(beside, v).v, best);
    }
    if (above >= 0 && above < image_.rows) {
      // Rows of another band are read as they were before the sweep.
      const bool own = above >= first && above <= last;
      const Match& m = own ? at(u, above) : before[static_cast<std::size_t>(above) * image_.cols + u];
      if (m.u >= 0) tryMatch(u, v, m.u, m.v - step, best);
    }
    int salt = 2;
    for (int r = reach; r >= 1; r /= 2, ++salt) {
      const std::uint32_t h = random(u, v, salt);
      const int su = best.u + static_cast<int>(h % (2 * r + 1)) - r;
      const int sv = best.v + static_cast<int>((h >> 16) % (2 * r + 1)) - r;
      tryMatch(u, v, su, sv, best);
    }
  }
}

void PatchField::search(bool backwards, int reach) {
  ++sweep_;
  const std::vector<Match> before = matches_;
#pragma omp parallel for schedule(static)
  for (int band = 0; band < kBands; ++band) {
    const int first = image_.rows * band / kBands, last = image_.rows * (band + 1) / kBands - 1;
    for (int i = first; i <= last; ++i) {
      searchRow(backwards ? first + last - i : i, backwards, reach, before, first, last);
    }
  }
}

Feature PatchField::voteAt(int u, int v, bool copy, cv::Vec2s& origin) const {
  Feature sum;
  float total = 0.0f;
  const auto visit = [&](auto&& use) {
    for (int dv = -radius_; dv <= radius_; ++dv) {
      for (int du = -radius_; du <= radius_; ++du) {
        const int pu = u + du, pv = v + dv;
        if (pu < 0 || pv < 0 || pu >= image_.cols || pv >= image_.rows) continue;
        const Match& m = at(pu, pv);
        if (m.u < 0) continue;
        use(m.u - du, m.v - dv, m.distance, depth_.at<float>(pv, pu));
      }
    }
  };
  visit([&](int su, int sv, float distance, float depth) {
    const float w = std::exp(-distance / (2.0f * kTolerance)) * std::pow(kInside, -depth) + 1e-12f;
    sum += w * image_.at<Feature>(sv, su);
    total += w;
  });
  const Feature mean = sum / total;
  float best = 1e30f;
  Feature nearest = mean;
  visit([&](int su, int sv, float distance, float) {
    const Feature d = image_.at<Feature>(sv, su) - mean;
    const float score = d.dot(d) + distance;
    if (score >= best) return;
    best = score;
    nearest = image_.at<Feature>(sv, su);
    origin = cv::Vec2s(static_cast<short>(su), static_cast<short>(sv));
  });
  return copy ? nearest : mean;
}

void PatchField::vote(bool copy) {
  cv::Mat voted = image_.clone();
#pragma omp parallel for schedule(static)
  for (int v = 0; v < image_.rows; ++v) {
    for (int u = 0; u < image_.cols; ++u) {
      if (hole_.at<std::uint8_t>(v, u) == 0) continue;
      voted.at<Feature>(v, u) = voteAt(u, v, copy, origin_.at<cv::Vec2s>(v, u));
    }
  }
  image_ = voted;
}

}  // namespace calipso::render
