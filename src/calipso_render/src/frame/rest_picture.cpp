#include "frame/rest_picture.hpp"

#include <opencv2/imgproc.hpp>

#include "frame/mask_morphology.hpp"
#include "frame/staged_frame.hpp"

namespace calipso::render {
namespace {

// For every pixel the nearest one of a set.
struct Nearest {
  cv::Mat labels;
  std::vector<cv::Point> place;  // per label; empty: the set is empty
  cv::Point at(int v, int u) const { return place[labels.at<int>(v, u)]; }
};

Nearest nearestWhere(const cv::Mat& set) {
  Nearest nearest;
  if (cv::countNonZero(set) == 0) return nearest;
  cv::Mat distance;
  cv::distanceTransform(set == 0, distance, nearest.labels, cv::DIST_L2, cv::DIST_MASK_5,
                        cv::DIST_LABEL_PIXEL);
  for (int v = 0; v < set.rows; ++v) {
    for (int u = 0; u < set.cols; ++u) {
      if (set.at<std::uint8_t>(v, u) == 0) continue;
      const std::size_t label = static_cast<std::size_t>(nearest.labels.at<int>(v, u));
      if (nearest.place.size() <= label) nearest.place.resize(label + 1);
      nearest.place[label] = {u, v};
    }
  }
  return nearest;
}

}  // namespace

FrameInput frameAtRest(const Prepared& prepared, const std::vector<bool>& edited) {
  FrameInput input;
  prepared.background.plate.convertTo(input.bgr, CV_8U);
  input.labels = prepared.key_labels;
  input.camera = prepared.camera, input.stamp_ns = prepared.key_stamp_ns;
  for (std::size_t i = 0; i < edited.size(); ++i) {
    if (!edited[i]) continue;
    ObjectInFrame o;
    o.name = prepared.surfaces[i].name, o.edited = true,
    o.vertices = prepared.surfaces[i].key_vertices;
    input.objects.push_back(o);
  }
  return input;
}

RestPicture::RestPicture(const std::vector<bool>& edited, const cv::Size& size)
    : edited(edited),
      drawn(cv::Mat::zeros(size, CV_32FC3)),
      passing(size, CV_32FC3, cv::Scalar::all(-1)),
      owners(size, CV_16S, cv::Scalar(-1)),
      reach(cv::Mat::zeros(size, CV_8U)) {}

void RestPicture::spreadOwners(const cv::Mat& seen, const cv::Mat& removed,
                               const cv::Rect& region) {
  const Nearest nearest = nearestWhere(seen >= 0);
  if (nearest.place.empty()) return;
  cv::dilate(removed, reach(region), disc(static_cast<int>(kNonePx)));
  box = cv::boundingRect(removed) + region.tl();
  cv::Mat out = owners(region);
  for (int v = 0; v < region.height; ++v) {
    for (int u = 0; u < region.width; ++u) out.at<short>(v, u) = seen.at<short>(nearest.at(v, u));
  }
}

}  // namespace calipso::render
