#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

#include "calipso_render/visibility.hpp"
#include "frame/square_mask.hpp"
#include "place/place_view.hpp"

namespace calipso::render {

// A visible part of a light, 0..1, as planes of a picture keep it.
inline std::uint8_t lightLevel(float visible) {
  return static_cast<std::uint8_t>(visible * 255.0f + 0.5f);
}

// What support planes and relief see of a light, pixel by pixel: exactly where it changes quickly,
// interpolated over two pixels where it changes slowly, and at once for squares that are all lit or
// all shaded.
// @param skip squares that are not wanted
// @param out CV_8UC1 over `rect`, lightLevel(); keeps its values where neither is seen, and where
// not wanted
// @param shaded gets the squares that are not known to be all lit; null: not wanted
void planesInLight(const PlaceView& view, const Visibility& light, const cv::Rect& rect,
                   const SquareMask& skip, cv::Mat& out, SquareMask* shaded = nullptr);

}  // namespace calipso::render
