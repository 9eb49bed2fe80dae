#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <vector>

#include "fill/lattice.hpp"

namespace calipso::render {

constexpr int kLineHalf = 4;  // px on either side of a line that are drawn with it

using LineProfile = std::array<cv::Vec3f, 2 * kLineHalf + 1>;  // colours across a line

// A line that is lost in the hole.
struct LineEnd {
  cv::Point2f at, into;  // into: unit direction towards the hole
  float length;          // px that are seen of it
  LineProfile profile;   // from right to left of `into`
  float contrast;
  std::array<cv::Vec3f, 2> beside;  // mean colours right and left of it
  bool from_afar;                   // nearer to the hole it was not to be measured
  // right and left: what is beside it varies little; else it may be one of many, texture
  std::array<bool, 2> stands_out{};
  int line = 0;           // number of the edge that it is an end of
  bool is_joint = false;  // in the middle of a line between two things: see jointsOf()
  float aside = 0.0f;     // px that withBeside() has moved it

  bool isThin() const;  // a line, not an edge between two things
  bool isLine() const { return is_joint || isThin(); }
  bool isClear() const { return stands_out[0] && stands_out[1]; }
};

// Straight edges of a picture, from end to end. @param source CV_8UC1: known; image CV_32FC3
std::vector<cv::Vec4f> straightEdges(const cv::Mat& source, const cv::Mat& image);

// Lines and edges that end at the hole, the longest first.
// @param edges straightEdges() of the picture, of which more may be unknown now
// @param any also those that stand out from nothing that is beside them
// @param image CV_32FC3, code values; hole, source CV_8UC1: to be filled; known
std::vector<LineEnd> findLineEnds(const std::vector<cv::Vec4f>& edges, const cv::Mat& hole,
                                  const cv::Mat& source, const cv::Mat& image, bool any = false);

// Those of them that are edges of a line between two things, as joints between slabs of two colours
// are, moved into its middle.
std::vector<LineEnd> jointsOf(const std::vector<LineEnd>& ends, const cv::Mat& hole,
                              const cv::Mat& source, const cv::Mat& image);

// Each of them, and what is an edge as well up to so many pixels to either side: of two edges that
// lie close together one may have been found here and the other one there.
std::vector<std::vector<LineEnd>> withBeside(const std::vector<LineEnd>& ends, int reach,
                                             const cv::Mat& hole, const cv::Mat& source,
                                             const cv::Mat& image);

// CV_8UC1: 255 on long thin lines that stand out from what is beside them: there is but one of such,
// and nothing else should look like it. @param edges straightEdges() of the picture
cv::Mat loneLines(const std::vector<cv::Vec4f>& edges, const cv::Mat& source, const cv::Mat& image);

// Is a line seen again at the shifts of a lattice that lead off it?
bool repeats(const LineEnd& end, const Lattice& lattice, const cv::Mat& source,
             const cv::Mat& image);

inline cv::Point2f leftOf(const cv::Point2f& d) { return {d.y, -d.x}; }
inline float cross(const cv::Point2f& a, const cv::Point2f& b) { return a.x * b.y - a.y * b.x; }
float rms(const cv::Vec3f& c);

// Is the pixel nearest to p set in a mask?
bool isSet(const cv::Mat& mask, const cv::Point2f& p);

// Bilinear, of those around p that are seen. @pre isSet(seen, p) @param image CV_32FC3
cv::Vec3f sampleSeen(const cv::Mat& image, const cv::Mat& seen, const cv::Point2f& p);

}  // namespace calipso::render
