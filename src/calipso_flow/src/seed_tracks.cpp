#include "seed_tracks.hpp"

#include <cmath>

namespace calipso::flow {
namespace {

// of an object's diagonal: of the terms of its shape's error, see kShapeTerms
constexpr double kDepthError = 0.005;

// How the shape's error at the reference's points shows in a frame: a point lies on the reference's
// line of sight, and where on it is known as well as the shape.
class ShapeParallax {
 public:
  // @param deviation  m, of a term of the shape's error, as far from the middle as points are
  ShapeParallax(const ReferenceView& reference, const Camera& camera, const Eigen::Isometry3d& pose,
                double deviation)
      : camera_(camera),
        camera_from_object_(camera.world_from_camera.inverse() * pose),
        reference_camera_(reference.frame().camera),
        reference_from_object_(reference_camera_.world_from_camera.inverse() *
                               reference.worldFromObject()),
        deviation_(deviation) {
    const size_t count = reference.seeds().size();
    for (const Eigen::Vector3d& seed : reference.seeds()) middle_ += pixel(seed) / count;
    for (const Eigen::Vector3d& seed : reference.seeds())
      squared_spread_ += (pixel(seed) - middle_).squaredNorm() / count;
  }

  Eigen::Matrix<double, 2, kShapeTerms> of(const Eigen::Vector3d& point) const {
    const Eigen::Vector3d sight =
        reference_from_object_.linear().transpose() * (reference_from_object_ * point).normalized();
    const Eigen::Vector2d shift = camera_.projectJacobian(camera_from_object_ * point) *
                                  (camera_from_object_.linear() * sight);
    const Eigen::Vector2d at = (pixel(point) - middle_) / std::sqrt(squared_spread_);
    return deviation_ * shift * Eigen::RowVector3d(at.x(), at.y(), at.squaredNorm() - 1.0);
  }

 private:
  Eigen::Vector2d pixel(const Eigen::Vector3d& point) const {
    return reference_camera_.project(reference_from_object_ * point);
  }

  const Camera& camera_;
  const Eigen::Isometry3d camera_from_object_;
  const Camera& reference_camera_;
  const Eigen::Isometry3d reference_from_object_;
  const double deviation_;
  Eigen::Vector2d middle_ = Eigen::Vector2d::Zero();
  double squared_spread_ = 1e-6;  // px^2
};

}  // namespace

std::vector<Track> followSeeds(const LookMatch& match, const ReferenceView& reference,
                               const Camera& camera, const Eigen::Isometry3d& look,
                               const Eigen::Isometry3d& start, const TrackerParams& params,
                               double diagonal, std::vector<Correspondence>& found) {
  const Eigen::Isometry3d camera_from_world = camera.world_from_camera.inverse();
  std::vector<Eigen::Vector3d> points;
  std::vector<LookMatch::Seed> pixels;
  for (const Eigen::Vector3d& seed : reference.seeds()) {
    const Eigen::Vector3d in_look = camera_from_world * (look * seed),
                          expected = camera_from_world * (start * seed);
    if (in_look.z() <= 0.0 || expected.z() <= 0.0) continue;
    points.push_back(seed);
    pixels.push_back({camera.project(in_look), camera.project(expected)});
  }
  const LookMatch::Matches matches = LookMatch::forEach(pixels, [&](const LookMatch::Seed& seed) {
    return match.findSurely(seed, params.patch, params.trust);
  });
  const ShapeParallax shape(reference, camera, look, kDepthError * diagonal);
  std::vector<Track> tracks;
  for (size_t i = 0; i < points.size(); ++i) {
    const auto& there = matches[i];
    if (!there) continue;
    found.push_back(
        {points[i], there->position, there->covariance, false, 1.0, shape.of(points[i])});
    tracks.push_back({points[i], there->position, there->correlation, there->deviation, false});
  }
  return tracks;
}

}  // namespace calipso::flow
