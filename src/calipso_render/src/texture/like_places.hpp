#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "calipso_render/surface_symmetry.hpp"
#include "texture/sightings.hpp"

namespace calipso::render {

// A place that is expected to look as another one does, from the shape of the surface.
struct LikePlace {
  std::function<Place(const Place&)> of;
  // how far what is seen of the surface bears that out: 0..1; none: nothing of it tells
  std::optional<float> agrees;

  bool agreesWell() const { return agrees && *agrees >= 0.7f; }
};

// The mirror images at planes of symmetry. @param parts connectedParts()
std::vector<LikePlace> mirroredPlaces(const std::vector<MirrorPlane>& planes,
                                      const Points& vertices, const Triangles& triangles,
                                      const std::vector<int>& parts);

// Of a body of revolution: places turned about its axis. First back and forth, into the quarter of a
// turn on either side of a middle; the middles that are first are as near as can be to the side that
// is seen from `eye`. Then by whole parts of a turn, a half to a twenty-fourth, to that side.
std::vector<LikePlace> turnedPlaces(const Points& vertices, const Triangles& triangles,
                                    const Eigen::Vector3f& eye);

// A place of the surface and the colour that is known of it.
struct KnownPlace {
  Place place;
  cv::Vec3f colour;
};

// Sets `agrees` by how alike known places and theirs are.
// @param colourAt of a place, where it is well seen
void judgeLikePlaces(const std::vector<KnownPlace>& known, float spacing,
                     const std::function<std::optional<cv::Vec3f>(const Place&)>& colourAt,
                     std::vector<LikePlace>& like);

// All that are mirrored, and as many of those that are turned, best first: what is seen may repeat
// itself about some planes and middles alone. Where nothing tells, as of mirror images behind the
// object, the shape is believed, but what is seen first.
std::vector<LikePlace> bestFirst(std::vector<LikePlace> mirrored, std::vector<LikePlace> turned,
                                 std::size_t most_turned);

}  // namespace calipso::render
