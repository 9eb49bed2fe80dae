#include "frame/screen.hpp"

#include <opencv2/imgproc.hpp>

namespace calipso::render {
namespace {

// of the nearness: what the depth image shows that much nearer stands in front
constexpr float kNearer = 1.02f;

// Where scenery is nearer than an edited object there.
// @param scenery CV_32FC1, 1/m
cv::Mat hiddenBy(const cv::Mat& scenery, const StagedFrame& frame, const VisibilityBuffer& seen) {
  cv::Mat drawn = cv::Mat::zeros(scenery.size(), CV_32F);
  for (int v = 0; v < drawn.rows; ++v) {
    const std::uint32_t* ids = seen.ids(v);
    for (int u = 0; u < drawn.cols; ++u) {
      const bool edited = ids[u] != VisibilityBuffer::kNothing && frame.objectOf(ids[u]).edited;
      if (edited) drawn.at<float>(v, u) = seen.nearness(v)[u];
    }
  }
  cv::dilate(drawn, drawn, cv::Mat::ones(3, 3, CV_8U));
  cv::Mat hidden = (scenery > kNearer * drawn) & (drawn > 0.0f);
  cv::blur(hidden, hidden, {3, 3});
  hidden.setTo(0, drawn == 0.0f);
  return hidden;
}

}  // namespace

Screen::Screen(const StagedFrame& frame, const SeenPlace& place, const VisibilityBuffer& seen)
    : corner_(seen.region().tl()) {
  const cv::Mat& scenery = place.scenery;
  const cv::Mat matte = frame.at_key_camera ? frame.params.matte : cv::Mat();
  if (scenery.empty() && matte.empty()) return;
  levels_ =
      matte.empty() ? cv::Mat::zeros(seen.region().size(), CV_8U) : matte(seen.region()).clone();
  if (!scenery.empty()) cv::max(levels_, hiddenBy(scenery(seen.region()), frame, seen), levels_);
}

}  // namespace calipso::render
