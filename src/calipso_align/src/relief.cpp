#include "calipso_align/relief.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_align/mask_edge.hpp"
#include "calipso_align/planar_pieces.hpp"
#include "calipso_align/surface_islands.hpp"

namespace calipso::align {
namespace {

constexpr float kNoiseUnits = 2.0f;  // GaussianMixture's noise
constexpr size_t kMaxSamples = 3000;
constexpr float kOpenJump = 1e6f;  // between a surface and nothing

float quantile(std::vector<float>& values, double share) {
  const auto place = values.begin() + static_cast<size_t>(share * (values.size() - 1));
  std::nth_element(values.begin(), place, values.end());
  return *place;
}

// Standard deviation of inverse depth: second differences of a plane are noise alone (variance 6),
// and most triples of neighbours lie on something flat. Where depth is quantised most of them are
// zero, and the smallest of the others tell the quantum, unless they are so few that they are
// edges.
float noiseOf(const cv::Mat& inverse) {
  constexpr double kMoreThanEdges = 0.03;
  std::vector<float> bends;
  const auto add = [&](float before, float here, float behind) {
    if (before > 0.0f && here > 0.0f && behind > 0.0f)
      bends.push_back(std::abs(before - 2 * here + behind));
  };
  for (int y = 1; y + 1 < inverse.rows; ++y) {
    const float *above = inverse.ptr<float>(y - 1), *q = inverse.ptr<float>(y),
                *below = inverse.ptr<float>(y + 1);
    for (int x = 1; x + 1 < inverse.cols; ++x) {
      add(q[x - 1], q[x], q[x + 1]);
      add(above[x], q[x], below[x]);
    }
  }
  if (bends.empty()) return 0.0f;
  double largest = 0.0;
  cv::minMaxLoc(inverse, nullptr, &largest);
  const float scale = 1.4826f / std::sqrt(6.0f), finest = 1e-5f * static_cast<float>(largest);
  const float noise = scale * quantile(bends, 0.5);
  const size_t all = bends.size();
  bends.erase(std::remove_if(bends.begin(), bends.end(), [&](float b) { return b < finest; }),
              bends.end());
  const float quantum = bends.size() > kMoreThanEdges * all ? scale * quantile(bends, 0.1) : 0.0f;
  return std::max({noise, quantum, finest});
}

float colourStep(const cv::Mat& image, int x, int y, int dx, int dy) {
  const cv::Vec3b a = image.at<cv::Vec3b>(y, x), b = image.at<cv::Vec3b>(y + dy, x + dx);
  return static_cast<float>(std::abs(a[0] - b[0]) + std::abs(a[1] - b[1]) + std::abs(a[2] - b[2]));
}

constexpr int kReach = 8;  // px; edges of depth and picture are compared this far apart
using Profile = std::array<double, 2 * kReach + 1>;

// Sum of the picture's steps at every offset from the steps of depth, along rows or columns.
void addProfile(const cv::Mat& image, const cv::Mat& steps, int dx, int dy, Profile& profile) {
  for (int y = kReach; y + kReach + 1 < image.rows; ++y)
    for (int x = kReach; x + kReach + 1 < image.cols; ++x)
      if (steps.at<uchar>(y, x))
        for (int o = -kReach; o <= kReach; ++o)
          profile[o + kReach] += colourStep(image, x + o * dx, y + o * dy, dx, dy);
}

// How far from the steps of depth the steps of the picture lie, px: most of what stands out.
double registrationError(const cv::Mat& image, const cv::Mat& across, const cv::Mat& down) {
  Profile profile = {};
  addProfile(image, across, 1, 0, profile);
  addProfile(image, down, 0, 1, profile);
  Profile sorted = profile;
  std::sort(sorted.begin(), sorted.end());
  const double ground = sorted[kReach];  // median: what there is anywhere
  double total = 0.0;
  for (const double p : profile) total += std::max(0.0, p - ground);
  if (!(total > 0.0)) return kReach;
  constexpr double kMost = 0.7;
  double within = std::max(0.0, profile[kReach] - ground);
  int r = 0;
  while (within < kMost * total && ++r <= kReach)
    for (const int o : {-r, r}) within += std::max(0.0, profile[kReach + o] - ground);
  return r;
}

// The step in which depth is stored, m: the least by which neighbours differ that do. What is not
// quantised differs by next to nothing in some places.
float quantumOf(const cv::Mat& depth) {
  constexpr double kLeast = 0.05;  // quantile: whatever rounding makes of the step is passed over
  std::vector<float> steps;
  for (int y = 0; y + 1 < depth.rows; ++y)
    for (int x = 0; x + 1 < depth.cols; ++x) {
      const float here = depth.at<float>(y, x);
      for (const float next : {depth.at<float>(y, x + 1), depth.at<float>(y + 1, x)})
        if (here > 0.0f && next > 0.0f && next != here) steps.push_back(std::abs(next - here));
    }
  return steps.empty() ? 0.0f : quantile(steps, kLeast);
}

// Where depth is that of one of the planes.
cv::Mat surfacesOf(const std::vector<cv::Mat>& supports, const cv::Mat& depth, float noise) {
  constexpr float kDeviations = 3.0f;
  const float quantum = quantumOf(depth);
  cv::Mat same = cv::Mat::zeros(depth.size(), CV_8U);
  for (const cv::Mat& support : supports)
    for (int y = 0; y < same.rows; ++y)
      for (int x = 0; x < same.cols; ++x) {
        const float z = depth.at<float>(y, x), expected = support.at<float>(y, x);
        if (!(z > 0.0f) || !(expected > 0.0f)) continue;
        const float deviation = noise * expected * expected;  // of z, noise being that of 1 / z
        if (std::abs(z - expected) <= std::max(kDeviations * deviation, quantum))
          same.at<uchar>(y, x) = 255;
      }
  return same;
}

}  // namespace

Relief makeRelief(const cv::Mat& image, const cv::Mat& depth,
                  const std::vector<cv::Mat>& supports) {
  constexpr double kRegistered = 2.0;  // px; an edge is blurred about as far
  constexpr float kClear = 5.0f * kNoiseUnits;
  Relief relief;
  if (depth.empty() || cv::countNonZero(depth > 0) == 0) return relief;
  cv::Mat inverse = cv::Mat::zeros(depth.size(), CV_32F);
  for (int y = 0; y < depth.rows; ++y)
    for (int x = 0; x < depth.cols; ++x)
      if (depth.at<float>(y, x) > 0.0f) inverse.at<float>(y, x) = 1.0f / depth.at<float>(y, x);
  const float noise = noiseOf(inverse);
  if (!(noise > 0.0f)) return relief;

  double nearest = 0.0;
  cv::minMaxLoc(inverse, nullptr, &nearest);
  relief.units = kNoiseUnits / noise;
  relief.volume = static_cast<double>(depth.total()) * kNoiseUnits * nearest / noise;
  relief.surface.create(depth.size(), CV_32FC3);
  relief.state.create(depth.size(), CV_8U);
  for (int y = 0; y < depth.rows; ++y)
    for (int x = 0; x < depth.cols; ++x) {
      const float q = inverse.at<float>(y, x);
      relief.surface.at<cv::Vec3f>(y, x) = cv::Vec3f(x, y, kNoiseUnits * q / noise);
      relief.state.at<uchar>(y, x) = q > 0.0f ? Relief::kSurface : Relief::kNone;
    }

  const cv::Mat everywhere(depth.size(), CV_8U, cv::Scalar(255));
  const float strong = std::max(kClear, 4.0f * meanJump(relief, everywhere));
  cv::Mat across = cv::Mat::zeros(depth.size(), CV_8U), down = across.clone();
  for (int y = 0; y + 1 < depth.rows; ++y)
    for (int x = 0; x + 1 < depth.cols; ++x) {
      across.at<uchar>(y, x) = jump(relief, {x, y}, {1, 0}) > strong ? 255 : 0;
      down.at<uchar>(y, x) = jump(relief, {x, y}, {0, 1}) > strong ? 255 : 0;
    }
  const double error = registrationError(image, across, down);
  relief.registered = error <= kRegistered;
  if (!relief.registered)
    relief.state.setTo(Relief::kUnusable,
                       grown(across | down, static_cast<int>(std::ceil(error)) + 1));
  if (relief.registered) {
    const float crease = creaseThreshold(relief);
    relief.pieces = planarPieces(relief, crease);
    relief.planes = sharedPlanes(relief, relief.pieces);
    relief.islands = surfaceIslands(relief, crease);
  }
  if (!supports.empty())
    relief.on_support = surfacesOf(supports, depth, noise) & (relief.state == Relief::kSurface);
  if (relief.registered && !supports.empty())
    cv::connectedComponents((relief.state == Relief::kSurface) & ~relief.on_support, relief.raised,
                            4, CV_32S);
  return relief;
}

Relief resized(const Relief& relief, const cv::Rect& view, const cv::Size& size) {
  Relief result;
  if (relief.empty()) return result;
  cv::resize(relief.surface(view), result.surface, size, 0, 0, cv::INTER_NEAREST);
  cv::resize(relief.state(view), result.state, size, 0, 0, cv::INTER_NEAREST);
  if (!relief.pieces.empty())
    cv::resize(relief.pieces(view), result.pieces, size, 0, 0, cv::INTER_NEAREST);
  if (!relief.planes.empty())
    cv::resize(relief.planes(view), result.planes, size, 0, 0, cv::INTER_NEAREST);
  if (!relief.islands.empty())
    cv::resize(relief.islands(view), result.islands, size, 0, 0, cv::INTER_NEAREST);
  if (!relief.raised.empty())
    cv::resize(relief.raised(view), result.raised, size, 0, 0, cv::INTER_NEAREST);
  if (!relief.on_support.empty())
    cv::resize(relief.on_support(view), result.on_support, size, 0, 0, cv::INTER_NEAREST);
  result.units = relief.units;
  result.volume = relief.volume;
  result.registered = relief.registered;
  return result;
}

float jump(const Relief& relief, const cv::Point& p, const cv::Point& step) {
  const cv::Rect whole(cv::Point(), relief.state.size());
  const auto seen = [&](const cv::Point& a) {
    return whole.contains(a) && relief.state.at<uchar>(a) == Relief::kSurface;
  };
  const auto q = [&](const cv::Point& a) { return relief.surface.at<cv::Vec3f>(a)[2]; };
  const cv::Point next = p + step;
  const bool here = seen(p), there = seen(next);
  if (!here && !there) return 0.0f;
  if (!here || !there) return kOpenJump;
  float least = std::abs(q(p) - q(next));
  const cv::Point before = p - step, behind = next + step;
  if (seen(before)) least = std::min(least, std::abs(q(next) - 2 * q(p) + q(before)));
  if (seen(behind)) least = std::min(least, std::abs(q(p) - 2 * q(next) + q(behind)));
  return least;
}

float meanJump(const Relief& relief, const cv::Mat& mask) {
  double sum = 0.0;
  long count = 0;
  for (int y = 0; y < mask.rows; ++y)
    for (int x = 0; x + 1 < mask.cols; ++x) {
      if (!mask.at<uchar>(y, x)) continue;
      const float j = jump(relief, {x, y}, {1, 0});
      if (j >= kOpenJump) continue;
      sum += j;
      ++count;
    }
  return count > 0 ? static_cast<float>(sum / count) : 0.0f;
}

SurfaceModel SurfaceModel::fit(const Relief& relief, const cv::Mat& samples, const cv::Mat& strokes,
                               double share, int components) {
  constexpr int kTelling = 20;        // strokes with fewer pixels of usable depth tell nothing
  constexpr double kOutliers = 0.05;  // of the surfaces there are, known to no model
  SurfaceModel model;
  const cv::Mat surfaces = samples & (relief.state == Relief::kSurface);
  std::vector<cv::Vec3f> all;
  for (int y = 0; y < samples.rows; ++y)
    for (int x = 0; x < samples.cols; ++x)
      if (surfaces.at<uchar>(y, x)) all.push_back(relief.surface.at<cv::Vec3f>(y, x));
  // Samples that look alike may be the sky behind the object.
  const cv::Mat usable = relief.state != Relief::kUnusable;
  const bool told = !strokes.empty() && cv::countNonZero(strokes & usable) >= kTelling;
  const cv::Mat& sure = told ? strokes : samples;
  const double none = cv::countNonZero(sure & (relief.state == Relief::kNone));
  const double some = cv::countNonZero(sure & (relief.state == Relief::kSurface));
  // Laplace's rule: what was never seen is still possible.
  const double total = none + some + 2.0;
  const double floor = 1.0 / (samples.total() + 1.0);
  const auto nats = [](double p) { return static_cast<float>(-std::log(p)); };
  model.none_cost_ = nats(std::max(floor, share) * (none + 1.0) / total);
  model.some_cost_ = nats(std::max(floor, share) * (some + 1.0) / total);
  model.outlier_cost_ = nats(kOutliers / relief.volume);
  std::vector<cv::Vec3f> few;
  const size_t count = std::min(all.size(), kMaxSamples);
  for (size_t i = 0; i < count; ++i) few.push_back(all[i * all.size() / count]);
  if (!few.empty()) model.surfaces_ = {GaussianMixture::fit(few, components, Split::kThickest)};
  return model;
}

float SurfaceModel::cost(const Relief& relief, int x, int y) const {
  switch (relief.state.at<uchar>(y, x)) {
    case Relief::kNone:
      return none_cost_;
    case Relief::kSurface:
      if (surfaces_.empty()) return outlier_cost_;
      return std::min(outlier_cost_,
                      some_cost_ + surfaces_[0].cost(relief.surface.at<cv::Vec3f>(y, x)));
    default:
      return 0.0f;
  }
}

}  // namespace calipso::align
