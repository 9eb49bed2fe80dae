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

  // What pixel (u, v) sees, less than a pixel beside its centre: relief goes on flat there.
  bool beside(int u, int v, float du, float dv, Receiver& receiver) const {
    if (!relief_.at(u, v)) return planes_.at(u + du, v + dv, receiver);
    receiver = relief_.receiver(u, v);
    slide(u + du, v + dv, receiver);
    return true;
  }

  // Takes a receiver along its plane to where (u, v) sees that.
  // @return false, and it stays, where the plane is seen too flat to tell
  bool slide(float u, float v, Receiver& receiver) const {
    const Eigen::Vector3f ray = planes_.ray(u, v);
    const float slope = receiver.normal.dot(ray);
    if (slope >= -kFlat * ray.norm()) return false;
    receiver.position =
        planes_.eye() + receiver.normal.dot(receiver.position - planes_.eye()) / slope * ray;
    return true;
  }

  const PlaneView& planes() const { return planes_; }
  const Relief& relief() const { return relief_; }

 private:
  static constexpr float kFlat = 0.05f;  // cosine of a view that is too flat
  PlaneView planes_;
  Relief relief_;
};

}  // namespace calipso::render
