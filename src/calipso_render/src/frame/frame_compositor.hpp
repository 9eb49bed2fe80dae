#pragma once

#include <algorithm>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

#include "calipso_render/colour.hpp"
#include "calipso_render/renderer.hpp"
#include "calipso_render/visibility.hpp"
#include "draw/light_batch.hpp"
#include "draw/triangle_map.hpp"
#include "frame/frame_caches.hpp"
#include "frame/line_codec.hpp"
#include "frame/seen_place.hpp"
#include "frame/square_mask.hpp"
#include "frame/staged_frame.hpp"
#include "smooth_step.hpp"

namespace calipso::render {

// px between the places where the sun on a smooth surface is looked up
constexpr int kLightStep = 4;
constexpr float kSameShadow = 1.0f / 64;  // of visibility: no visible change
constexpr int kSameLevels = 4;            // the same of a lightLevel()
// levels of the sky, a fifth: so much more or less of it only brightens or darkens a pixel
constexpr std::uint8_t kSoftSky = 51;
constexpr float kPerLevel = 1.0f / 255.0f;
// of a support plane's light before an edit: darker, its own pixels do not tell what it would be in
// more light
constexpr float kDarkest = 0.05f;
// px around a surface of a new look in which the frame has its old colour, too
constexpr int kRepaintReach = 2;
constexpr float kBrightest = 1.25f;  // times its light before, to which its own pixels still tell
constexpr std::uint8_t kChanged = 255;  // of FrameCompositor::remirrored_

inline cv::Mat disc(int radius) {
  return cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * radius + 1, 2 * radius + 1});
}

// How much a change of brightness by `by` calls for the plate: 0 not visible .. 255 only it.
inline std::uint8_t changeOfLight(float by) {
  constexpr float kSameRatio = 0.01f,
                  kPlateRatio = 0.06f;  // from which the plate is taken, and only it
  const float t = std::clamp((by - kSameRatio) * (1.0f / (kPlateRatio - kSameRatio)), 0.0f, 1.0f);
  return static_cast<std::uint8_t>(static_cast<int>(255.0f * (t * t * (3.0f - 2.0f * t)) + 0.5f));
}

inline cv::Vec3f linearPixel(const cv::Mat& bgr, int u, int v) {
  const cv::Vec3b& c = bgr.at<cv::Vec3b>(v, u);
  const float* decoded = decodeTable();
  return {decoded[c[0]], decoded[c[1]], decoded[c[2]]};
}

// One frame on its way: stages the objects, finds what an edit can change, and composes those
// pixels.
class FrameCompositor {
 public:
  FrameCompositor(const Prepared& prepared, const RenderParams& params, const FrameInput& frame,
                  ShadowCache& shadows, RestPicture& rest);

  FrameOutput run();

 private:
  // What lies behind the drawn objects at a pixel.
  struct Behind {
    cv::Vec3f colour;    // linear
    float fresh = 0.0f;  // part of it that carries no camera noise yet
    Provenance source = kOriginal;
  };
  // What a drawn surface adds to a pixel.
  struct Drawn {
    cv::Vec3f colour;
    float cover = 0.0f;
  };

  // The sun where a grid's line meet on a drawn surface.
  struct SunCorner {
    float sun = 0.0f, nearness = 0.0f;  // visible part; 1/m
    int slot = -1;                      // -1: nothing is drawn here
  };

  // Corners of one row that see one object.
  struct CornerRun {
    int slot, count;
    std::uint32_t ids[SurfaceRun::kRoom];
    int corners[SurfaceRun::kMost];  // columns of the grid
    SurfaceRun run;
  };

  // What has to be done for a pixel: nothing; one drawn surface, the same where it ends or folds;
  // what lies behind, in other light; more than one surface.
  enum Kind : std::uint8_t { kNone = 0, kPlain = 1, kBehind = 2, kPlainEdge = 4, kSpecial = 8 };
  static bool isPlain(Kind kind) { return kind == kPlain || kind == kPlainEdge; }

  // A sheet of a surface in a pixel that sees several, or sees one end.
  struct Sheet {
    SurfacePlace place;
    int column;  // of region_
    float part;  // of the pixel
  };

  // A row of the result over region_, on its way.
  struct Row {
    // Linear B, G, R; the part that carries no camera noise yet. Up to seven more than the row has.
    std::vector<float> colour[4];
    std::vector<std::uint8_t> source;  // Provenance
    std::vector<Kind> kinds;
    std::vector<Drawn> drawn;   // of pixels that need more than their centre
    std::vector<Sheet> sheets;  // of those, in the order of their columns
    SurfaceRun run;

    void resize(std::size_t width) {
      for (auto& channel : colour) channel.resize(width + 7);
      source.resize(width), kinds.resize(width), drawn.resize(width);
    }
    cv::Vec4f at(int i) const { return {colour[0][i], colour[1][i], colour[2][i], colour[3][i]}; }
    void set(int i, const cv::Vec4f& c) {
      for (int k = 0; k < 4; ++k) colour[k][i] = c[k];
    }
  };

  // What drawing misses beyond the silhouette, where a surface's rim has come to.
  struct Rim {
    int u, v;
    cv::Point nearest;  // drawn pixel
  };

  // A pixel of the result.
  struct Composed {
    cv::Vec3f colour;    // linear
    float fresh = 0.0f;  // part of it that carries no camera noise yet
    Provenance source = kOriginal;
  };

  void prepareFrame();
  void findResidual();
  cv::Rect carriedBox() const;
  void findMiss(const cv::Rect& carried);
  void findRims(const cv::Rect& carried);
  void addResidual(float u, float v, const Eigen::Vector2f& moved, int owner, const cv::Vec3f& tint,
                   cv::Vec4f& colour) const;
  void addRimResidual(int v, Row& row) const;
  cv::Vec4f missAt(float u, float v, int owner) const;
  static RestPicture restPicture(const Prepared& prepared, const RenderParams& params,
                                 const std::vector<bool>& edited);

  // Outlines as soft as the video's (frame_outline.cpp)
  float lacksSoftness(std::uint32_t id, int u, int v) const;
  cv::Mat findOutlines(int reach) const;
  void softenOutlines(FrameOutput& out) const;
  void recordRow(int v, Row& row, RestPicture& picture) const;
  void recordOwners(RestPicture& picture) const;
  Composed composedOf(const Drawn& drawn, int u, int v) const;
  void prepareShadows();
  void cacheOriginals(const std::vector<Occluder>& originals);
  void cacheOthers(const std::vector<Occluder>& others);
  cv::Mat sunOver(const Visibility& shadow, const cv::Rect& bounds, SquareMask* shaded) const;
  SkyGrid skyOver(const Visibility& shadow, const cv::Rect& region, const SquareMask& skip) const;
  cv::Mat skyLevels(const SkyGrid& grid, const Visibility& shadow) const;
  void leaveHidden(int v, int begin, int end, std::uint8_t* sky) const;
  void cacheShaded();
  void cacheBefore();
  void joinBefore(int v);
  void chooseRegion();
  void findShown(int v, const cv::Rect& box, std::uint8_t* own, std::uint8_t* others) const;
  void findOwn(const cv::Rect& box);
  void findRemoved();
  cv::Mat quietPlaces() const;
  PlateInView plateInView() const;
  void findPassingShadows();
  void drawVisibility();
  void sampleEdges();
  void findStill();
  bool findResting(int slot, std::vector<char>& can_rest) const;
  void keepRims(const cv::Mat& owner);
  void addRim(int surface, const cv::Mat& owner, cv::Mat& rims) const;
  cv::Mat nearerToLeft(int surface, const cv::Mat& own, const cv::Mat& owner,
                       const cv::Rect& box) const;
  void findCovered();
  void findSurfaceSun();
  void lightCorners(int j, int first, const std::vector<std::uint8_t>& large);
  void lookUp(int v, CornerRun& wanted, SunCorner* corners) const;
  bool isSmoothAround(int i, int j, const std::vector<std::uint8_t>& large) const;
  std::optional<float> sunBetween(float u, float v, float nearness, int slot) const;
  std::size_t cornerAt(int i, int j) const {
    return static_cast<std::size_t>(j) * sun_columns_ + i;
  }
  void shadeSetup();
  void measureLight();
  void findSkyChanges(const SkyGrid& now, SquareMask& changes);
  void measureRun(const SkyGrid& sky_grid, int v, int begin, int end);
  void takeReliefInPlaneTerms(int v, int begin, int end, std::uint8_t* sun,
                              std::uint8_t* sky) const;
  float darkeningAt(int u, int v, std::uint8_t sun, std::uint8_t sky) const;
  void findRelit();
  void findChange(int v, int from, int to, std::uint8_t* out) const;
  void findMaps();
  void findShaded();
  void findScreened();
  float screenAt(int u, int v) const {
    return screened_.empty() ? 0.0f
                             : screened_.at<std::uint8_t>(v - region_.y, u - region_.x) / 255.0f;
  }
  std::optional<SurfacePoint> otherAt(int u, int v) const;
  void shadeOther(int u, int v, Behind& behind) const;
  cv::Mat originalOf(int surface) const;
  void composeRow(int v, Row& row, FrameOutput& out) const;
  void drawRow(int v, Row& row) const;
  void findKinds(int v, Row& row) const;
  void findBehind(int j, int begin, int end, Kind* kinds) const;
  void reflectStretch(unsigned traits, int v, int first, int last, int slot, Row& row) const;
  void addTexture(int v, int first, int last, int slot, Row& row) const;
  void sunOnStretch(int v, int first, int last, int slot, Row& row) const;
  void drawStretch(int v, int first, int last, int slot, Row& row) const;
  void carryResidual(int v, int first, int last, int slot, Row& row) const;
  void findSheets(int v, Row& row) const;
  void addSheets(int u, int v, std::vector<Sheet>& sheets) const;
  void shadeSheets(int v, Row& row) const;
  void shadePlaces(const SurfacePlace* places, int count, int slot, SurfaceRun& run) const;
  void composeBehind(int v, int first, int last, Row& row) const;
  void composeRelit(int v, int first, int last, Row& row) const;
  void composeSpecial(int u, int v, Row& row) const;
  void keepStill(int v, Row& row) const;
  Behind behindAt(int u, int v) const;
  Behind groundAt(int u, int v, bool removed) const;
  Behind shadowedAt(int u, int v, bool removed) const;
  void findMirrored();
  void mirrorAnew();
  cv::Vec3f unmirroredAt(int u, int v) const;
  void addMirrored(int u, int v, Behind& behind) const;
  float coverOfOthers(int u, int v) const;
  Behind revealedAt(int u, int v) const;
  bool isDrawn(std::uint32_t id, int u, int v) const;
  void sunOn(const LightBatch& points, float* sun) const;
  void sunOnPlaces(const int* places, int count, const float* nearness, SurfaceRun& run) const;
  bool isSmooth(int i, int j, int size) const;
  // Part of its brightness that a support plane keeps when it sees these parts of sun and sky.
  cv::Vec3f shadowRatio(float sun, float sky) const;
  void addReliefBounds(const Points& vertices, const Eigen::Vector3f& sun, Points& shadow) const;
  void addPlaneBounds(const SupportPlane& plane, const Points& vertices, const Eigen::Vector3f& sun,
                      Points& shadow) const;
  cv::Rect shadowBounds(const Points& vertices, const Light& light) const;

  const StagedFrame frame_;
  const SeenPlace place_;
  ShadowCache& shadows_;
  RestPicture& rest_;

  LiveFill::Corrections live_corrections_;
  std::unique_ptr<Visibility> moved_shadow_;  // of the edited objects where they are now
  std::unique_ptr<Visibility> moved_sky_;
  cv::Rect region_,
      moved_bounds_;  // what an edit can change; what the edited objects can shade now
  // CV_32FC3, whole picture: what support planes mirror now; empty: as in the video
  cv::Mat mirrored_;
  // CV_8UC3: the frame without what they mirrored of objects at rest, where what comes to light is
  // found by it
  cv::Mat unmirrored_;
  // CV_8UC1, whole picture: 255 = it differs from what the video has, 1 = it does not; 0 = there is
  // nothing
  cv::Mat remirrored_;
  // CV_8UC1, whole picture: shaded now by an edited object that moves in the video
  cv::Mat passing_;
  cv::Rect shown_box_;  // of region_: what shows edited objects in the video, with a margin
  cv::Rect drawn_box_;  // of region_: all that is drawn, with a margin
  cv::Mat removed_;     // CV_8UC1 over region_: pixels of edited objects in the video
  cv::Mat drawn_;       // CV_8UC1 over region_: 255 = isDrawn() at the pixel's centre
  // over region_: so deep behind drawn surfaces that light there does not matter
  SquareMask covered_;
  SquareMask sun_changes_;  // squares in which the light may change by more than a pixel can follow
  // ... and those beyond which neither light changes nor anything comes to light
  SquareMask relightable_;
  // CV_8UC1 over region_: lightLevel() of the sky on support plane or relief, this in plane terms;
  // now: in relightable_ squares
  cv::Mat sky_now_, sky_before_;
  cv::Mat sun_now_, sun_before_;  // CV_8UC1 over region_: the same of the sun
  // CV_8UC1 over region_: 255 = support plane or relief is seen, on which light changes
  cv::Mat takes_light_;
  cv::Mat relit_;  // CV_8UC1 over region_: 255 = the original's shadow, to be taken from the plate
  // The sun on the drawn surfaces at the corners of squares of kLightStep px that hang on the
  // picture; the first one's place there.
  std::vector<SunCorner> sun_corners_;
  cv::Point sun_origin_;
  int sun_columns_ = 0, sun_rows_ = 0;
  // per square, by its first corner: the sun between the corners follows from theirs
  std::vector<std::uint8_t> smooth_;
  std::vector<SurfaceShade> shades_;  // per slot
  cv::Mat still_;  // CV_32FC1 over region_: 1 = nothing moved here; empty: everything did
  cv::Rect miss_box_;
  // CV_32FC4 over miss_box_: what drawing misses of the video, linear, and 1 where that is known;
  // may be empty
  cv::Mat miss_;
  std::vector<Rim> rims_;              // by rows
  std::vector<std::size_t> rim_rows_;  // per row of region_: its first in rims_, and one more
  bool any_shaded_ = false;            // one of them is
  // per slot: not edited, and in the way of the sun that falls on edited ones
  std::vector<bool> may_be_shaded_;
  cv::Mat screened_;  // CV_8UC1 over region_: 255 = scenery hides what is drawn; may be empty
  std::vector<bool> always_drawn_;  // per slot: isDrawn() wherever it is seen
  bool all_drawn_ = false;          // every slot is
  std::vector<SurfaceMaps> maps_;   // per slot; empty where it is not drawn
  std::optional<VisibilityBuffer> centre_;
  std::optional<EdgeCoverage> edges_;
  LineCodec codec_;
};

}  // namespace calipso::render
