#pragma once

// A ball over the table, prepared from its key frame, and inputs that move it.

#include <memory>

#include "calipso_render/renderer.hpp"
#include "render_test_scene.hpp"

namespace calipso::render::testing {

const Eigen::Vector3d kCentre(0.0, 0.1, 0.12);

inline RenderParams params() {
  RenderParams p;
  p.planes = table();
  p.add_noise = false;
  return p;
}

struct Setting {
  ClipFrame key = frameWithBall(ballAt(kCentre));
  std::shared_ptr<const Prepared> prepared;

  explicit Setting(const RenderParams& p) {
    ClipSample clip;
    clip.add(key);
    prepared = std::make_shared<const Prepared>(prepare(clip, {ballAt(kCentre)}, p));
  }
  FrameInput input(bool edited, const Eigen::Vector3f& move) const {
    FrameInput in;
    in.bgr = key.bgr, in.labels = key.labels, in.camera = key.camera, in.stamp_ns = 7;
    ObjectInFrame ball;
    ball.name = "ball", ball.edited = edited;
    ball.vertices = prepared->surfaces[0].key_vertices;
    for (Eigen::Vector3f& x : ball.vertices) x += move;
    in.objects = {ball};
    return in;
  }
};

// The key frame with its ball edited to lie 30 cm further left.
inline FrameInput ballMovedLeft(const ClipFrame& key, const Prepared& prepared) {
  FrameInput in;
  in.bgr = key.bgr, in.labels = key.labels, in.camera = key.camera;
  ObjectInFrame moved;
  moved.name = "ball", moved.edited = true, moved.vertices = prepared.surfaces[0].key_vertices;
  for (Eigen::Vector3f& x : moved.vertices) x.x() -= 0.3f;
  in.objects = {moved};
  return in;
}

}  // namespace calipso::render::testing
