#include "light/shadow_clue.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"

namespace calipso::render {
namespace {

constexpr std::size_t kSamples = 2500;
constexpr float kReach = 6.0f;     // radii of an object around it in which its shadow is looked for
constexpr int kMaskMargin = 5;     // px around the masks that are left out: mixed pixels
constexpr float kQuiet = 5.0f;     // code values of spread over time: the background rests
constexpr int kFewestFrames = 3;   // in which the plate must have been seen
constexpr float kDarkest = 0.02f;  // linear; added before the logarithm
constexpr float kBrighter = -0.2f, kDarker = 1.5f;  // range of darkness: more is something else
constexpr double kOutlier = 0.2;  // error of a sample beyond which it does not count more
constexpr int kDepths = 51;       // values of b tried
constexpr double kDepthStep = 0.03;
constexpr double kLeastDeviation = 0.015;  // of log-brightness
constexpr double kCorrelated = 20.0;       // so many neighbouring samples err alike
constexpr int kStep = 2;                   // px
// part of the distance by which something else than a plane is seen before or behind it
constexpr float kOffPlane = 0.05f;
constexpr float kShadow = 0.15f;  // darkness that may be a shadow
constexpr std::size_t kCandidates = 24;

float logBrightness(const cv::Vec3f& code) {
  const cv::Vec3f linear(linearFromRealCode(code[0]), linearFromRealCode(code[1]),
                         linearFromRealCode(code[2]));
  return std::log(luminance(linear) + kDarkest);
}

std::vector<Eigen::AlignedBox3f> boxesOf(const View& view, const std::vector<bool>& which) {
  std::vector<Eigen::AlignedBox3f> boxes;
  for (std::size_t i = 0; i < view.actors.size(); ++i) {
    if (!which[i]) continue;
    boxes.emplace_back();
    for (const Eigen::Vector3f& p : view.actors[i].vertices) boxes.back().extend(p);
  }
  return boxes;
}

// Value of the picture between pixels. @pre `at` lies in it less its last row and column
cv::Vec3f between(const cv::Mat& picture, const Eigen::Vector2d& at) {
  const int u = static_cast<int>(at.x()), v = static_cast<int>(at.y());
  const float s = static_cast<float>(at.x() - u), t = static_cast<float>(at.y() - v);
  const auto value = [&](int du, int dv) { return picture.at<cv::Vec3f>(v + dv, u + du); };
  return (value(0, 0) * (1.0f - s) + value(1, 0) * s) * (1.0f - t) +
         (value(0, 1) * (1.0f - s) + value(1, 1) * s) * t;
}

bool isNear(const Eigen::Vector3f& p, const std::vector<Eigen::AlignedBox3f>& boxes) {
  return std::any_of(boxes.begin(), boxes.end(), [&](const Eigen::AlignedBox3f& b) {
    return (p - b.center()).norm() < 0.5f * kReach * b.diagonal().norm();
  });
}

// Where the views do not show the place but objects.
std::vector<cv::Mat> coveredOf(const std::vector<View>& views) {
  std::vector<cv::Mat> covered(views.size());
  for (std::size_t i = 0; i < views.size(); ++i) {
    cv::dilate(views[i].labels != 0, covered[i],
               cv::Mat::ones(2 * kMaskMargin + 1, 2 * kMaskMargin + 1, CV_8U));
  }
  return covered;
}

// Bit i: view i shows the place at a position.
std::uint32_t shownBy(const std::vector<View>& views, const std::vector<cv::Mat>& covered,
                      const Eigen::Vector3f& position) {
  std::uint32_t shown = 0;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Eigen::Vector3d p = views[i].camera.world_from_camera.inverse() * position.cast<double>();
    if (p.z() <= 0.0) continue;
    const Eigen::Vector2d uv = views[i].camera.project(p);
    const cv::Point at(cvRound(uv.x()), cvRound(uv.y()));
    if (cv::Rect({0, 0}, covered[i].size()).contains(at) && covered[i].at<std::uint8_t>(at) == 0)
      shown |= 1u << i;
  }
  return shown;
}

// `count` of them or up to twice as many, evenly spaced.
template <typename T>
std::vector<T> thinned(const std::vector<T>& all, std::size_t count) {
  const std::size_t step = std::max<std::size_t>(1, all.size() / count);
  std::vector<T> kept;
  for (std::size_t i = 0; i < all.size(); i += step) kept.push_back(all[i]);
  return kept;
}

// Of darkness without a shadow, which most places lie in: what noise and texture do.
template <typename Samples>
double unshadedVariance(const Samples& samples) {
  std::vector<double> squares;
  for (const auto& s : samples) squares.push_back(s.darkness * s.darkness);
  std::nth_element(squares.begin(), squares.begin() + squares.size() / 2, squares.end());
  return std::max(kLeastDeviation * kLeastDeviation,
                  squares[squares.size() / 2] / 0.455);  // median of chi^2, one degree
}

}  // namespace

std::optional<cv::Vec3f> unshaded(const EmptyPlace& place,
                                  const Eigen::Isometry3d& camera_from_world,
                                  const Eigen::Vector3f& position) {
  const Eigen::Vector3d p = camera_from_world * position.cast<double>();
  if (place.plate.count.empty() || p.z() <= 0.0) return std::nullopt;
  const Eigen::Vector2d uv = place.camera.project(p);
  const cv::Size size = place.plate.count.size();
  if (!(uv.x() >= 0.0 && uv.y() >= 0.0 && uv.x() < size.width - 1 && uv.y() < size.height - 1))
    return std::nullopt;
  const cv::Point nearest(static_cast<int>(std::lround(uv.x())),
                          static_cast<int>(std::lround(uv.y())));
  if (place.plate.spread.at<float>(nearest) >= kQuiet) return std::nullopt;
  const std::uint8_t* above = place.plate.count.ptr<std::uint8_t>(static_cast<int>(uv.y()));
  const std::uint8_t* below = place.plate.count.ptr<std::uint8_t>(static_cast<int>(uv.y()) + 1);
  const int u = static_cast<int>(uv.x());  // the value is one of four pixels, mixed
  if (std::min({above[u], above[u + 1], below[u], below[u + 1]}) < kFewestFrames)
    return std::nullopt;
  const float depth = place.depth.empty() ? 0.0f : place.depth.at<float>(nearest);
  if (depth > 0.0f && std::abs(depth - p.z()) > kOffPlane * p.z()) return std::nullopt;
  return between(place.plate.plate, uv);
}

std::vector<bool> leavers(const View& view, const std::vector<bool>& moves,
                          const Background& plate) {
  std::vector<bool> leave(moves.size(), false);
  for (std::size_t i = 0; i < moves.size() && !plate.count.empty(); ++i) {
    const cv::Mat mask = view.labels == view.actors[i].surface->index;
    leave[i] = moves[i] && 2 * cv::countNonZero(mask & (plate.count >= kFewestFrames)) >=
                               cv::countNonZero(mask);
  }
  return leave;
}

ShadowClue::ShadowClue(const std::vector<View>& views, const std::vector<bool>& casts,
                       const std::vector<SupportPlane>& planes, const EmptyPlace& place) {
  assert(views.size() <= 32);
  const std::vector<cv::Mat> covered = coveredOf(views);
  const Eigen::Isometry3d camera_from_world = place.camera.world_from_camera.inverse();
  for (std::size_t i = 0; i < views.size(); ++i) {
    const std::vector<Eigen::AlignedBox3f> boxes = boxesOf(views[i], casts);
    std::vector<Sample> samples;
    std::size_t unknown = 0;
    for (int v = 0; v < views[i].picture.rows; v += kStep) {
      for (int u = 0; u < views[i].picture.cols; u += kStep) {
        if (covered[i].at<std::uint8_t>(v, u) != 0) continue;
        const auto receiver = receiverAt(planes, views[i].camera, u, v);
        if (!receiver || !isNear(receiver->position, boxes)) continue;
        const auto without = unshaded(place, camera_from_world, receiver->position);
        if (!without) {
          ++unknown;
          continue;
        }
        const float darkness = logBrightness(*without) - logBrightness(views[i].codeAt(v, u));
        samples.push_back(
            {receiver->position, receiver->normal, std::clamp(darkness, kBrighter, kDarker), 0});
      }
    }
    if (samples.empty() || samples.size() < unknown) continue;
    samples = thinned(samples, kSamples);
    for (Sample& s : samples) s.shown = shownBy(views, covered, s.position) | 1u << i;
    std::vector<Eigen::Vector3f> centres;
    for (const Eigen::AlignedBox3f& box : boxes) centres.push_back(box.center());
    const double variance = unshadedVariance(samples);
    seen_.push_back({i, std::move(samples), variance, std::move(centres)});
  }
}

double ShadowClue::misfit(const std::vector<RayScene>& objects, const Eigen::Vector3f& l) const {
  // Squared errors, in variances, less those of b = 0, for every b; places in the light err alike.
  std::array<double, kDepths> more{};
  for (const Seen& seen : seen_) {
    for (const Sample& s : seen.samples) {
      bool darker = objects[seen.view].blocked(s.position, s.normal, l);
      bool lit = false;  // in another view
      for (std::size_t j = 0; darker && !lit && j < objects.size(); ++j) {
        lit = j != seen.view && (s.shown >> j & 1u) != 0 &&
              !objects[j].blocked(s.position, s.normal, l);
      }
      if (!darker || !lit) continue;
      const double least = std::min<double>(s.darkness * s.darkness, kOutlier * kOutlier);
      for (int k = 0; k < kDepths; ++k) {
        const double error = s.darkness - kDepthStep * k;
        more[k] += (std::min(error * error, kOutlier * kOutlier) - least) / seen.variance;
      }
    }
  }
  return 0.5 * *std::min_element(more.begin(), more.end()) / kCorrelated;
}

std::vector<Eigen::Vector3f> ShadowClue::candidates() const {
  std::vector<Eigen::Vector3f> all;
  for (const Seen& seen : seen_) {
    std::vector<Eigen::Vector3f> directions;
    for (const Eigen::Vector3f& centre : seen.centres) {
      for (const Sample& s : seen.samples) {
        if (s.darkness > kShadow) directions.push_back((centre - s.position).normalized());
      }
    }
    directions = thinned(directions, kCandidates);
    all.insert(all.end(), directions.begin(), directions.end());
  }
  return all;
}

}  // namespace calipso::render
