#include "calipso_render/live_fill.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace calipso::render {
namespace {

constexpr int kMean = 3;             // px around a place whose mean colour is compared
constexpr int kSmooth = 3;           // px around a copied place over which noise is averaged
constexpr float kNoiseReach = 6.0f;  // deviations of noise
constexpr float kNoiseTwice = 2.0f;  // times that its variance is in a copy once noise is put back
constexpr float kFade = 7.0f;        // px over which a correction fades
constexpr float kFarthest = 30.0f;   // px
constexpr float kEdge = 30.0f;       // code values; what differs by much more is an edge of things
constexpr int kPicture = -1;
constexpr int kRounds = 40;         // in which copies are brought to agree
constexpr float kUnchanged = 1.0f;  // seam pixels that speak for leaving a copy as it is
const cv::Point kNeighbours[] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}};

bool inside(const cv::Mat& m, const cv::Point& p) {
  return p.x >= 0 && p.y >= 0 && p.x < m.cols && p.y < m.rows;
}

bool meanAround(const cv::Mat& bgr, const cv::Mat& labels, const cv::Point& p, cv::Vec3f& mean) {
  cv::Vec3f sum;
  int count = 0;
  for (int v = std::max(0, p.y - kMean); v <= std::min(bgr.rows - 1, p.y + kMean); ++v) {
    for (int u = std::max(0, p.x - kMean); u <= std::min(bgr.cols - 1, p.x + kMean); ++u) {
      if (labels.at<std::uint8_t>(v, u) == 0) sum += cv::Vec3f(bgr.at<cv::Vec3b>(v, u)), ++count;
    }
  }
  if (count > 0) mean = sum / count;
  return count > 0;
}

// Mean of the neighbours that differ by no more than noise does (sigma filter, Lee 1983), and of
// what the pixel differs from it the part by which they spread more than noise (Lee 1980): texture
// stays.
cv::Vec3f denoised(const cv::Mat& bgr, const cv::Mat& labels, const cv::Point& p, float noise) {
  const cv::Vec3b own = bgr.at<cv::Vec3b>(p);
  const int limit = static_cast<int>(kNoiseReach * noise + 0.5f);
  cv::Vec3i sum;
  int count = 0, squares = 0;
  for (int v = std::max(0, p.y - kSmooth); v <= std::min(bgr.rows - 1, p.y + kSmooth); ++v) {
    for (int u = std::max(0, p.x - kSmooth); u <= std::min(bgr.cols - 1, p.x + kSmooth); ++u) {
      const cv::Vec3i c = bgr.at<cv::Vec3b>(v, u), difference = c - cv::Vec3i(own);
      if (std::max({std::abs(difference[0]), std::abs(difference[1]), std::abs(difference[2])}) >
              limit ||
          labels.at<std::uint8_t>(v, u) != 0)
        continue;
      sum += difference, squares += difference.dot(difference), ++count;
    }
  }
  if (count == 0) return own;
  const cv::Vec3f from_own = cv::Vec3f(sum) / count;
  const float variance = static_cast<float>(squares) / count - from_own.dot(from_own),
              of_noise = kNoiseTwice * 3.0f * noise * noise,
              part = of_noise < variance ? of_noise / variance : 1.0f;
  return cv::Vec3f(own) + part * from_own;
}

}  // namespace

LiveFill::LiveFill(const cv::Mat& origin, const cv::Mat& lift, const cv::Mat& hole,
                   const cv::Mat& key_bgr, const cv::Mat& key_labels)
    : origin_(origin),
      seam_(origin.size(), CV_32S, cv::Scalar(-1)),
      weight_(origin.size(), CV_32F, cv::Scalar(0.0f)),
      lift_(lift),
      copy_(origin.size(), CV_32S, cv::Scalar(kPicture)) {
  findCopies();
  addSeams(hole);
  at_key_ = missesIn(key_bgr, key_labels);
}

void LiveFill::findCopies() {
  std::vector<cv::Point> open;
  const auto join = [&](const cv::Point& p) { copy_.at<int>(p) = copies_, open.push_back(p); };
  for (int v = 0; v < origin_.rows; ++v) {
    for (int u = 0; u < origin_.cols; ++u) {
      const cv::Point start(u, v);
      if (origin_.at<cv::Vec2s>(start)[0] < 0 || copy_.at<int>(start) != kPicture) continue;
      for (join(start); !open.empty();) {
        const cv::Point p = open.back();
        open.pop_back();
        for (const cv::Point& d : kNeighbours) {
          const cv::Point q = p + d;
          const cv::Vec2s from = origin_.at<cv::Vec2s>(p) + cv::Vec2s(short(d.x), short(d.y));
          if (inside(origin_, q) && copy_.at<int>(q) == kPicture &&
              origin_.at<cv::Vec2s>(q) == from)
            join(q);
        }
      }
      ++copies_;
    }
  }
}

void LiveFill::addSeams(const cv::Mat& hole) {
  const auto offset = [&](const cv::Point& p) {
    return cv::Point(origin_.at<cv::Vec2s>(p)[0], origin_.at<cv::Vec2s>(p)[1]) - p;
  };
  const auto filled = [&](const cv::Point& p) { return origin_.at<cv::Vec2s>(p)[0] >= 0; };
  cv::Mat away(origin_.size(), CV_8U, cv::Scalar(255)),
      index(origin_.size(), CV_32S, cv::Scalar(-1));
  for (int v = 0; v < origin_.rows; ++v) {
    for (int u = 0; u < origin_.cols; ++u) {
      const cv::Point p(u, v);
      if (!filled(p)) continue;
      for (const cv::Point& d : kNeighbours) {
        const cv::Point q = p + d;
        if (!inside(origin_, q)) continue;
        const bool rim = hole.at<std::uint8_t>(q) == 0;
        if (!rim && (!filled(q) || offset(q) == offset(p))) continue;
        const Seam seam{rim ? q : q + offset(q),
                        q + offset(p),
                        rim ? 1.0f : 0.5f,
                        copy_.at<int>(p),
                        rim ? kPicture : copy_.at<int>(q),
                        (rim ? cv::Vec3f() : lift_.at<cv::Vec3f>(q)) - lift_.at<cv::Vec3f>(p)};
        if (!inside(origin_, seam.other) || !inside(origin_, seam.own)) continue;
        index.at<int>(p) = static_cast<int>(seams_.size());
        away.at<std::uint8_t>(p) = 0;
        seams_.push_back(seam);
        break;
      }
    }
  }
  if (seams_.empty()) return;
  cv::Mat distance, nearest;
  cv::distanceTransform(away, distance, nearest, cv::DIST_L2, 5, cv::DIST_LABEL_PIXEL);
  std::vector<cv::Point> seam_pixels(seams_.size() + 1);
  for (int v = 0; v < away.rows; ++v) {
    for (int u = 0; u < away.cols; ++u) {
      if (away.at<std::uint8_t>(v, u) == 0) seam_pixels[nearest.at<int>(v, u)] = {u, v};
    }
  }
  for (int v = 0; v < away.rows; ++v) {
    for (int u = 0; u < away.cols; ++u) {
      const cv::Point p(u, v);
      if (!filled(p) || distance.at<float>(p) > kFarthest) continue;
      const cv::Point z = seam_pixels[nearest.at<int>(p)];
      if (offset(z) != offset(p)) continue;
      seam_.at<int>(p) = index.at<int>(z);
      weight_.at<float>(p) = std::exp(-distance.at<float>(p) / kFade);
    }
  }
}

LiveFill::Misses LiveFill::missesIn(const cv::Mat& bgr, const cv::Mat& labels) const {
  Misses misses(seams_.size());
#pragma omp parallel for schedule(static)
  for (std::size_t i = 0; i < seams_.size(); ++i) {
    cv::Vec3f other, own;
    if (meanAround(bgr, labels, seams_[i].other, other) &&
        meanAround(bgr, labels, seams_[i].own, own))
      misses[i] = other - own + seams_[i].lift;
  }
  return misses;
}

// What copies have to be corrected by for the seams to differ as at the key frame: least squares
// (Jacobi), robust.
std::vector<cv::Vec3f> LiveFill::broughtBack(const Misses& misses) const {
  std::vector<cv::Vec3f> change(seams_.size()), copies(copies_);
  std::vector<float> weight(seams_.size(), 0.0f);
  for (std::size_t i = 0; i < seams_.size(); ++i) {
    if (!misses[i] || !at_key_[i]) continue;
    change[i] = *misses[i] - *at_key_[i];
    weight[i] = 1.0f / (1.0f + change[i].dot(change[i]) / (kEdge * kEdge));
  }
  for (int round = 0; round < kRounds; ++round) {
    std::vector<cv::Vec3f> sum(copies_);
    std::vector<float> count(copies_, kUnchanged);
    for (std::size_t i = 0; i < seams_.size(); ++i) {
      const Seam& s = seams_[i];
      const cv::Vec3f beyond = s.beyond == kPicture ? cv::Vec3f() : copies[s.beyond];
      sum[s.copy] += weight[i] * (change[i] + beyond), count[s.copy] += weight[i];
    }
    for (int k = 0; k < copies_; ++k) copies[k] = sum[k] / count[k];
  }
  return copies;
}

LiveFill::Corrections LiveFill::corrections(const cv::Mat& bgr, const cv::Mat& labels) const {
  const Misses misses = missesIn(bgr, labels);
  Corrections c{broughtBack(misses), std::vector<cv::Vec3f>(seams_.size())};
  for (std::size_t i = 0; i < seams_.size(); ++i) {
    const Seam& s = seams_[i];
    if (!misses[i]) continue;
    cv::Vec3f miss = *misses[i] - c.copies[s.copy];
    if (s.beyond != kPicture) miss += c.copies[s.beyond];
    c.seams[i] = s.share * miss / (1.0f + miss.dot(miss) / (kEdge * kEdge));
  }
  return c;
}

bool LiveFill::at(const cv::Mat& bgr, const cv::Mat& labels, const Corrections& corrections,
                  float noise, int u, int v, cv::Vec3f& colour) const {
  const cv::Vec2s from = origin_.at<cv::Vec2s>(v, u);
  if (from[0] < 0 || labels.at<std::uint8_t>(from[1], from[0]) != 0) return false;
  colour = denoised(bgr, labels, {from[0], from[1]}, noise) + lift_.at<cv::Vec3f>(v, u) +
           corrections.copies[copy_.at<int>(v, u)];
  const int seam = seam_.at<int>(v, u);
  if (seam >= 0) colour += weight_.at<float>(v, u) * corrections.seams[seam];
  return true;
}

}  // namespace calipso::render
