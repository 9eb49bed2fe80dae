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
constexpr float kSamePlace = 1e-3f;     // of the distance: half a pixel or so
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

std::vector<ClipFrame> withOutlines(std::vector<ClipFrame> frames,
                                    const std::vector<Surface>& surfaces,
                                    const std::vector<bool>& moves) {
#pragma omp parallel for schedule(dynamic, 1)
  for (std::size_t k = 0; k < frames.size(); ++k) {
    cv::Mat labels = frames[k].labels.clone();
    for (std::size_t i = 0; i < surfaces.size(); ++i) {
      if (!moves[i])
        labels.setTo(surfaces[i].index,
                     outlineAtRest(surfaces[i], frames[k].camera) & (labels == 0));
    }
    frames[k].labels = labels;
  }
  return frames;
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

namespace {

// Whether every frame of a moving camera has a pose of the object, and all are the key frame's.
bool restsByPoses(const std::vector<ClipFrame>& frames, const Surface& surface) {
  const Eigen::Vector3f eye = frames.front().camera.world_from_camera.translation().cast<float>();
  bool camera_moves = false;
  for (const ClipFrame& f : frames) {
    camera_moves |= !sameView(f.camera, frames.front().camera);
    const auto pose = std::find_if(f.poses.begin(), f.poses.end(),
                                   [&](const ObjectPose& p) { return p.index == surface.index; });
    if (pose == f.poses.end()) return false;
    const Points now = transformed(surface.object_vertices, pose->world_from_object);
    for (std::size_t i = 0; i < now.size(); ++i) {
      if ((now[i] - surface.key_vertices[i]).norm() > kSamePlace * (now[i] - eye).norm())
        return false;
    }
  }
  return camera_moves;
}

bool movesByMasks(const std::vector<ClipFrame>& frames, const Surface& surface) {
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

}  // namespace

bool movesInVideo(const std::vector<ClipFrame>& frames, const Surface& surface) {
  return movesByMasks(frames, surface) && !restsByPoses(frames, surface);
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
