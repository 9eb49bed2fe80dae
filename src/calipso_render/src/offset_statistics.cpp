#include "offset_statistics.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace calipso::render {
namespace {

constexpr int kRadius = 3;      // px; patches are squares of 7
constexpr int kSweeps = 4;
constexpr int kPeakRadius = 2;  // px: offsets so close are one
constexpr double kSpot = 1.4, kLine = 0.9, kRidge = 6.0;  // px: a repeated thing's spread; across and along a line
constexpr float kFewest = 0.1f;   // pooled count; a single match of full contrast makes 0.08 as a spot
constexpr float kContrast = 10.0f;  // code values: patches of less count less, they fit anywhere
constexpr int kWeighed = 4;     // times as many as asked for are judged by the hole they fill

// Approximate nearest patches (PatchMatch, Barnes et al. 2009) at least `shortest` px away.
class PatchMatches {
 public:
  PatchMatches(const cv::Mat& image, const cv::Mat& known, double shortest, std::uint32_t seed)
      : image_(image), shortest_(static_cast<float>(shortest * shortest)), seed_(seed), matches_(image.total()) {
    cv::erode(known, whole_, cv::Mat::ones(2 * kRadius + 1, 2 * kRadius + 1, CV_8U), {-1, -1}, 1, cv::BORDER_CONSTANT, cv::Scalar(0));
    for (int v = kRadius; v + kRadius < image.rows; ++v) {
      for (int u = kRadius; u + kRadius < image.cols; ++u) {
        if (whole_.at<std::uint8_t>(v, u) != 0) patches_.emplace_back(u, v);
      }
    }
    for (const cv::Point& p : patches_) {
      for (int i = 0; i < 8 && at(p).to.x < 0; ++i) tryMatch(p, patches_[random(p, i) % patches_.size()]);
    }
  }

  void sweep(bool backwards) {
    const int step = backwards ? 1 : -1;
    ++sweep_;
    for (std::size_t i = 0; i < patches_.size(); ++i) {
      const cv::Point p = patches_[backwards ? patches_.size() - 1 - i : i];
      for (const cv::Point& d : {cv::Point(step, 0), cv::Point(0, step)}) {
        const cv::Point q = p + d;
        if (whole(q) && at(q).to.x >= 0) tryMatch(p, at(q).to - d);
      }
      int salt = 8;
      for (int reach = std::max(image_.cols, image_.rows); reach >= 1 && at(p).to.x >= 0; reach /= 3, ++salt) {
        const std::uint32_t h = random(p, salt);
        tryMatch(p, at(p).to + cv::Point(static_cast<int>(h % (2 * reach + 1)) - reach, static_cast<int>((h >> 16) % (2 * reach + 1)) - reach));
      }
    }
  }

  // How often each offset occurs; the centre of the result is no offset.
  cv::Mat histogram() const {
    cv::Mat grey, mean, square;
    cv::cvtColor(image_, grey, cv::COLOR_BGR2GRAY);
    const cv::Size side(2 * kRadius + 1, 2 * kRadius + 1);
    cv::blur(grey, mean, side);
    cv::blur(grey.mul(grey), square, side);
    cv::Mat contrast = cv::max(square - mean.mul(mean), 0.0);
    cv::sqrt(contrast, contrast);
    cv::Mat counts = cv::Mat::zeros(2 * image_.rows + 1, 2 * image_.cols + 1, CV_32F);
    for (const cv::Point& p : patches_) {
      const cv::Point to = matches_[static_cast<std::size_t>(p.y) * image_.cols + p.x].to;
      if (to.x < 0) continue;
      const float weight = std::min(1.0f, contrast.at<float>(p) / kContrast);
      counts.at<float>(to.y - p.y + image_.rows, to.x - p.x + image_.cols) += weight;
      counts.at<float>(p.y - to.y + image_.rows, p.x - to.x + image_.cols) += weight;
    }
    return counts;
  }

 private:
  struct Match {
    cv::Point to{-1, -1};
    float distance = 1e30f;
  };

  Match& at(const cv::Point& p) { return matches_[static_cast<std::size_t>(p.y) * image_.cols + p.x]; }
  bool whole(const cv::Point& p) const {
    return p.x >= kRadius && p.y >= kRadius && p.x + kRadius < image_.cols && p.y + kRadius < image_.rows && whole_.at<std::uint8_t>(p) != 0;
  }

  void tryMatch(const cv::Point& p, const cv::Point& q) {
    const cv::Point d = q - p;
    if (!whole(q) || d.dot(d) < shortest_) return;
    Match& best = at(p);
    float sum = 0.0f;
    using Row = Eigen::Map<const Eigen::Array<float, 3 * (2 * kRadius + 1), 1>>;
    for (int dv = -kRadius; dv <= kRadius && sum < best.distance; ++dv) {
      const Row a(image_.ptr<float>(p.y + dv) + 3 * (p.x - kRadius)), b(image_.ptr<float>(q.y + dv) + 3 * (q.x - kRadius));
      sum += (a - b).square().sum();
    }
    if (sum < best.distance) best = {q, sum};
  }

  std::uint32_t random(const cv::Point& p, int salt) const {
    std::uint32_t h = seed_ * 0x9e3779b9u ^ static_cast<std::uint32_t>(p.x) * 0x85ebca6bu ^ static_cast<std::uint32_t>(p.y) * 0xc2b2ae35u ^
                      static_cast<std::uint32_t>(salt + 64 * sweep_) * 0x27d4eb2fu;
    h ^= h >> 15, h *= 0x2c1b3c6du, h ^= h >> 12, h *= 0x297a2d39u, h ^= h >> 15;
    return h;
  }

  const cv::Mat& image_;
  cv::Mat whole_;  // CV_8UC1: the patch around it is known
  float shortest_;
  std::uint32_t seed_;
  int sweep_ = 0;
  std::vector<Match> matches_;
  std::vector<cv::Point> patches_;
};

}  // namespace

namespace {

struct Peak {
  float score;
  cv::Point offset;
};

bool better(const Peak& a, const Peak& b) { return a.score > b.score; }

// Local maxima of the counts, each pooled over `pool` px: a thing that repeats makes a spot, a line makes a ridge
// along itself, from which one offset in a while is enough.
void findPeaks(const cv::Mat& counts, const cv::Size2d& pool, const cv::Size& size, std::vector<Peak>& peaks) {
  cv::Mat pooled, highest;
  cv::GaussianBlur(counts, pooled, {0, 0}, pool.width, pool.height);
  const cv::Size window(2 * static_cast<int>(kPeakRadius * pool.width / kSpot) + 1, 2 * static_cast<int>(kPeakRadius * pool.height / kSpot) + 1);
  cv::dilate(pooled, highest, cv::Mat::ones(window, CV_8U));
  for (int v = 0; v < pooled.rows; ++v) {
    for (int u = 0; u < pooled.cols; ++u) {
      const float count = pooled.at<float>(v, u);
      if (count < kFewest || count != highest.at<float>(v, u)) continue;
      const cv::Point offset(u - size.width, v - size.height);
      const float partners = static_cast<float>(size.width - std::abs(offset.x)) * (size.height - std::abs(offset.y)) + size.area() / 50.0f;
      peaks.push_back({count / std::sqrt(partners), offset});
    }
  }
}

}  // namespace

cv::Mat copyable(const cv::Mat& source, const cv::Point& offset) {
  const cv::Rect all(0, 0, source.cols, source.rows), from = (all + offset) & all;
  cv::Mat out = cv::Mat::zeros(source.size(), CV_8U);
  if (!from.empty()) source(from).copyTo(out(from - offset));
  return out;
}

std::vector<cv::Point> dominantOffsets(const cv::Mat& image, const cv::Mat& source, const cv::Mat& hole, double shortest, int most, std::uint32_t seed) {
  PatchMatches matches(image, source, shortest, seed);
  for (int i = 0; i < kSweeps; ++i) matches.sweep(i % 2 != 0);
  const cv::Mat counts = matches.histogram();
  const double total = cv::countNonZero(hole);
  std::vector<cv::Point> offsets;
  const cv::Size2d pools[] = {{kSpot, kSpot}, {kRidge, kLine}, {kLine, kRidge}};
  const double shares[] = {0.5, 0.85, 1.0};  // of what is asked for, after each kind
  for (int kind = 0; kind < 3; ++kind) {
    std::vector<Peak> peaks;
    findPeaks(counts, pools[kind], image.size(), peaks);
    std::stable_sort(peaks.begin(), peaks.end(), better);
    if (static_cast<int>(peaks.size()) > kWeighed * most) peaks.resize(kWeighed * most);
    for (Peak& p : peaks) p.score *= static_cast<float>(0.1 + cv::countNonZero(copyable(source, p.offset) & hole) / total);
    std::stable_sort(peaks.begin(), peaks.end(), better);
    for (const Peak& p : peaks) {
      if (static_cast<double>(offsets.size()) >= shares[kind] * most) break;
      if (std::find(offsets.begin(), offsets.end(), p.offset) == offsets.end()) offsets.push_back(p.offset);
    }
  }
  return offsets;
}

}  // namespace calipso::render
