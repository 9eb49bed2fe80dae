#include "place/place_depth.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

#include "calipso_render/inpaint.hpp"
#include "calipso_render/stage.hpp"

namespace calipso::render {
namespace {

constexpr int kDepths = 24;      // tried behind an object
constexpr int kFewestViews = 3;  // that must look behind it
constexpr int kAround = 15;      // px of the square whose spread is compared
constexpr float kNoSpread = 1e9f;
// times the spread at another depth, and code values over it, that a support plane's may have
constexpr float kAsWell = 1.3f, kNoise = 0.5f;
constexpr float kOffPlane = 0.02f;     // part by which what is on a plane is nearer or farther
constexpr float kBefore = 1.1f;        // times that what hides a place is nearer than it,
constexpr float kLeastBefore = 1e-4f;  // 1/m

}  // namespace

bool isBefore(float thing, float place) { return thing > kBefore * place + kLeastBefore; }

cv::Mat ofNearest(const cv::Mat& values, const cv::Mat& where) {
  cv::Mat away, nearest, out(values.size(), CV_32F);
  cv::distanceTransform(where == 0, away, nearest, cv::DIST_L2, 5, cv::DIST_LABEL_PIXEL);
  std::vector<float> by_label(where.total() + 1, 0.0f);
  for (int v = 0; v < where.rows; ++v) {
    for (int u = 0; u < where.cols; ++u) {
      if (where.at<std::uint8_t>(v, u) != 0)
        by_label[nearest.at<int>(v, u)] = values.at<float>(v, u);
    }
  }
  for (int v = 0; v < out.rows; ++v) {
    for (int u = 0; u < out.cols; ++u) out.at<float>(v, u) = by_label[nearest.at<int>(v, u)];
  }
  return out;
}

namespace {

cv::Mat grown(const cv::Mat& mask, int radius) {
  cv::Mat out;
  cv::dilate(mask, out,
             cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * radius + 1, 2 * radius + 1}));
  return out;
}

float planeNearness(const std::vector<SupportPlane>& planes, const Camera& camera,
                    const Eigen::Isometry3d& from_world, int u, int v) {
  const auto receiver = receiverAt(planes, camera, static_cast<float>(u), static_cast<float>(v));
  return receiver ? static_cast<float>(1.0 / (from_world * receiver->position.cast<double>()).z())
                  : 0.0f;
}

// One frame, with the way from the key frame's pixels into it.
struct Sight {
  cv::Mat grey, covered;
  Eigen::Matrix3f turn;
  Eigen::Vector3f shift;
  float fx, fy, cx, cy;

  Sight(const ClipFrame& f, const Camera& key, int margin) : covered(grown(f.labels != 0, margin)) {
    cv::cvtColor(f.bgr, grey, cv::COLOR_BGR2GRAY);
    const Eigen::Isometry3f way =
        (f.camera.world_from_camera.inverse() * key.world_from_camera).cast<float>();
    turn = way.linear(), shift = way.translation();
    fx = static_cast<float>(f.camera.fx), fy = static_cast<float>(f.camera.fy),
    cx = static_cast<float>(f.camera.cx), cy = static_cast<float>(f.camera.cy);
  }

  // @return -1 where the frame does not show it
  int at(const Eigen::Vector3f& ray, float nearness) const {
    const Eigen::Vector3f p = turn * ray + nearness * shift;
    if (p.z() < 1e-6f) return -1;
    const int u = cvRound(fx * p.x() / p.z() + cx), v = cvRound(fy * p.y() / p.z() + cy);
    if (u < 0 || v < 0 || u >= grey.cols || v >= grey.rows || covered.at<std::uint8_t>(v, u) != 0)
      return -1;
    return grey.at<std::uint8_t>(v, u);
  }
};

// Mean deviation from the median of what the frames show there.
float spreadAt(const std::vector<Sight>& sights, const Eigen::Vector3f& ray, float nearness,
               std::vector<int>& values) {
  values.clear();
  for (const Sight& s : sights) {
    const int value = s.at(ray, nearness);
    if (value >= 0) values.push_back(value);
  }
  if (values.size() < kFewestViews) return kNoSpread;
  const std::size_t middle = values.size() / 2;
  std::nth_element(values.begin(), values.begin() + middle, values.end());
  const int median = values[middle];
  float sum = 0.0f;
  for (const int value : values) sum += static_cast<float>(std::abs(value - median));
  return sum / static_cast<float>(values.size());
}

// Depths of what is seen around, evenly spaced among its pixels, and infinity.
std::vector<float> depthsAround(const cv::Mat& nearness, const cv::Mat& hidden) {
  const cv::Rect box = cv::boundingRect(hidden),
                 around = cv::Rect(box.x - box.width / 2, box.y - box.height / 2, 2 * box.width,
                                   2 * box.height) &
                          cv::Rect({0, 0}, hidden.size());
  std::vector<float> seen, depths = {0.0f};
  for (int v = around.y; v < around.br().y; ++v) {
    for (int u = around.x; u < around.br().x; ++u) {
      const float near = nearness.at<float>(v, u);
      if (hidden.at<std::uint8_t>(v, u) == 0 && near > 0.0f) seen.push_back(near);
    }
  }
  std::sort(seen.begin(), seen.end());
  for (int i = 0; i < kDepths && !seen.empty(); ++i)
    depths.push_back(seen[(2 * i + 1) * seen.size() / (2 * kDepths)]);
  return depths;
}

// How much frames differ in what they show at the hidden pixels, if these are as near as `nearness`
// says there: mean over the square around, of pixels that enough frames show; kNoSpread at others.
cv::Mat spreadOf(const std::vector<Sight>& sights, const Camera& key, const cv::Mat& hidden,
                 const cv::Rect& box, const cv::Mat& nearness) {
  cv::Mat spread(box.size(), CV_32F, cv::Scalar(0.0f)), counted = spread.clone(), total;
#pragma omp parallel for schedule(dynamic, 4)
  for (int v = 0; v < box.height; ++v) {
    std::vector<int> values;
    for (int u = 0; u < box.width; ++u) {
      if (hidden.at<std::uint8_t>(v + box.y, u + box.x) == 0) continue;
      const float s = spreadAt(sights, key.ray(u + box.x, v + box.y).cast<float>(),
                               nearness.at<float>(v, u), values);
      if (s < kNoSpread) spread.at<float>(v, u) = s, counted.at<float>(v, u) = 1.0f;
    }
  }
  const cv::Mat unseen = counted == 0.0f;
  cv::blur(spread, spread, {kAround, kAround});
  cv::blur(counted, total, {kAround, kAround});
  spread /= total;
  spread.setTo(kNoSpread, unseen);
  return spread;
}

// Where a surface goes on behind the objects: frames that show it agree about as well as at any
// other depth. What no frame shows of it is as the nearest pixel of which they tell: there other
// depths have no rival, however wrong.
// @param least, there CV_32FC1: spread at the best other depth, and at the surface's
cv::Mat goesOn(const cv::Mat& least, const cv::Mat& there) {
  const cv::Mat told = there < kNoSpread;
  if (cv::countNonZero(told) == 0) return cv::Mat::zeros(there.size(), CV_8U);
  cv::Mat agrees;
  cv::Mat(there <= kAsWell * least + kNoise).convertTo(agrees, CV_32F);
  return ofNearest(agrees, told) > 0.0f;
}

// How near the objects are, by the depth image: that of their nearest pixel of which it tells; empty
// if it tells of none.
cv::Mat objectsNearness(const cv::Mat& labels, const cv::Mat& depth) {
  const cv::Mat told = (labels != 0) & (depth > 0.0f);
  if (cv::countNonZero(told) == 0) return {};
  return ofNearest(1.0f / depth, told);
}

// What is behind the objects, of several depths.
struct Hidden {
  cv::Mat where;   // CV_8UC1, the picture's size
  cv::Mat limit;   // CV_32FC1: it is no nearer; may be empty
  cv::Mat ground;  // CV_32FC1: nearness of the support planes, 0 where none is
};

// What lies beside the objects, as far away as they or farther, goes on behind them: the support
// plane, or as near as the nearest such pixel.
cv::Mat continued(const cv::Mat& nearness, const Hidden& hidden) {
  cv::Mat beside = hidden.where == 0, on_plane;
  if (!hidden.limit.empty()) beside &= nearness <= hidden.limit;
  if (cv::countNonZero(beside) == 0) return nearness.clone();
  cv::Mat out = ofNearest(nearness, beside);
  const cv::Mat off_plane = cv::abs(nearness - hidden.ground) > kOffPlane * hidden.ground;
  cv::Mat(off_plane == 0).convertTo(on_plane, CV_32F);
  hidden.ground.copyTo(out, (ofNearest(on_plane, beside) > 0.0f) & (hidden.ground > 0.0f));
  return out;
}

// What is beside the objects, else a support plane, is taken for what goes on behind them unless
// another depth explains the frames better: in what moves by itself (waves), or has no texture, all
// explain them about as well.
void sweep(const std::vector<ClipFrame>& frames, const Hidden& hidden, int margin,
           cv::Mat& nearness) {
  const cv::Rect box = cv::boundingRect(hidden.where);
  const Camera& key = frames.front().camera;
  std::vector<Sight> sights;
  for (const ClipFrame& f : frames) sights.emplace_back(f, key, margin);
  const auto spreadAtDepths = [&](const cv::Mat& depths) {
    cv::Mat spread = spreadOf(sights, key, hidden.where, box, depths);
    if (!hidden.limit.empty()) spread.setTo(kNoSpread, depths > hidden.limit(box));
    return spread;
  };
  cv::Mat least(box.size(), CV_32F, cv::Scalar(kNoSpread)),
      best = continued(nearness, hidden)(box).clone();
  const cv::Mat beside = best.clone(), plane = hidden.ground(box);
  for (const float depth : depthsAround(nearness, hidden.where)) {
    const cv::Mat all(box.size(), CV_32F, cv::Scalar(depth));
    const cv::Mat spread = spreadAtDepths(all), better = spread < least;
    spread.copyTo(least, better), all.copyTo(best, better);
  }
  plane.copyTo(best, goesOn(least, spreadAtDepths(plane)) & (plane > 0.0f));
  beside.copyTo(best, goesOn(least, spreadAtDepths(beside)));
  best.copyTo(nearness(box), hidden.where(box));
}

// The key frame's pixels as another camera sees them.
class OtherView {
 public:
  OtherView(const Camera& key, const Camera& to)
      : key_(key),
        to_(to),
        way_((to.world_from_camera.inverse() * key.world_from_camera).cast<float>()) {}

  // Where pixel (u, v) of the key frame is seen, px, and its depth over that in the key frame;
  // nothing behind the camera.
  // @param near 1/m
  std::optional<Eigen::Vector3f> placeOf(int u, int v, float near) const {
    const Eigen::Vector3f p =
        way_.linear() * key_.ray(u, v).cast<float>() + near * way_.translation();
    if (p.z() < 1e-6f) return std::nullopt;
    return Eigen::Vector3f(to_.fx * p.x() / p.z() + to_.cx, to_.fy * p.y() / p.z() + to_.cy, p.z());
  }

 private:
  const Camera &key_, &to_;
  Eigen::Isometry3f way_;
};

// What is nearest at every pixel of another camera, of the key frame's pixels drawn as squares of
// two, so that a place that grows has no gaps; -1 where none falls.
cv::Mat nearestFrom(const cv::Mat& nearness, const Camera& key, const Camera& to) {
  const OtherView view(key, to);
  cv::Mat out(to.height, to.width, CV_32F, cv::Scalar(-1.0f));
  for (int v = 0; v < nearness.rows; ++v) {
    for (int u = 0; u < nearness.cols; ++u) {
      const float near = nearness.at<float>(v, u);
      const auto place = view.placeOf(u, v, near);
      if (!place) continue;
      const int x = cvFloor(place->x()), y = cvFloor(place->y());
      for (int j = std::max(0, y); j <= std::min(to.height - 1, y + 1); ++j) {
        for (int i = std::max(0, x); i <= std::min(to.width - 1, x + 1); ++i)
          out.at<float>(j, i) = std::max(out.at<float>(j, i), near / place->z());
      }
    }
  }
  return out;
}

}  // namespace

cv::Mat placeNearness(const std::vector<ClipFrame>& frames, const std::vector<SupportPlane>& planes,
                      const cv::Mat& depth, int margin) {
  const ClipFrame& key = frames.front();
  const Eigen::Isometry3d from_world = key.camera.world_from_camera.inverse();
  cv::Mat ground(key.bgr.size(), CV_32F), nearness(key.bgr.size(), CV_32F);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < nearness.rows; ++v) {
    for (int u = 0; u < nearness.cols; ++u) {
      const float d = depth.empty() ? 0.0f : depth.at<float>(v, u);
      ground.at<float>(v, u) = planeNearness(planes, key.camera, from_world, u, v);
      nearness.at<float>(v, u) = d > 0.0f ? 1.0f / d : ground.at<float>(v, u);
    }
  }
  Hidden hidden{grown(key.labels != 0, margin), {}, ground};
  if (depth.empty() || cv::countNonZero(hidden.where) == 0) return nearness;
  const cv::Mat objects = objectsNearness(key.labels, depth);
  if (!objects.empty()) {
    hidden.limit = kBefore * objects;
    hidden.where.setTo(0, (key.labels == 0) & (nearness > hidden.limit));  // stands before them
  }
  sweep(frames, hidden, margin, nearness);
  return nearness;
}

namespace {

// The pixels around one that lie within the picture.
template <typename Act>
void forEachBeside(const cv::Mat& picture, const cv::Point& p, const Act& act) {
  for (int v = std::max(0, p.y - 1); v <= std::min(picture.rows - 1, p.y + 1); ++v) {
    for (int u = std::max(0, p.x - 1); u <= std::min(picture.cols - 1, p.x + 1); ++u)
      act(cv::Point(u, v));
  }
}

// Of the pixels around one those that are known: the least nearness.
float farthestBeside(const cv::Mat& nearness, const cv::Point& p) {
  float least = std::numeric_limits<float>::max();
  forEachBeside(nearness, p, [&](const cv::Point& q) {
    const float near = nearness.at<float>(q);
    if (near >= 0.0f) least = std::min(least, near);
  });
  return least;
}

// Unknown pixels (< 0) beside known ones.
std::vector<cv::Point> besideKnown(const cv::Mat& nearness) {
  cv::Mat beside;
  cv::dilate(nearness >= 0.0f, beside, cv::Mat::ones(3, 3, CV_8U));
  std::vector<cv::Point> pixels;
  cv::findNonZero(beside & (nearness < 0.0f), pixels);
  return pixels;
}

// Unknown pixels beside those of a ring, each once.
std::vector<cv::Point> unknownBeside(const cv::Mat& nearness, const std::vector<cv::Point>& ring) {
  std::vector<cv::Point> pixels;
  for (const cv::Point& p : ring) {
    forEachBeside(nearness, p, [&](const cv::Point& q) {
      if (nearness.at<float>(q) < 0.0f) pixels.push_back(q);
    });
  }
  const auto before = [](const cv::Point& a, const cv::Point& b) {
    return a.y != b.y ? a.y < b.y : a.x < b.x;
  };
  std::sort(pixels.begin(), pixels.end(), before);
  pixels.erase(std::unique(pixels.begin(), pixels.end()), pixels.end());
  return pixels;
}

}  // namespace

cv::Mat nearnessFrom(const cv::Mat& nearness, const Camera& key, const Camera& to) {
  cv::Mat out = nearestFrom(nearness, key, to);
  std::vector<cv::Point> ring = besideKnown(out);
  if (ring.empty() && out.at<float>(0, 0) < 0.0f) out.setTo(0.0f);  // nothing is known
  while (!ring.empty()) {
    std::vector<float> farthest;
    for (const cv::Point& p : ring) farthest.push_back(farthestBeside(out, p));
    for (std::size_t i = 0; i < ring.size(); ++i) out.at<float>(ring[i]) = farthest[i];
    ring = unknownBeside(out, ring);
  }
  return out;
}

cv::Mat hiddenFrom(const cv::Mat& nearness, const cv::Mat& guessed, const Camera& key,
                   const Camera& to) {
  const OtherView view(key, to);
  cv::Mat surely = nearness.clone();
  surely.setTo(0.0f, guessed);
  const cv::Mat nearest = nearestFrom(surely, key, to);
  cv::Mat hidden = cv::Mat::zeros(nearness.size(), CV_8U);
  for (int v = 0; v < nearness.rows; ++v) {
    for (int u = 0; u < nearness.cols; ++u) {
      const float near = nearness.at<float>(v, u);
      const auto place = view.placeOf(u, v, near);
      if (!place) continue;
      const int x = cvRound(place->x()), y = cvRound(place->y());
      if (x < 0 || y < 0 || x >= to.width || y >= to.height) continue;
      if (isBefore(nearest.at<float>(y, x), near / place->z())) hidden.at<std::uint8_t>(v, u) = 255;
    }
  }
  return hidden;
}

}  // namespace calipso::render
