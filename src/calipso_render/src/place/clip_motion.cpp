#include "place/clip_motion.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "place/key_cover.hpp"
#include "place/place_depth.hpp"
#include "place/view_warp.hpp"

namespace calipso::render {
namespace {

constexpr double kStillOverlap = 0.93;  // masks of an object at rest overlap by more than this
constexpr int kSameCodes = 8;           // code values, mean over 3 x 3 pixels, that noise may make
// part of an object in which the picture changes by more if it sways
constexpr double kSwayed = 0.15;

// Part that two masks share of what either covers.
double overlap(const cv::Mat& a, const cv::Mat& b) {
  const int either = cv::countNonZero(a | b);
  return either > 0 ? static_cast<double>(cv::countNonZero(a & b)) / either : 1.0;
}

cv::Mat outlineAtRest(const Surface& surface, const Camera& camera) {
  return outlineOf(makeActor(surface, surface.key_vertices, camera), {camera.width, camera.height});
}

}  // namespace

bool cameraMoves(const ClipSample& clip) {
  const Camera& key = clip.frames().front().camera;
  return std::any_of(clip.frames().begin(), clip.frames().end(),
                     [&](const ClipFrame& f) { return !sameView(f.camera, key); });
}

std::vector<ClipFrame> inKeyView(std::vector<ClipFrame> frames, const cv::Mat& nearness,
                                 int margin) {
  const Camera key = frames.front().camera;
  const cv::Mat objects = grown(frames.front().labels != 0, margin);
  for (ClipFrame& f : frames) {
    if (sameView(f.camera, key)) continue;
    const cv::Mat map = viewWarp(nearness, f.camera, key);
    cv::Mat bgr, labels;
    cv::remap(f.bgr, bgr, map, cv::noArray(), cv::INTER_CUBIC, cv::BORDER_CONSTANT);
    cv::remap(f.labels, labels, map, cv::noArray(), cv::INTER_NEAREST, cv::BORDER_CONSTANT,
              cv::Scalar(255));
    labels.setTo(255, hiddenFrom(nearness, objects, key, f.camera));
    f.bgr = bgr, f.labels = labels, f.camera = key;
  }
  return frames;
}

bool movesInVideo(const std::vector<ClipFrame>& frames, const Surface& surface) {
  const Camera& camera = frames.front().camera;
  const cv::Mat key = frames.front().labels == surface.index;
  std::optional<double> fit;
  for (const ClipFrame& f : frames) {
    const cv::Mat now = f.labels == surface.index, open = now | (f.labels == 0);
    if (!sameView(f.camera, camera) && !fit) fit = overlap(key, outlineAtRest(surface, camera));
    const bool rests =
        sameView(f.camera, camera)
            ? overlap(now, key & open) >= kStillOverlap
            : overlap(now, outlineAtRest(surface, f.camera) & open) >= kStillOverlap * *fit;
    if (!rests) return true;
  }
  return false;
}

bool swaysInVideo(const std::vector<ClipFrame>& frames, int index) {
  const cv::Mat key = frames.front().labels == index;
  const cv::Rect box = cv::boundingRect(key);
  if (box.empty()) return false;
  cv::Mat key_picture, picture, same;
  cv::blur(frames.front().bgr(box), key_picture, {3, 3});
  for (const ClipFrame& f : frames) {
    const cv::Mat both = (f.labels(box) == index) & key(box);
    cv::blur(f.bgr(box), picture, {3, 3});
    cv::absdiff(picture, key_picture, picture);
    cv::inRange(picture, cv::Scalar(), cv::Scalar::all(kSameCodes), same);
    if (cv::countNonZero(both & ~same) > kSwayed * cv::countNonZero(both)) return true;
  }
  return false;
}

bool anyMoves(const ClipSample& clip, const std::vector<ObjectModel>& models) {
  return std::any_of(models.begin(), models.end(), [&](const ObjectModel& m) {
    return movesInVideo(clip.frames(), makeSurface(m));
  });
}

}  // namespace calipso::render
