#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "calipso_render/background.hpp"
#include "calipso_render/stage.hpp"
#include "draw/ray_scene.hpp"

namespace calipso::render {

// What was seen of the place without what moves, from one camera.
struct EmptyPlace {
  Camera camera;
  const Background& plate;  // may be empty
  const cv::Mat& depth;     // CV_32FC1, m, 0: unknown; may be empty
};

// A place on a support plane as it is without what moves, code values; nullopt: not known, or it
// does not rest.
std::optional<cv::Vec3f> unshaded(const EmptyPlace& place,
                                  const Eigen::Isometry3d& camera_from_world,
                                  const Eigen::Vector3f& position);

// Which objects (in the view of the place's camera) leave the place that they stand at, so that
// other frames show it, and their shadow's, without them. @param moves per object
std::vector<bool> leavers(const View& view, const std::vector<bool>& moves,
                          const Background& plate);

// What shadows on the support planes say about the sun where other frames show the place without
// them: log-darkness of the planes' pixels in several views against the part of the sun that the
// objects hide. Those of objects that stay are in all frames: here they say nothing.
//   y = b (h - h_0)
//   y    -log of brightness over that of the plate
//   b    depth of the shadow, >= 0
//   h    hidden part of a sun in direction l     h_0  the least of all views that show the place
class ShadowClue {
 public:
  // @param casts per object of the views: it leaves its place
  // @pre at most 32 views
  ShadowClue(const std::vector<View>& views, const std::vector<bool>& casts,
             const std::vector<SupportPlane>& planes, const EmptyPlace& place);

  // false: too little of the planes was seen without shadows, misfit() is 0
  bool plateKnown() const { return !seen_.empty(); }

  // How badly a sun in direction l explains the pixels, at its best b: minus a log-likelihood, 0
  // without any shadow. @param objects that cast, in each of the views
  double misfit(const std::vector<RayScene>& objects, const Eigen::Vector3f& l) const;

  // Directions in which darkened pixels would lie in an object's shadow.
  std::vector<Eigen::Vector3f> candidates() const;

 private:
  struct Sample {
    Eigen::Vector3f position, normal;  // world
    float darkness;                    // y
    std::uint32_t shown;               // bit i: view i shows the place
  };
  struct Seen {
    std::size_t view;
    std::vector<Sample> samples;
    double variance;                       // of y
    std::vector<Eigen::Vector3f> centres;  // of what casts
  };
  std::vector<Seen> seen_;
};

}  // namespace calipso::render
