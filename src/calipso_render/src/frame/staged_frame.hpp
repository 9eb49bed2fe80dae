#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "calipso_render/renderer.hpp"
#include "calipso_render/visibility.hpp"

namespace calipso::render {

inline constexpr float kStillPx = 0.05f;  // moved less: the frame's own pixels
inline constexpr float kMovedPx = 0.3f;   // an edited surface that moved more is drawn
// the same of how far its normal has turned, rad: it is lit otherwise
inline constexpr float kStillTurn = 0.02f, kTurned = 0.08f;
inline constexpr float kNonePx = 5.0f;  // from which none of what drawing misses goes along

// An object that a frame's picture can show. Its place in StagedFrame::objects is the slot by which
// VisibilityBuffer::objectOf() names it.
struct StagedObject {
  Actor actor;  // where it is now
  int surface;  // of Prepared::surfaces
  bool edited;
  Look look;
  Gloss gloss;          // as its look has it
  ScreenMesh observed;  // where the video has it; of edited objects at rest only

  bool isAtRestInVideo() const { return !observed.points.empty(); }
  cv::Vec3f tint() const { return look.tint.value_or(cv::Vec3f(1, 1, 1)); }
  Occluder occluder() const {
    return {&actor.vertices, &actor.surface->triangles, actor.surface->winding};
  }
};

// One frame as its state has it: who is where, and what of it the video shows where the key frame
// does.
struct StagedFrame {
  // @throw std::invalid_argument naming object or size that does not fit
  StagedFrame(const Prepared& prepared, const RenderParams& params, const FrameInput& input);

  const Prepared& prepared;
  const RenderParams& params;
  const FrameInput& input;
  Light light;          // of this frame; what the video shows was lit by Prepared::light
  cv::Mat labels;       // CV_8UC1, of this frame's view
  bool at_key_camera;   // it is taken from where the key frame is
  Eigen::Vector3f eye;  // world
  std::vector<const ObjectInFrame*> states;  // per surface; nullptr: as in the video, at rest
  std::vector<bool> edited;                  // per surface
  // per surface: the video has it, or a part of it, where the key frame has it
  std::vector<bool> at_rest;
  cv::Mat elsewhere;  // CV_8UC1, whole picture: where it does not; may be empty
  std::vector<StagedObject> objects;
  std::vector<bool> moved;  // per surface: edited, and not where the video has it
  // per surface: where the video has one that is edited and moves in it, if its state says so and
  // it is seen there; world, m
  std::vector<std::optional<Points>> observed;
  // per surface: edited, but where the video has it as it moves, and the sun, as looks alone are
  // edited: its shade is the video's
  std::vector<bool> follows;

  cv::Rect whole() const { return {{0, 0}, input.bgr.size()}; }
  const StagedObject& objectOf(std::uint32_t id) const {
    return objects[VisibilityBuffer::objectOf(id)];
  }
  bool isElsewhere(int u, int v) const {
    return !elsewhere.empty() && elsewhere.at<std::uint8_t>(v, u) != 0;
  }
  // Whether the video shows an object where its vertices, in world coordinates, say: most of what
  // is seen of it lies within its outline there.
  bool isSeenAt(int surface, const Points& vertices) const;
  // Whether any edited object moves in the video.
  bool movesInVideo() const;
  bool hasSunOfVideo() const { return light.direction == prepared.light.light.direction; }
  // Whether an object is edited, and its shade, and what its mask misses, no longer the video's.
  bool casts(std::size_t surface) const { return edited[surface] && !follows[surface]; }

  // How far from its place in the video a surface point is seen, px. @pre the video has its object
  // at rest
  Eigen::Vector2f movement(std::uint32_t id, float u, float v) const;
  // How far a surface point of an edited object stays where, and turned as, the video shows it: 1 at
  // rest, 0 moved.
  float stillness(std::uint32_t id, float u, float v) const;
};

// Has the triangle a point that moved less than `px` in the picture? The box around its corners'
// movements tells.
bool mayMoveLess(const Points& now, const Points& then, const Eigen::Vector3i& triangle, float px);

}  // namespace calipso::render
