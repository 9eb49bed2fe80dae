#pragma once

#include <memory>
#include <vector>

#include "calipso_render/relief.hpp"
#include "calipso_render/sky_map.hpp"

namespace calipso::render {

// What walls see of the sky past objects that touch them, or nearly: what is farther off hides some
// of it, too, but softly, and much of that something else hides already. What is curved sees all of
// it.
class ReliefSky {
 public:
  static constexpr int kFine = 256;  // SkyMap::Params::resolution for pictures that stay

  ReliefSky() = default;

  // @param relief must outlive this
  // @param resolution of SkyMap::Params
  ReliefSky(const Relief& relief, const std::vector<Occluder>& occluders, int resolution);

  bool empty() const { return relief_ == nullptr; }  // all see all of it
  // Visible part, 0..1, of a pixel.
  float at(int u, int v) const;
  // CV_32FC1: of all pixels.
  cv::Mat visibility(const cv::Size& size) const;

 private:
  const Relief* relief_ = nullptr;
  std::vector<std::unique_ptr<const SkyMap>> over_;  // every wall; null: nothing is before it
};

}  // namespace calipso::render
