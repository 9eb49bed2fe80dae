#include "calipso_render/clip_sample.hpp"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace calipso::render {
namespace {

std::string sizeText(const cv::Size& size) {
  return std::to_string(size.width) + " x " + std::to_string(size.height);
}

}  // namespace

void ClipSample::add(const ClipFrame& frame) {
  if (frame.bgr.type() != CV_8UC3 || frame.labels.type() != CV_8UC1) {
    throw std::invalid_argument("clip frame: picture must be 8-bit BGR and labels 8-bit grey");
  }
  const cv::Size expected = frames_.empty() ? frame.bgr.size() : frames_.front().bgr.size();
  if (frame.bgr.size() != expected || frame.labels.size() != expected) {
    throw std::invalid_argument("clip frame: picture " + sizeText(frame.bgr.size()) + ", labels " +
                                sizeText(frame.labels.size()) + ", but the clip's first frame is " +
                                sizeText(expected) + "; all must be equal");
  }
  if (seen_++ % stride_ != 0) return;
  if (frames_.size() == capacity_) {
    for (std::size_t i = 0; 2 * i < frames_.size(); ++i) frames_[i] = frames_[2 * i];
    frames_.resize((frames_.size() + 1) / 2);
    stride_ *= 2;
    if ((seen_ - 1) % stride_ != 0) return;
  }
  frames_.push_back(
      {frame.bgr.clone(), frame.labels.clone(), frame.camera, frame.poses, frame.stamp_ns});
}

bool ClipSample::setLabels(std::int64_t stamp_ns, const cv::Mat& labels) {
  const auto frame = std::find_if(frames_.begin(), frames_.end(),
                                  [&](const ClipFrame& f) { return f.stamp_ns == stamp_ns; });
  if (frame == frames_.end()) return false;
  if (labels.size() != frame->bgr.size()) {
    throw std::invalid_argument("clip frame: new labels are " + sizeText(labels.size()) +
                                ", the picture is " + sizeText(frame->bgr.size()));
  }
  frame->labels = labels.clone();
  return true;
}

}  // namespace calipso::render
