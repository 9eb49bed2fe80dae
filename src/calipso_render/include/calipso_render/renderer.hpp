#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calipso_render/appearance.hpp"
#include "calipso_render/background.hpp"
#include "calipso_render/clip_sample.hpp"
#include "calipso_render/light_fit.hpp"
#include "calipso_render/noise.hpp"
#include "calipso_render/plane_mirror.hpp"
#include "calipso_render/relief.hpp"
#include "calipso_render/stage.hpp"
#include "calipso_render/unseen_shade.hpp"

namespace calipso::render {

enum class Quality { kLive, kFinal };

// What an edit changes of an object's look.
struct Look {
  std::optional<cv::Vec3f> tint;    // BGR, linear: times the reflectance
  std::optional<cv::Vec3f> albedo;  // BGR, linear: instead of it
  std::optional<float> specular, roughness;

  bool changes() const { return tint || albedo || specular || roughness; }
};

// What an edit changes of the sun, for what is drawn.
struct SunChange {
  std::optional<Eigen::Vector3f> direction;  // towards it, world
  float factor = 1.0f;                       // of its brightness
  bool changes() const { return direction || factor != 1.0f; }
};

// One object in one frame, as the simulator has it.
struct ObjectInFrame {
  std::string name;
  std::string source;  // a copy: the object whose model and look it has; empty: its own
  Look look;
  bool edited = false;  // false: as in the video, its pixels stay the original ones
  bool removed = false;
  Eigen::Isometry3d world_from_object = Eigen::Isometry3d::Identity();
  // world_from_object in the video, whatever became of it; none: not followed
  std::optional<Eigen::Isometry3d> observed;
  Points vertices;      // world, m, one per model vertex; only read where edited
  Triangles triangles;  // of an object that no model describes; empty: its model's
};

struct FrameInput {
  cv::Mat bgr;     // CV_8UC3
  cv::Mat labels;  // CV_8UC1; empty: the key frame's stand in
  Camera camera;
  std::int64_t stamp_ns = 0;
  std::vector<ObjectInFrame> objects;
  SunChange sun;
};

// Where a pixel of the output comes from (the `provenance` topic).
enum Provenance : std::uint8_t { kOriginal = 0, kSeenElsewhere = 1, kRendered = 2, kInvented = 3 };

struct FrameOutput {
  cv::Mat bgr;         // CV_8UC3; where provenance is 0, the input's bytes
  cv::Mat provenance;  // CV_8UC1
};

struct RenderParams {
  Quality quality = Quality::kLive;
  std::vector<SupportPlane> planes;
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
  BackgroundParams background;
  // What stands before edited objects, seen from the key frame's camera. Either may be empty.
  cv::Mat depth;  // CV_32FC1, m along the optical axis; 0: unknown
  cv::Mat matte;  // CV_8UC1, 255: stays in front
  // rad; the angular radius of the sun's disc with its glare, where no shadow's border tells it
  double sun_radius = 0.025;
  bool add_noise = true;       // on rendered and invented pixels
  bool carry_residual = true;  // what drawing misses goes along with what moves little
  bool keep_still = true;      // what an edit does not move keeps the frame's own pixels
};

// Everything learnt from the clip. Coordinates: the key frame's camera, the world.
struct Prepared {
  Camera camera;  // key frame
  std::int64_t key_stamp_ns = 0;
  bool camera_moves = false;  // in the clip
  cv::Mat key_picture;        // CV_8UC3
  cv::Mat key_labels;
  std::vector<Surface> surfaces;
  std::vector<bool> moves;  // per surface: it moves in the video
  // per surface: it does not, but what is seen within its outline changes: it hangs or bends
  std::vector<bool> sways;
  std::vector<Appearance> appearances;
  LightFit light;
  std::vector<cv::Mat> outlines;  // per surface, CV_8UC1: what its model covers at the key frame
  // per surface, CV_8UC1: places where something unmodelled stands before it
  std::vector<cv::Mat> fronts;
  // per surface, CV_8UC1: what it covers at the key frame; empty if it moves
  std::vector<cv::Mat> footprints;
  // CV_32FC1, 1/m: nearness of what is no object and may hide one; 0 unknown; may be empty
  cv::Mat scenery;
  // CV_8UC1: where objects cast no shadow: neither plane nor relief is seen there, or shows none in
  // the video
  cv::Mat shadowless;
  // CV_8UC1: lightLevel() of the sun below which no shade brings a place, as scenery stands before it
  // anyhow, or something that is not seen, or a wall turns away from it; may be empty
  cv::Mat sunless;
  UnseenShade unseen_shade;  // under the video's sun
  Relief relief;             // of the place, takes shadows; may be empty
  cv::Mat veil;      // CV_8UC1: part of what the place shows that haze adds, 255 all; may be empty
  cv::Mat nearness;  // CV_32FC1, 1/m: of the place without the objects, 0 infinitely far
  PlaneMirror mirror;
  Background background;
  cv::Mat plate_linear;  // CV_32FC3
  std::vector<PlateBeside> beside;
  // CV_8UC4: what the sun's absence leaves of the place's brightness, 255 all, of blue, green and red
  // and of luminance
  cv::Mat umbra;
  NoiseModel noise;
  float outline_blur = 0.0f;  // px: how much softer than a pixel the video's outlines are,
  float colour_blur = 0.0f;   // ... their colours beside their brightness
  int blank_frames = 0;       // of the clip, which nothing was learnt from
  int light_views = 1, texture_views = 1;  // frames that light and texture come from
  double background_ms = 0.0,
         appearance_ms = 0.0;        // wall time that plate, and light with appearances, took
  std::vector<std::string> remarks;  // what had to be assumed or invented, for a diagnostic
};

// Learns a clip.
// @throw std::invalid_argument if there is no frame, or a model's mesh cannot be drawn
Prepared prepare(const ClipSample& clip, const std::vector<ObjectModel>& models,
                 const RenderParams& params);

struct FrameCaches;
class ExposureMeter;

// Draws edited frames. Every frame's result depends on that frame alone. Not thread-safe: shadow
// maps of objects that rest, and the models of copies, are kept from frame to frame.
class Renderer {
 public:
  Renderer(std::shared_ptr<const Prepared> prepared, const RenderParams& params);
  ~Renderer();

  // @throw std::invalid_argument naming object or size that does not fit
  FrameOutput composite(const FrameInput& frame);

 private:
  void addNewcomers(const FrameInput& frame);
  // Composes it in the key frame's exposure.
  FrameOutput compositeAt(const cv::Vec3f& gain, const FrameInput& frame);

  std::shared_ptr<const Prepared> prepared_;
  RenderParams params_;
  std::unique_ptr<FrameCaches> caches_;
  std::unique_ptr<const ExposureMeter> meter_;
};

}  // namespace calipso::render
