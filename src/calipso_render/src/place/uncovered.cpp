#include "place/uncovered.hpp"

#include <opencv2/imgproc.hpp>
#include <vector>

#include "calipso_render/inpaint.hpp"
#include "place/place_depth.hpp"

namespace calipso::render {
namespace {

constexpr int kBeside = 12;  // px around holes from which they are continued

}  // namespace

cv::Mat hiddenAtKey(const cv::Mat& nearness, const Camera& here, const cv::Mat& from_key,
                    const cv::Mat& key_nearness, const Camera& key) {
  const Eigen::Isometry3d way = key.world_from_camera.inverse() * here.world_from_camera;
  cv::Mat nearest;  // of a pixel and those that its colour is mixed with
  cv::dilate(key_nearness, nearest, cv::Mat::ones(3, 3, CV_8U));
  cv::Mat hidden = cv::Mat::zeros(nearness.size(), CV_8U);
#pragma omp parallel for schedule(static)
  for (int v = 0; v < hidden.rows; ++v) {
    for (int u = 0; u < hidden.cols; ++u) {
      const cv::Vec2f at = from_key.at<cv::Vec2f>(v, u);
      const int x = cvRound(at[0]), y = cvRound(at[1]);
      if (x < 0 || y < 0 || x >= nearest.cols || y >= nearest.rows) continue;
      const float near = nearness.at<float>(v, u);
      const double depth = (way.linear() * here.ray(u, v) + near * way.translation()).z();
      if (depth > 0.0 && isBefore(nearest.at<float>(y, x), near / static_cast<float>(depth)))
        hidden.at<std::uint8_t>(v, u) = 255;
    }
  }
  return hidden;
}

void continueInto(const cv::Mat& holes, const cv::Mat& nearness, cv::Mat& plate) {
  cv::Rect box = cv::boundingRect(holes);
  if (box.empty()) return;
  box = cv::Rect(box.x - kBeside, box.y - kBeside, box.width + 2 * kBeside,
                 box.height + 2 * kBeside) &
        cv::Rect({0, 0}, holes.size());
  const cv::Mat hole = holes(box), of_hole = ofNearest(nearness(box), hole);
  cv::Mat weight(box.size(), CV_32F, cv::Scalar(0.0f)), part = plate(box);
  for (int v = 0; v < box.height; ++v) {
    for (int u = 0; u < box.width; ++u) {
      const float near = nearness.at<float>(v + box.y, u + box.x);
      if (hole.at<std::uint8_t>(v, u) == 0 && !isBefore(near, of_hole.at<float>(v, u)))
        weight.at<float>(v, u) = 1.0f;
    }
  }
  pushPull(part, weight).copyTo(part, hole);
}

}  // namespace calipso::render
