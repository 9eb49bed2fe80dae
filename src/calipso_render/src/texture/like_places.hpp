#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "texture/sightings.hpp"

namespace calipso::render {

// A place that is expected to look as another one does, from the shape of the surface.
struct LikePlace {
  std::function<Place(const Place&)> of;
  // how far what is seen of the surface bears that out: 0..1; none: nothing of it tells
  std::optional<float> agrees;

  bool agreesWell() const { return agrees && *agrees >= 0.7f; }
};

// The mirror images at the planes of symmetry. @param parts connectedParts()
std::vector<LikePlace> mirroredPlaces(const Surface& surface, const std::vector<int>& parts);

// Of a body of revolution: places turned about its axis, back and forth, into the quarter of a turn
// on either side of a middle. The middles that are first are as near as can be to the side that is
// seen from `eye`.
std::vector<LikePlace> turnedPlaces(const Surface& surface, const Eigen::Vector3f& eye);

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

// Puts those first that agree well, best first, and keeps `most`: what is seen may repeat itself
// about some planes and middles alone. Where nothing tells, as of mirror images behind the object,
// the shape is believed unless what is seen speaks clearly for others.
void keepBest(std::size_t most, std::vector<LikePlace>& like);

}  // namespace calipso::render
