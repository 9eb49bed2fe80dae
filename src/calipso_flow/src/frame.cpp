#include "calipso_flow/frame.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>

namespace calipso::flow {
namespace {

constexpr double kPrefilterSigma = 0.7;  // px
constexpr int kThumbnailWidth = 64;      // px

cv::Mat thumbnailOf(const cv::Mat& gray) {
  cv::Mat small;
  const int height = std::max(1, gray.rows * kThumbnailWidth / gray.cols);
  cv::resize(gray, small, {kThumbnailWidth, height}, 0, 0, cv::INTER_AREA);
  small.convertTo(small, CV_32F);
  return small;
}

void checkPicture(const cv::Mat& picture, const Camera& camera) {
  if (picture.empty()) throw std::invalid_argument("frame: the picture is empty");
  if (picture.type() != CV_8UC1 && picture.type() != CV_8UC3) {
    throw std::invalid_argument("frame: pixel type " + cv::typeToString(picture.type()) +
                                " is not supported; give 8-bit grey or BGR");
  }
  if (picture.cols != camera.width || picture.rows != camera.height) {
    throw std::invalid_argument("frame: the picture is " + std::to_string(picture.cols) + "x" +
                                std::to_string(picture.rows) + " but its camera is " +
                                std::to_string(camera.width) + "x" + std::to_string(camera.height) +
                                "; give matching camera info");
  }
}

}  // namespace

Frame makeFrame(double time, const cv::Mat& picture, const Camera& camera) {
  checkPicture(picture, camera);
  cv::Mat gray = picture;
  if (picture.channels() == 3) cv::cvtColor(picture, gray, cv::COLOR_BGR2GRAY);
  Frame frame{time, {}, camera, thumbnailOf(gray)};
  gray.convertTo(frame.gray, CV_32F);
  cv::GaussianBlur(frame.gray, frame.gray, {5, 5}, kPrefilterSigma, kPrefilterSigma,
                   cv::BORDER_REPLICATE);
  return frame;
}

Frame reduced(const Frame& frame, int factor) {
  if (factor == 1) return frame;
  Frame small = frame;
  Camera& camera = small.camera;
  camera.width /= factor, camera.height /= factor;
  camera.fx /= factor, camera.fy /= factor;
  camera.cx = (camera.cx + 0.5) / factor - 0.5, camera.cy = (camera.cy + 0.5) / factor - 0.5;
  const cv::Rect whole(0, 0, camera.width * factor, camera.height * factor);
  cv::resize(frame.gray(whole), small.gray, {camera.width, camera.height}, 0, 0, cv::INTER_AREA);
  return small;
}

}  // namespace calipso::flow
