#include "place/plate_beside.hpp"

#include <algorithm>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "place/clip_motion.hpp"
#include "place/place_depth.hpp"
#include "place/view_warp.hpp"

namespace calipso::render {
namespace {

constexpr std::size_t kMostPlates = 3;
constexpr double kLeastPart = 0.02;  // of the picture that a further plate has to show

PlateBeside plateFrom(std::vector<ClipFrame> frames, std::size_t first, const cv::Mat& nearness,
                      bool objects_move, const BackgroundParams& params) {
  const Camera key = frames.front().camera;
  std::rotate(frames.begin(), frames.begin() + first, frames.end());
  PlateBeside beside{
      frames.front().camera, nearnessFrom(nearness, key, frames.front().camera), {}, {}};
  frames = inKeyView(frames, beside.nearness, params.mask_margin_px);
  Background seen = seenBackground(frames, objects_move, params);
  sharpenSeen(frames, params, seen);
  beside.plate = linearFromRealCodes(seen.plate), beside.spread = seen.spread;
  // Beside what no frame shows, colours are mixed with nothing when they are carried over.
  cv::Mat unseen;
  cv::dilate(seen.count == 0, unseen, cv::Mat());
  beside.spread.setTo(std::numeric_limits<float>::infinity(), unseen);
  return beside;
}

}  // namespace

cv::Mat besidePicture(const cv::Mat& map, const cv::Size& picture) {
  cv::Mat within;
  cv::inRange(map, cv::Scalar(0.0, 0.0), cv::Scalar(picture.width - 1.0, picture.height - 1.0),
              within);
  return within == 0;
}

std::vector<PlateBeside> platesBeside(const std::vector<ClipFrame>& frames, const cv::Mat& nearness,
                                      bool objects_move, const BackgroundParams& params) {
  const Camera& key = frames.front().camera;
  std::vector<cv::Mat> unseen;  // per frame: what no plate has
  for (const ClipFrame& f : frames) {
    const cv::Mat map = viewWarp(nearnessFrom(nearness, key, f.camera), key, f.camera);
    unseen.push_back(besidePicture(map, nearness.size()));
  }
  std::vector<PlateBeside> plates;
  while (plates.size() < kMostPlates) {
    const auto most =
        std::max_element(unseen.begin(), unseen.end(), [](const cv::Mat& a, const cv::Mat& b) {
          return cv::countNonZero(a) < cv::countNonZero(b);
        });
    if (cv::countNonZero(*most) < kLeastPart * static_cast<double>(most->total())) break;
    plates.push_back(plateFrom(frames, most - unseen.begin(), nearness, objects_move, params));
    const PlateBeside& last = plates.back();
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const Camera& here = frames[i].camera;
      const cv::Mat map =
          viewWarp(nearnessFrom(last.nearness, last.camera, here), last.camera, here);
      unseen[i] &= besidePicture(map, nearness.size());
    }
  }
  return plates;
}

}  // namespace calipso::render
