#pragma once

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <optional>

namespace calipso::render {

// The two shortest shifts by which a picture repeats itself, px.
struct Lattice {
  cv::Matx22f basis;  // columns

  // The whole number of both that is nearest to a shift.
  cv::Point2f nearest(const cv::Point2f& shift) const {
    const cv::Vec2f n = inverse * cv::Vec2f(shift.x, shift.y);
    const cv::Vec2f whole(std::round(n[0]), std::round(n[1]));
    const cv::Vec2f x = basis * whole;
    return {x[0], x[1]};
  }
  // Length of the shorter one.
  float shortest() const {
    return std::min(std::hypot(basis(0, 0), basis(1, 0)), std::hypot(basis(0, 1), basis(1, 1)));
  }
  cv::Matx22f inverse;
};

// The lattice of tiles, bricks, woven and printed patterns: peaks of the autocorrelation of what is known (masked
// normalised cross-correlation, Padfield 2010), all of which the lattice explains; nothing where the picture does not
// repeat itself.
// @param image CV_32FC3, code values; known CV_8UC1
// @param halvings shifts of up to 93 px are looked for, then in half the size, and so on
std::optional<Lattice> findLattice(const cv::Mat& image, const cv::Mat& known, int halvings = 0);

// What of a picture repeats itself by a lattice. CV_8UC1
// @param image CV_32FC3; known CV_8UC1; sample CV_8UC1, of it what the lattice was found in
cv::Mat repeatsBy(const Lattice& lattice, const cv::Mat& image, const cv::Mat& known,
                  const cv::Mat& sample);

// Where a picture differs from the mean around about as much as in a sample: what is bland repeats
// itself by any lattice. CV_8UC1
cv::Mat asLively(const cv::Mat& image, const cv::Mat& known, const cv::Mat& sample);

// Where a hole is nearer to what repeats itself than to what is known and does not, like a coping.
// @param repeats, known, hole CV_8UC1. @return CV_8UC1
cv::Mat goesOnByPattern(const cv::Mat& repeats, const cv::Mat& known, const cv::Mat& hole);

}  // namespace calipso::render
