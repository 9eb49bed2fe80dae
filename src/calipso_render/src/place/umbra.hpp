#pragma once

#include <optional>
#include <vector>

#include "calipso_render/background.hpp"
#include "calipso_render/light.hpp"
#include "calipso_render/relief.hpp"
#include "calipso_render/stage.hpp"
#include "place/passing_shade.hpp"

namespace calipso::render {

// A place that objects shade fully: linear, in the light and shaded, as if all of the sky were seen.
struct ShadedSpot {
  cv::Point at;  // px, key frame
  cv::Vec3f lit, shaded;
};

// Those that the key frame shows, against what is made of the place.
// @param picture, plate CV_32FC3, code values @param sun, sky CV_32FC1, visible parts of them
// @param unknown CV_8UC1, != 0: neither
std::vector<ShadedSpot> shadedInPicture(const cv::Mat& picture, const cv::Mat& plate,
                                        const cv::Mat& sun, const cv::Mat& sky,
                                        const cv::Mat& unknown);

// What the sun's absence leaves of brightness, per channel.
struct SeenUmbra {
  std::optional<cv::Vec3f> umbra;  // the median; nullopt: too few spots, or not all channels darker
  bool refuted = false;            // it is no darker where they should be
};
SeenUmbra umbraAt(const std::vector<ShadedSpot>& spots);

// What the light itself says of that, on the first plane.
cv::Vec3f predictedUmbra(const Light& light, const std::vector<SupportPlane>& planes);

// The same from shadows that pass over the plate: the dark end of what darkens it.
cv::Vec3f umbraOfPassing(const std::vector<ClipFrame>& frames,
                         const std::vector<SupportPlane>& planes, const Background& background,
                         const cv::Vec3f& predicted);

// A plane's shade, in which  part lit + gloss  is left of a colour: no shadow takes what gloss adds.
struct PlaneUmbra {
  cv::Vec3f part;
  float gloss = 0.0f;

  // What is left of the brightness, per channel.
  cv::Vec3f at(const cv::Vec3f& lit) const;
};

// nullopt: the spots do not tell gloss, as they are much alike, or matt. @pre all were seen lit
std::optional<PlaneUmbra> glossyUmbra(const std::vector<ShadedSpot>& spots);

// The support planes, as the key frame's camera sees them, and the relief.
class UmbraSurfaces {
 public:
  // @param relief must outlive this
  UmbraSurfaces(const std::vector<SupportPlane>& planes, const Relief& relief,
                const Camera& camera);

  // Those of them on support planes.
  std::vector<ShadedSpot> onSupports(const std::vector<ShadedSpot>& spots) const;

  // Places that the views' objects are known to shade, against what was seen of them without.
  // @param receiver what of the place takes shade, of the key frame's pixels
  // @param unseen what else keeps the sun off it
  std::vector<ShadedSpot> shadedInViews(const std::vector<View>& views, const ReceiverOf& receiver,
                                        const Background& seen, const Light& light,
                                        const Visibility& unseen) const;

  // Prepared::umbra: of each support plane its own, where its spots tell that, else the shared one;
  // of relief what the light has for a surface that faces so, on the scale of the relief's spots, or
  // else of the shared one, in the hue of that.
  // @param plate CV_32FC3, linear @param seen_lit all spots were, none is filled
  cv::Mat umbra(const std::vector<ShadedSpot>& spots, bool seen_lit, const cv::Vec3f& shared,
                const Light& light, const cv::Mat& plate) const;

 private:
  std::vector<PlaneUmbra> planesUmbras(const std::vector<ShadedSpot>& spots, bool seen_lit,
                                       const cv::Vec3f& shared) const;
  float scaleOnRelief(const std::vector<ShadedSpot>& on_relief, float shared,
                      const Light& light) const;

  cv::Mat numbers_;  // CV_8UC1: of the support planes, from 1 on
  std::vector<SupportPlane> planes_;
  const Relief& relief_;
};

}  // namespace calipso::render
