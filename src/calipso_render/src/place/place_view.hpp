#pragma once

#include <cmath>
#include <utility>

#include "calipso_render/relief.hpp"
#include "place/plane_view.hpp"

namespace calipso::render {

// What takes shadows, as one camera sees it: the support planes, and the relief where that is seen.
class PlaceView {
 public:
  PlaceView(PlaneView planes, Relief relief = {})
      : planes_(std::move(planes)), relief_(std::move(relief)) {}

  bool sees(int u, int v) const {
    return relief_.at(u, v) || planes_.sees(static_cast<float>(u), static_cast<float>(v));
  }

  // sees() for `count` pixels of a row from (u, v) on, which the picture has: 255 or 0.
  void seesRow(int u, int v, int count, std::uint8_t* out) const {
    planes_.seesRow(u, v, count, out);
    if (relief_.empty()) return;
    const std::uint8_t* seen = relief_.seen.ptr<std::uint8_t>(v) + u;
    for (int i = 0; i < count; ++i) out[i] |= seen[i];
  }

  // @return false where nothing that takes shadows is seen
  bool at(float u, float v, Receiver& receiver) const {
    if (!relief_.empty()) {
      const int x = static_cast<int>(std::lround(u)), y = static_cast<int>(std::lround(v));
      if (relief_.at(x, y)) {
        receiver = relief_.receiver(x, y);
        return true;
      }
    }
    return planes_.at(u, v, receiver);
  }

  const PlaneView& planes() const { return planes_; }
  const Relief& relief() const { return relief_; }

 private:
  PlaneView planes_;
  Relief relief_;
};

}  // namespace calipso::render
