#pragma once

#include <optional>
#include <vector>

#include "frame/moved_shadow.hpp"
#include "frame/pixel.hpp"
#include "frame/resting_light.hpp"
#include "frame/staged_frame.hpp"

namespace calipso::render {

// Objects that are not edited and come into the shadow of edited ones, or out of it.
class ShadedOthers {
 public:
  // All of them must outlive this.
  ShadedOthers(const StagedFrame& frame, const MovedShadow& moved, const RestingLight& resting);

  bool any() const { return any_; }
  // May the object in a slot lie where edited ones change its sun?
  bool maybe(std::size_t slot) const { return maybe_[slot]; }

  // Darkens another object's own pixel where an edited object takes sun away that it had in the
  // video, and brightens it where that has gone which took it in the video.
  // @param seen what the picture's pixels see now
  void shade(const VisibilityBuffer& seen, int u, int v, Pixel& pixel) const;

 private:
  std::optional<SurfacePoint> pointAt(const VisibilityBuffer& seen, int u, int v) const;

  const StagedFrame& frame_;
  const MovedShadow& moved_;
  const RestingLight& resting_;
  std::vector<bool> maybe_;  // per slot
  bool any_ = false;
};

}  // namespace calipso::render
