#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace calipso::render {

// The middles of the patches that may be copied, row by row.
class PatchSources {
 public:
  // @param source CV_8UC1: what may be copied
  // @param surface CV_8UC1: the surfaces' labels, 0 unknown; may be empty
  PatchSources(const cv::Mat& source, const cv::Mat& surface);

  bool empty() const { return all_.empty(); }
  bool contains(const cv::Point& p) const {
    return p.x >= 0 && p.y >= 0 && p.x < whole_.cols && p.y < whole_.rows &&
           whole_.at<std::uint8_t>(p) != 0;
  }
  bool anyOn(int surface) const { return !on_surface_[surface].empty(); }

  // One of all, by any number; there must be some.
  const cv::Point& one(std::uint32_t number) const { return pick(all_, number); }
  // One of those on a surface, or of all if it has none.
  const cv::Point& oneOn(int surface, std::uint32_t number) const {
    return pick(anyOn(surface) ? on_surface_[surface] : all_, number);
  }
  // One of those in a row and beside it, or of all if there are none.
  const cv::Point& oneInRow(int row, std::uint32_t number) const;

 private:
  static const cv::Point& pick(const std::vector<cv::Point>& from, std::uint32_t number) {
    return from[number % static_cast<std::uint32_t>(from.size())];
  }

  cv::Mat whole_;  // CV_8UC1
  std::vector<cv::Point> all_;
  std::vector<std::uint32_t> row_starts_;  // of all_
  std::array<std::vector<cv::Point>, 256> on_surface_;
};

}  // namespace calipso::render
