#include "frame/square_mask.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "draw/wide_loops.hpp"

namespace calipso::render {
namespace {

CALIPSO_WIDE_LOOPS void takeLesser(const std::uint8_t* from, int count, std::uint8_t* to) {
  for (int i = 0; i < count; ++i) to[i] = std::min(to[i], from[i]);
}

}  // namespace

SquareMask::SquareMask(const cv::Rect& part) : first_(part.x / kSide, part.y / kSide) {
  set_ = cv::Mat::zeros((part.br().y - 1) / kSide - first_.y + 1,
                        (part.br().x - 1) / kSide - first_.x + 1, CV_8U);
}

void SquareMask::add(const SquareMask& other) {
  const auto [here, there] = shared(other);
  if (!here.empty()) set_(here) |= other.set_(there);
}

void SquareMask::remove(const SquareMask& other) {
  const auto [here, there] = shared(other);
  if (!here.empty()) set_(here) &= ~other.set_(there);
}

SquareMask SquareMask::grown(int margin) const {
  SquareMask out;
  out.first_ = first_;
  const int reach = (margin + kSide - 1) / kSide;
  cv::dilate(set_, out.set_, cv::Mat::ones(2 * reach + 1, 2 * reach + 1, CV_8U));
  return out;
}

cv::Rect SquareMask::box() const {
  const cv::Rect squares = set_.empty() ? cv::Rect() : cv::boundingRect(set_);
  return squares.empty() ? cv::Rect()
                         : cv::Rect((squares.tl() + first_) * kSide, squares.size() * kSide);
}

SquareMask::SquareMask(const cv::Mat& pixels, const cv::Rect& part, int margin)
    : first_(part.x / kSide, part.y / kSide) {
  const int across = (part.br().x - 1) / kSide - first_.x + 1,
            down = (part.br().y - 1) / kSide - first_.y + 1;
  cv::Mat full(down, across, CV_8U);
  // columns of the first square that lie before the part
  const int before = part.x - first_.x * kSide;
#pragma omp parallel for schedule(static)
  for (int j = 0; j < down; ++j) {
    const int first = std::max(0, (first_.y + j) * kSide - part.y),
              last = std::min(part.height, (first_.y + j + 1) * kSide - part.y);
    std::vector<std::uint8_t> columns(static_cast<std::size_t>(across) * kSide, 255);
    for (int v = first; v < last; ++v) {
      const std::uint8_t* row = pixels.ptr<std::uint8_t>(v);
      takeLesser(row, part.width, &columns[before]);
    }
    for (int i = 0; i < across; ++i)
      full.at<std::uint8_t>(j, i) =
          *std::min_element(&columns[i * kSide], &columns[i * kSide] + kSide);
  }
  const int reach = (margin + kSide - 1) / kSide;
  cv::erode(full, set_, cv::Mat::ones(2 * reach + 1, 2 * reach + 1, CV_8U));
}

}  // namespace calipso::render
