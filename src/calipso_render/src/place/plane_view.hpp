#pragma once

#include <cstdint>
#include <vector>

#include "calipso_render/stage.hpp"
#include "draw/surface_run.hpp"

namespace calipso::render {

// The support planes as one camera sees them: receiverAt() for many pixels.
class PlaneView {
 public:
  PlaneView(const std::vector<SupportPlane>& planes, const Camera& camera);

  bool sees(float u, float v) const {
    if (planes_.size() == 1 && planes_[0].endless)
      return planes_[0].slope_0 + u * planes_[0].slope_u + v * planes_[0].slope_v < -1e-9f;
    Receiver receiver;
    return at(u, v, receiver);
  }

  // The same for `count` pixels of a row from (u, v) on: 255 where a plane is seen.
  void seesRow(int u, int v, int count, std::uint8_t* out) const;

  const Eigen::Vector3f& eye() const { return eye_; }
  // Sight line of a pixel, world; not of unit length.
  Eigen::Vector3f ray(float u, float v) const { return ray_0_ + u * ray_u_ + v * ray_v_; }

  // Of a row's pixels, world.
  SightLines sightLines(int v) const {
    const Eigen::Vector3f start = ray_0_ + static_cast<float>(v) * ray_v_;
    return {{start.x(), start.y(), start.z()}, {ray_u_.x(), ray_u_.y(), ray_u_.z()}};
  }

  // @return false where no plane is seen
  bool at(float u, float v, Receiver& receiver) const {
    const Eigen::Vector3f ray = this->ray(u, v);
    float nearest = 1e30f;
    for (const Plane& plane : planes_) {
      const float slope = plane.normal.dot(ray);
      if (slope >= -1e-9f) continue;  // seen from below, or never
      const float depth = plane.height / slope;
      const float x = eye_.x() + depth * ray.x();
      if (depth <= 0.0f || depth >= nearest || x < plane.x_min || x > plane.x_max) continue;
      nearest = depth;
      receiver.normal = plane.normal;
    }
    receiver.position = eye_ + nearest * ray;
    return nearest < 1e30f;
  }

 private:
  struct Plane {
    Eigen::Vector3f normal;
    float height;        // of the plane over the eye, m (negative: the eye is above it)
    float x_min, x_max;  // world, m
    float slope_0, slope_u, slope_v;  // of a pixel's sight line against it
    bool endless;                     // below the eye, without limits
  };
  std::vector<Plane> planes_;
  Eigen::Vector3f eye_, ray_0_, ray_u_,
      ray_v_;  // world; a pixel's sight line is ray_0 + u ray_u + v ray_v
};

}  // namespace calipso::render
