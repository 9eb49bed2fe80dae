#include "calipso_render/inpaint.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

#include "offset_statistics.hpp"
#include "seam_blend.hpp"
#include "shift_cut.hpp"

namespace calipso::render {
namespace {

constexpr int kShortest = 15;     // the shortest offset is this part of the picture's longer side
constexpr int kSeamReach = 2;     // px around a seam that a finer level may move it
constexpr int kCoverSteps = 6;    // offsets that cover what no frequent one does, per half window

struct Level {
  cv::Mat image;         // CV_32FC3
  cv::Mat hole, source;  // CV_8UC1: to be filled; may be copied from
};

// Half the size: the mean of what is known; a pixel is hole if any of its four was, source if all were.
Level halved(const Level& fine) {
  Level half;
  const cv::Size size((fine.hole.cols + 1) / 2, (fine.hole.rows + 1) / 2);
  half.hole = cv::Mat::zeros(size, CV_8U);
  half.source = cv::Mat(size, CV_8U, cv::Scalar(255));
  half.image = cv::Mat::zeros(size, CV_32FC3);
  cv::Mat weight = cv::Mat::zeros(size, CV_32F);
  for (int v = 0; v < fine.hole.rows; ++v) {
    for (int u = 0; u < fine.hole.cols; ++u) {
      const bool known = fine.source.at<std::uint8_t>(v, u) != 0;
      const float w = known ? 1.0f : 1e-3f;
      half.hole.at<std::uint8_t>(v / 2, u / 2) |= fine.hole.at<std::uint8_t>(v, u);
      half.source.at<std::uint8_t>(v / 2, u / 2) &= known ? 255 : 0;
      half.image.at<cv::Vec3f>(v / 2, u / 2) += w * fine.image.at<cv::Vec3f>(v, u);
      weight.at<float>(v / 2, u / 2) += w;
    }
  }
  for (int v = 0; v < size.height; ++v) {
    for (int u = 0; u < size.width; ++u) half.image.at<cv::Vec3f>(v, u) /= weight.at<float>(v, u);
  }
  return half;
}

// Finest first, down to where the cut is quick.
std::vector<Level> pyramid(const Level& finest, const InpaintParams& params) {
  std::vector<Level> levels = {finest};
  while (cv::countNonZero(levels.back().hole) > params.coarsest_hole &&
         std::min(levels.back().hole.cols, levels.back().hole.rows) / 2 >= params.coarsest_side) {
    levels.push_back(halved(levels.back()));
  }
  return levels;
}

cv::Mat smoothFill(const Level& level) {
  cv::Mat weight(level.hole.size(), CV_32F, cv::Scalar(0.0f));
  weight.setTo(1.0f, level.source);
  cv::Mat filled = level.image.clone();
  pushPull(level.image, weight).copyTo(filled, level.hole);
  return filled;
}

// Frequent offsets may all lead out of a big hole's middle into the hole: more are added, the one that covers
// the most of what is left first, so that every pixel that can be copied has one.
void coverHole(const Level& level, std::vector<cv::Point>& offsets) {
  cv::Mat left = level.hole.clone();
  for (const cv::Point& o : offsets) left.setTo(0, copyable(level.source, o));
  std::vector<cv::Point> candidates;
  for (int j = -kCoverSteps; j <= kCoverSteps; ++j) {
    for (int i = -kCoverSteps; i <= kCoverSteps; ++i) candidates.emplace_back(i * left.cols / (kCoverSteps + 1), j * left.rows / (kCoverSteps + 1));
  }
  // The nearest in height first: places are layered.
  std::stable_sort(candidates.begin(), candidates.end(), [](const cv::Point& a, const cv::Point& b) { return std::abs(a.y) < std::abs(b.y); });
  while (cv::countNonZero(left) > 0 && offsets.size() + 1 < ShiftCut::kNone) {
    int most = 0;
    cv::Point best;
    for (const cv::Point& c : candidates) {
      const int covers = cv::countNonZero(copyable(level.source, c) & left);
      if (10 * covers > 11 * most) most = covers, best = c;
    }
    if (most == 0) return;
    offsets.push_back(best);
    left.setTo(0, copyable(level.source, best));
  }
}

// By what the picture repeats itself, near by and across the hole, and along level lines.
std::vector<cv::Point> candidateOffsets(const Level& level, const InpaintParams& params) {
  const double shortest = std::max(2.0, 1.0 * std::max(level.hole.cols, level.hole.rows) / kShortest);
  cv::Mat depth;
  double deepest = 0.0;
  cv::distanceTransform(level.hole, depth, cv::DIST_L2, 3);
  cv::minMaxLoc(depth, nullptr, &deepest);
  const double across = std::max(shortest, 2.0 * deepest);
  std::vector<cv::Point> offsets;
  for (const auto& found : {dominantOffsets(level.image, level.source, level.hole, shortest, params.repeats, params.seed),
                            dominantOffsets(level.image, level.source, level.hole, across, params.repeats, params.seed + 1),
                            levelOffsets(level.image, level.source, level.hole, params.levels)}) {
    for (const cv::Point& o : found) {
      if (std::find(offsets.begin(), offsets.end(), o) == offsets.end()) offsets.push_back(o);
    }
  }
  return offsets;
}

// Which shift every hole pixel takes, coarse to fine. Empty: there is nothing to copy.
std::optional<ShiftCut> cutShifts(const std::vector<Level>& levels, const InpaintParams& params) {
  const Level& coarsest = levels.back();
  std::vector<cv::Point> offsets = candidateOffsets(coarsest, params);
  coverHole(coarsest, offsets);
  if (offsets.empty()) return std::nullopt;
  ShiftCut cut(coarsest.image, coarsest.hole, coarsest.source, offsets, static_cast<float>(1 << (levels.size() - 1)));
  cut.start();
  for (int i = 0; i < params.sweeps; ++i) cut.sweep(-1);
  for (int i = static_cast<int>(levels.size()) - 2; i >= 0; --i) {
    const Level& level = levels[i];
    ShiftCut finer(level.image, level.hole, level.source, cut.refinedShifts(level.image, level.source), static_cast<float>(1 << i));
    finer.startFrom(cut);
    finer.sweep(kSeamReach);
    cut = finer;
  }
  return cut;
}

cv::Rect windowAround(const cv::Mat& hole) {
  const cv::Rect box = cv::boundingRect(hole);
  const int margin = std::max({48, box.width / 2, box.height / 2});
  const cv::Rect grown(box.x - margin, box.y - margin, box.width + 2 * margin, box.height + 2 * margin);
  return grown & cv::Rect(0, 0, hole.cols, hole.rows);
}

// Copies what the cut chose; what it could not serve keeps its smooth fill. Returns the copies' origins.
cv::Mat copyShifted(const ShiftCut& cut, const Level& level, cv::Mat& filled) {
  cv::Mat origin(level.hole.size(), CV_16SC2, cv::Scalar(-1, -1));
  for (int v = 0; v < level.hole.rows; ++v) {
    for (int u = 0; u < level.hole.cols; ++u) {
      const int label = cut.labels().at<std::uint8_t>(v, u);
      if (level.hole.at<std::uint8_t>(v, u) == 0 || label == ShiftCut::kNone) continue;
      const cv::Point from = cv::Point(u, v) + cut.shifts()[label];
      filled.at<cv::Vec3f>(v, u) = level.image.at<cv::Vec3f>(from);
      origin.at<cv::Vec2s>(v, u) = cv::Vec2s(static_cast<short>(from.x), static_cast<short>(from.y));
    }
  }
  return origin;
}

}  // namespace

InpaintResult inpaint(const cv::Mat& image, const cv::Mat& hole, const cv::Mat& banned,
                      const InpaintParams& params) {
  CV_Assert(image.type() == CV_32FC3 && hole.type() == CV_8UC1 && image.size() == hole.size());
  InpaintResult result{image.clone(), cv::Mat(image.size(), CV_16SC2, cv::Scalar(-1, -1)), true};
  if (cv::countNonZero(hole) == 0) return result;
  const cv::Rect window = windowAround(hole);
  cv::Mat source = hole == 0;
  if (!banned.empty()) source.setTo(0, banned);
  const Level finest{image(window).clone(), cv::Mat(hole(window) != 0), source(window).clone()};
  const std::optional<ShiftCut> cut = cutShifts(pyramid(finest, params), params);
  cv::Mat filled = smoothFill(finest);
  result.patches_found = cut.has_value();
  if (cut) {
    cv::Mat origin = copyShifted(*cut, finest, filled);
    blendSeams(finest.hole, finest.source, origin, filled);
    cv::Mat moved = origin + cv::Scalar(window.x, window.y), copied;
    cv::extractChannel(origin, copied, 0);
    moved.copyTo(result.origin(window), copied >= 0);
  }
  filled.copyTo(result.image(window), finest.hole);
  return result;
}

}  // namespace calipso::render
