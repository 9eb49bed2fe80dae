#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <vector>

#include "calipso_render/visibility.hpp"

namespace calipso::render {

// Meshes in the world at one instant, asked by rays of any direction (Embree). Thread-safe once
// built.
class RayScene {
 public:
  // Copies what it needs. @throw std::runtime_error if Embree cannot build the scene
  explicit RayScene(const std::vector<Occluder>& occluders);
  ~RayScene();
  RayScene(RayScene&&) noexcept;

  // Is anything in the way from the surface point p with unit normal n along unit direction d?
  bool blocked(const Eigen::Vector3f& p, const Eigen::Vector3f& n, const Eigen::Vector3f& d) const;

  // The same from exactly here.
  bool blocked(const Eigen::Vector3f& from, const Eigen::Vector3f& d) const;

  // Where a ray meets a surface first.
  struct Hit {
    int mesh, triangle;
    float v, w;   // weights of the triangle's second and third corner
    bool behind;  // on the side from which its corners run clockwise
  };
  std::optional<Hit> hit(const Eigen::Vector3f& p, const Eigen::Vector3f& n,
                         const Eigen::Vector3f& d) const;

  bool empty() const { return !handle_; }

 private:
  struct Handle;
  std::unique_ptr<Handle> handle_;  // empty: nothing is in the way
  Eigen::Vector3f centre_ = Eigen::Vector3f::Zero();
  float radius_ = 0.0f;  // m, of a ball around everything
};

}  // namespace calipso::render
