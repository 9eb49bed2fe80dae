#include "fill/around_hole.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "calipso_render/inpaint.hpp"

namespace calipso::render {

cv::Rect windowAround(const cv::Mat& hole, int least, int most) {
  const cv::Rect box = cv::boundingRect(hole);
  const int margin = std::clamp(std::max(box.width, box.height) / 2, least, most);
  const cv::Rect grown(box.x - margin, box.y - margin, box.width + 2 * margin,
                       box.height + 2 * margin);
  return grown & cv::Rect(0, 0, hole.cols, hole.rows);
}

cv::Mat smoothFill(const cv::Mat& image, const cv::Mat& hole, const cv::Mat& known) {
  cv::Mat weight(hole.size(), CV_32F, cv::Scalar(0.0f)), filled = image.clone();
  weight.setTo(1.0f, known);
  pushPull(image, weight).copyTo(filled, hole);
  return filled;
}

}  // namespace calipso::render
