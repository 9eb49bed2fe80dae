#pragma once

#include <optional>
#include <vector>

#include "frame/backdrop.hpp"
#include "frame/drawn_surfaces.hpp"
#include "frame/edited_region.hpp"
#include "frame/frame_caches.hpp"
#include "frame/line_codec.hpp"
#include "frame/moved_shadow.hpp"
#include "frame/place_light.hpp"
#include "frame/reflections.hpp"
#include "frame/residual.hpp"
#include "frame/revealed_place.hpp"
#include "frame/row_composer.hpp"
#include "frame/row_kinds.hpp"
#include "frame/screen.hpp"
#include "frame/seen_place.hpp"
#include "frame/shaded_others.hpp"
#include "frame/sheets.hpp"
#include "frame/staged_frame.hpp"
#include "frame/still_pixels.hpp"
#include "frame/surface_shader.hpp"

namespace calipso::render {

// One frame on its way, stage after stage: who is where, what an edit can change, what is seen
// there and in which light, its pixels. Every stage reads those before it and changes none.
class FrameCompositor {
 public:
  // All of them must outlive this.
  FrameCompositor(const Prepared& prepared, const RenderParams& params, const FrameInput& input,
                  FrameCaches& caches);

  FrameOutput run();

 private:
  void drawRegion();
  bool updateRest();
  RestPicture pictureAtRest(const std::vector<bool>& edited) const;
  RowComposer composer() const;
  void composeRow(const RowComposer& composer, int v, Row& row, FrameOutput& out) const;

  FrameCaches& caches_;

  // The frame and its place, and how far the edit reaches
  const StagedFrame frame_;
  const SeenPlace place_;
  const Reflections reflections_;
  const RevealedPlace revealed_;
  const MovedShadow moved_;
  const RestingLight& resting_;
  const ShadedOthers others_;
  const cv::Mat passing_;  // passingShadows()
  const EditedRegion region_;

  // What is seen in the region, and in which light
  cv::Mat removed_;  // removedPixels()
  std::optional<DrawnSurfaces> surfaces_;
  std::optional<EdgeCoverage> edges_;
  std::optional<SurfaceShader> shader_;
  std::optional<StillPixels> still_;
  std::optional<PlaceLight> light_;
  std::optional<Screen> screen_;

  // What its pixels are made of
  std::optional<Backdrop> backdrop_;
  std::optional<Residual> residual_;  // empty: nothing is carried over
  std::optional<RowKinds> kinds_;
  std::optional<Sheets> sheets_;
  const LineCodec codec_;
};

}  // namespace calipso::render
