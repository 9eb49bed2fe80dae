#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

namespace calipso::render {

// What NoiseField repeats over the picture: its channels' values, row by row.
using NoiseTile = std::vector<float>;
NoiseTile noiseTile(float correlation);

// The camera's noise: standard deviation in code values against code value, per channel, and how
// much of it the channels have in common.
class NoiseModel {
 public:
  NoiseModel();  // a camera without noise

  // From pictures of the same place: spread over time per code value, where both pictures of a pair
  // are `steady` (CV_8UC1, one per picture, != 0). With a single picture: from its finest detail,
  // by the median, which edges do not move.
  // @pre frames: CV_8UC3, all of one size, at least one
  static NoiseModel estimate(const std::vector<cv::Mat>& frames,
                             const std::vector<cv::Mat>& steady);

  // Code values, >= 0.
  float deviation(int channel, float code) const;

  // Between two channels, 0..1: codecs keep of colours' noise little but its mean over some pixels.
  // Grey pictures have 1.
  float correlation() const { return correlation_; }

  const std::shared_ptr<const NoiseTile>& tile() const { return tile_; }

  static constexpr int kKnots = 9;  // at code values 0, 32, .. 256; linear between them
  static constexpr float kKnotStep = 32.0f;

 private:
  std::array<std::array<float, kKnots>, 3> deviation_;
  float correlation_;
  std::shared_ptr<const NoiseTile> tile_;
};

// Noise of unit variance per channel: what the channels have in common, hardly correlated between
// neighbouring pixels, and each channel's own, which spreads over two pixels as compression leaves
// it. The same model, stamp and pixel always get the same value, whatever is drawn first.
class NoiseField {
 public:
  NoiseField(const NoiseModel& model, std::int64_t stamp_ns);
  float at(int u, int v, int channel) const { return row(v, channel)[column(u)]; }

  static constexpr int kSide = 256,
                       kWrapped =
                           8;  // columns, and how many of the first stand once more after the last
  // A channel's row v of the picture, as columns say.
  const float* row(int v, int channel) const {
    return &(*tile_)[static_cast<std::size_t>(channel * kSide + ((v + shift_v_) & (kSide - 1))) *
                     (kSide + kWrapped)];
  }
  int column(int u) const { return (u + shift_u_) & (kSide - 1); }

 private:
  std::shared_ptr<const NoiseTile> tile_;
  int shift_u_, shift_v_;
};

}  // namespace calipso::render
