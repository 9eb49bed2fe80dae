#include "segmentation_checks.hpp"

#include <algorithm>
#include <set>
#include <stdexcept>
#include <string>

namespace calipso::align {
namespace {

std::string sizeText(const cv::Size& size) {
  return std::to_string(size.width) + "x" + std::to_string(size.height);
}

void checkTarget(const SegmentationTarget& target, const cv::Size& size) {
  const std::string who = "object '" + target.name + "': ";
  if (target.label < 1 || target.label > 254)
    throw std::invalid_argument(who + "index " + std::to_string(target.label) +
                                " is not in 1..254");
  const cv::Rect& r = target.rect;
  if ((r.width != 0 || r.height != 0) && (r & cv::Rect(cv::Point(), size)).area() < 4)
    throw std::invalid_argument(who + "rectangle " + std::to_string(r.x) + " " +
                                std::to_string(r.y) + " " + std::to_string(r.width) + " " +
                                std::to_string(r.height) + " does not meet the picture of " +
                                sizeText(size) + "; correct it");
}

}  // namespace

void checkPicture(const cv::Mat& image) {
  if (image.empty() || image.type() != CV_8UC3)
    throw std::invalid_argument(
        "segmentation: the picture is " +
        (image.empty() ? std::string("empty") : "of OpenCV type " + std::to_string(image.type())) +
        "; give 8 bit BGR");
}

void checkDepth(const cv::Mat& depth, const cv::Size& size) {
  if (!depth.empty() && (depth.type() != CV_32F || depth.size() != size))
    throw std::invalid_argument("depth: the image is " + sizeText(depth.size()) +
                                " of OpenCV type " + std::to_string(depth.type()) +
                                "; give CV_32F metres of the picture's size, " + sizeText(size));
}

void checkTargets(const std::vector<SegmentationTarget>& targets, const cv::Size& size) {
  if (targets.empty())
    throw std::invalid_argument("segmentation: no object to look for; list at least one");
  std::set<int> seen;
  for (const SegmentationTarget& target : targets) {
    checkTarget(target, size);
    if (!seen.insert(target.label).second)
      throw std::invalid_argument("object '" + target.name + "': index " +
                                  std::to_string(target.label) +
                                  " is also another object's; give each its own");
  }
}

void checkStrokes(const cv::Mat& strokes, const std::vector<SegmentationTarget>& targets,
                  const cv::Size& size) {
  if (strokes.empty()) {
    for (const SegmentationTarget& target : targets)
      if (target.rect.empty())
        throw std::invalid_argument("object '" + target.name +
                                    "' has neither rectangle nor stroke; give one");
    return;
  }
  if (strokes.type() != CV_8U || strokes.size() != size)
    throw std::invalid_argument("strokes: the image is " + sizeText(strokes.size()) +
                                " of OpenCV type " + std::to_string(strokes.type()) +
                                "; give 8 bit grey of the picture's size, " + sizeText(size));
  const std::set<int> used(strokes.begin<uchar>(), strokes.end<uchar>());
  for (const int value : used) {
    const bool known = value == 0 || value == kBackgroundStroke ||
                       std::any_of(targets.begin(), targets.end(),
                                   [&](const auto& target) { return target.label == value; });
    if (!known)
      throw std::invalid_argument("strokes: value " + std::to_string(value) +
                                  " names no object; use 0 for none, 255 for background or an "
                                  "object's index");
  }
}

std::vector<std::string> strayStrokes(const cv::Mat& strokes,
                                      const std::vector<SegmentationTarget>& targets) {
  std::vector<std::string> remarks;
  for (const SegmentationTarget& target : targets) {
    if (strokes.empty() || target.rect.empty()) continue;
    cv::Mat stray = strokes == target.label;
    stray(target.rect & cv::Rect(cv::Point(), strokes.size())).setTo(0);
    const int count = cv::countNonZero(stray);
    if (count == 0) continue;
    remarks.push_back("object '" + target.name + "': " + std::to_string(count) +
                      " px of its strokes lie outside of its rectangle and count for nothing; "
                      "enlarge its rect_xywh");
  }
  return remarks;
}

std::vector<std::string> indistinctTargets(const std::vector<SegmentationTarget>& targets,
                                           const std::vector<cv::Mat>& costs,
                                           const cv::Mat& labels) {
  // nats per pixel, no pixel counting more than the most: objects that are there have 3 to 6
  constexpr double kLeast = 2.0, kMost = 6.0;
  std::vector<std::string> remarks;
  for (size_t k = 0; k < targets.size(); ++k) {
    const cv::Mat odds = cv::min(cv::max(costs[0] - costs[k + 1], -kMost), kMost);
    const double mean = cv::mean(odds, labels == static_cast<int>(k + 1))[0];
    if (mean >= kLeast) continue;
    remarks.push_back("object '" + targets[k].name + "' is hardly told from its surroundings (" +
                      std::to_string(mean) +
                      " nats per pixel): is it in the first frame? If so, "
                      "draw strokes on it and around it");
  }
  return remarks;
}

void failWithoutBackground() {
  throw std::invalid_argument(
      "segmentation: rectangles and strokes leave no background to learn from; draw smaller "
      "rectangles or a background stroke");
}

void failWithoutForeground(const SegmentationTarget& target) {
  throw std::invalid_argument("object '" + target.name +
                              "': the rectangle and strokes leave no foreground; draw a stroke on "
                              "the object, or enlarge its rectangle");
}

}  // namespace calipso::align
