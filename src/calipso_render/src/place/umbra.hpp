#pragma once

#include <optional>
#include <vector>

#include "calipso_render/background.hpp"
#include "calipso_render/light.hpp"
#include "calipso_render/stage.hpp"
#include "light/shadow_clue.hpp"

namespace calipso::render {

struct SeenUmbra {
  std::optional<cv::Vec3f> umbra;  // per channel; nullopt where too little of shadows is seen
  bool refuted = false;            // it is no darker where they should be
};

// What the sun's absence leaves of a support plane's brightness, from the places that the views'
// objects are known to shade: the median of picture over plate, what the objects hide of the sky
// taken off. @param unseen what else keeps the sun off them
SeenUmbra umbraInViews(const std::vector<View>& views, const std::vector<SupportPlane>& planes,
                       const EmptyPlace& place, const Light& light, const Visibility& unseen);

// What the light itself says of that, on the first plane.
cv::Vec3f predictedUmbra(const Light& light, const std::vector<SupportPlane>& planes);

// Median of picture / plate per channel over pixels of the full shadow, where all of the sky would
// be seen; `predicted` if there are too few.
// @param sun, sky CV_32FC1, visible parts of them on the support planes
cv::Vec3f umbraInPicture(const cv::Mat& picture, const cv::Mat& plate, const cv::Mat& sun,
                         const cv::Mat& sky, const cv::Mat& labels, const cv::Vec3f& predicted);

// The same from shadows that pass over the plate: the dark end of what darkens it.
cv::Vec3f umbraOfPassing(const std::vector<ClipFrame>& frames,
                         const std::vector<SupportPlane>& planes, const Background& background,
                         const cv::Vec3f& predicted);

}  // namespace calipso::render
