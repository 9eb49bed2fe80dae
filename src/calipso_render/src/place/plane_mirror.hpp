#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/plane_mirror.hpp"
#include "calipso_render/renderer.hpp"
#include "calipso_render/stage.hpp"

namespace calipso::render {

// Linear radiance that a surface of actors[slot] sends out.
using Radiance = std::function<cv::Vec3f(int slot, const SurfacePoint& point)>;

// The same without shadows and highlights, which a blurred reflection hardly shows.
cv::Vec3f mirroredRadiance(const Appearance& appearance, const Light& light, const Look& look,
                           const SurfacePoint& point);

// What even mirrors in place of the support planes would show of some objects.
struct MirrorImage {
  cv::Mat colour;  // CV_32FC3: linear, times the reflectance; 0 where no object is seen
  // CV_32FC1: the reflectance (Schlick 1994, relative to a whole mirror) where an object is seen, 0
  // elsewhere
  cv::Mat cover;
  // CV_32FC1: px along a column by which it is drawn out for each unit of the planes' slopes
  cv::Mat spread;
  float across = 1.0f;  // how much less it is along a row
  cv::Rect box;         // beyond it no object is seen
  bool empty() const { return colour.empty(); }
};

// @param off CV_8UC1, != 0: no plane is seen there; may be empty
// @return empty if nothing of them is mirrored
MirrorImage mirrorImage(const std::vector<const Actor*>& actors, const Radiance& radiance,
                        const std::vector<SupportPlane>& planes, const Camera& camera,
                        const cv::Mat& off);

// CV_32FC4: colour and cover of a box's pixels.
cv::Mat withCover(const MirrorImage& image, const cv::Rect& box);

// Rectangle within which an image lies once slopes of this standard deviation have drawn it out.
cv::Rect reachedBy(const MirrorImage& image, float slope);

// What `image` adds to the picture, CV_32FC3, linear.
cv::Mat addedBy(const PlaneMirror& mirror, const MirrorImage& image);

// The picture without that.
// @param picture CV_32FC3, code values; bgr CV_8UC3
cv::Mat unmirrored(const PlaneMirror& mirror, const cv::Mat& picture);
cv::Mat unmirroredCodes(const PlaneMirror& mirror, const cv::Mat& bgr);

// Does the picture show the reflection? By least squares on what it differs from around it,
//   y' = strength (colour' - surroundings cover') + e,   ': less its mean around the pixel,
// strength and surroundings found in one half of the picture's squares and judged in the other, and
// both the same way for mirror images displaced sideways. Established if the one in place explains
// far more than any of those, and no stronger than polished steel.
// The dark along contacts may be there as well.
// @param picture CV_32FC3, linear; known CV_8UC1: pixels that may be looked at
// @param hidden CV_32FC1, part of the sky that objects hide, 0..1; may be empty
// @return strength 0 if it is not established
PlaneMirror establishMirror(const MirrorImage& image, const cv::Mat& picture, const cv::Mat& known,
                            const cv::Mat& hidden);

// Where the mirror image is so plain that nothing of the plane is left in it: taken off, the place
// has far less gradients than the plane has beside it in the same rows. And where a mirrored outline
// lies beside its place: there it has far more.
// @param bgr CV_8UC3, the key frame without what is mirrored
// @param plane CV_8UC1, 255: shows the planes, no object and no shadow
// @return CV_8UC1
cv::Mat lostInMirror(const PlaneMirror& mirror, const cv::Mat& bgr, const cv::Mat& plane);

// Polished planes show outlines of what is around them. These do not lie in them: such planes are
// not filled along themselves.
bool mirrorsSharply(const PlaneMirror& mirror);

// Water, by its waves: most of what it shows is mirrored, not lit.
bool isWater(const PlaneMirror& mirror);

}  // namespace calipso::render
