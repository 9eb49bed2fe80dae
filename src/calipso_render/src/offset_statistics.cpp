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
constexpr double kBlur = 1.4;     // px, of the histogram
constexpr float kFewest = 0.1f;   // blurred count; a single match of full contrast makes 0.08
constexpr float kContrast = 10.0f;  // code values: patches of less count less, they fit anywhere
constexpr int kWeighed = 4;     // times as many as asked for are judged by the hole they fill

constexpr int kAround = 10;       // px around the hole in which level offsets are judged
constexpr int kSteepest = 8;      // a level line falls by no more than one px in so many
constexpr double kOther = 40.0;   // code values
constexpr int kFewestKnown = 40;  // px

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

cv::Mat copyable(const cv::Mat& source, const cv::Point& offset) {
  const cv::Rect all(0, 0, source.cols, source.rows), from = (all + offset) & all;
  cv::Mat out = cv::Mat::zeros(source.size(), CV_8U);
  if (!from.empty()) source(from).copyTo(out(from - offset));
  return out;
}

std::vector<cv::Point> dominantOffsets(const cv::Mat& image, const cv::Mat& source, const cv::Mat& hole, double shortest, int most, std::uint32_t seed) {
  PatchMatches matches(image, source, shortest, seed);
  for (int i = 0; i < kSweeps; ++i) matches.sweep(i % 2 != 0);
  cv::Mat counts = matches.histogram(), highest;
  cv::GaussianBlur(counts, counts, {0, 0}, kBlur);
  cv::dilate(counts, highest, cv::Mat::ones(2 * kPeakRadius + 1, 2 * kPeakRadius + 1, CV_8U));
  std::vector<std::pair<float, cv::Point>> peaks;
  for (int v = 0; v < counts.rows; ++v) {
    for (int u = 0; u < counts.cols; ++u) {
      const float count = counts.at<float>(v, u);
      if (count < kFewest || count != highest.at<float>(v, u)) continue;
      const cv::Point offset(u - image.cols, v - image.rows);
      const float partners = static_cast<float>(image.cols - std::abs(offset.x)) * (image.rows - std::abs(offset.y)) + image.total() / 50.0f;
      peaks.push_back({count / std::sqrt(partners), offset});
    }
  }
  const auto better = [](const auto& a, const auto& b) { return a.first > b.first; };
  std::stable_sort(peaks.begin(), peaks.end(), better);
  if (static_cast<int>(peaks.size()) > kWeighed * most) peaks.resize(kWeighed * most);
  const double total = cv::countNonZero(hole);
  for (auto& [score, offset] : peaks) score *= static_cast<float>(0.1 + cv::countNonZero(copyable(source, offset) & hole) / total);
  std::stable_sort(peaks.begin(), peaks.end(), better);
  std::vector<cv::Point> offsets;
  for (const auto& [score, offset] : peaks) {
    if (static_cast<int>(offsets.size()) < most) offsets.push_back(offset);
  }
  return offsets;
}

std::vector<cv::Point> levelOffsets(const cv::Mat& image, const cv::Mat& source, const cv::Mat& hole, int most) {
  cv::Mat around;
  cv::dilate(hole, around, cv::Mat::ones(2 * kAround + 1, 2 * kAround + 1, CV_8U));
  std::vector<cv::Point> known;
  cv::findNonZero(around & source, known);
  const cv::Rect all(0, 0, image.cols, image.rows);
  std::vector<cv::Point> offsets;
  for (int i = 1; i <= most / 2; ++i) {
    const int way = image.cols * i / (most / 2 + 1), slope = std::max(2, way / kSteepest);
    for (const int du : {way, -way}) {
      double best = 1e30;
      cv::Point best_offset;
      for (int dv = -slope; dv <= slope; ++dv) {
        double sum = 0.0;
        int count = 0;
        for (const cv::Point& p : known) {
          const cv::Point q = p + cv::Point(du, dv);
          if (!all.contains(q) || source.at<std::uint8_t>(q) == 0) continue;
          // What differs much is another thing, not the same one continued.
          sum += std::min(cv::norm(image.at<cv::Vec3f>(p) - image.at<cv::Vec3f>(q)), kOther), ++count;
        }
        if (count >= kFewestKnown && sum / count < best) best = sum / count, best_offset = {du, dv};
      }
      if (best < 1e30) offsets.push_back(best_offset);
    }
  }
  return offsets;
}

}  // namespace calipso::render
