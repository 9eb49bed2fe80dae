#include "fill/hidden_sky.hpp"

#include <opencv2/imgproc.hpp>

#include "calipso_render/inpaint.hpp"

namespace calipso::render {
namespace {

constexpr int kFewest = 30;  // px of a thing

constexpr std::uint8_t kSky = InpaintParams::kSky, kNoSky = InpaintParams::kNoSky;

// CV_8UC1: 255 on what is seen that hangs together with nothing at the picture's border.
cv::Mat unheld(const cv::Mat& sky) {
  cv::Mat pieces, stats, centres, unheld = cv::Mat::zeros(sky.size(), CV_8U);
  cv::connectedComponentsWithStats(sky == kNoSky, pieces, stats, centres, 8, CV_32S);
  const auto isUnheld = [&](int piece) {
    const cv::Rect box(
        stats.at<int>(piece, cv::CC_STAT_LEFT), stats.at<int>(piece, cv::CC_STAT_TOP),
        stats.at<int>(piece, cv::CC_STAT_WIDTH), stats.at<int>(piece, cv::CC_STAT_HEIGHT));
    return piece > 0 && stats.at<int>(piece, cv::CC_STAT_AREA) >= kFewest && box.x > 0 &&
           box.y > 0 && box.br().x < sky.cols && box.br().y < sky.rows;
  };
  for (int v = 0; v < sky.rows; ++v) {
    for (int u = 0; u < sky.cols; ++u) {
      if (isUnheld(pieces.at<int>(v, u))) unheld.at<std::uint8_t>(v, u) = 255;
    }
  }
  return unheld;
}

}  // namespace

cv::Mat copiedSky(const cv::Mat& sky, const cv::Mat& origin) {
  cv::Mat told = sky.clone();
  for (int v = 0; v < sky.rows; ++v) {
    for (int u = 0; u < sky.cols; ++u) {
      const cv::Vec2s from = origin.at<cv::Vec2s>(v, u);
      if (from[0] >= 0) told.at<std::uint8_t>(v, u) = sky.at<std::uint8_t>(from[1], from[0]);
    }
  }
  return told;
}

cv::Mat hiddenSky(const cv::Mat& sky) {
  const cv::Mat alone = unheld(sky);
  cv::Mat told = sky.clone();
  for (int u = 0; u < sky.cols; ++u) {
    for (int v = 0, below; v < sky.rows; v = below + 1) {
      for (below = v; below < sky.rows && sky.at<std::uint8_t>(below, u) == 0;) ++below;
      if (below == v || below == sky.rows) continue;
      const bool from_sky = v == 0 || sky.at<std::uint8_t>(v - 1, u) == kSky,
                 to_sky = sky.at<std::uint8_t>(below, u) == kSky,
                 stands = v > 0 && alone.at<std::uint8_t>(v - 1, u) != 0;
      if (from_sky && to_sky) told(cv::Rect(u, v, 1, below - v)) = kSky;
      if (stands && !to_sky) told(cv::Rect(u, v, 1, below - v)) = kNoSky;
    }
  }
  return told;
}

}  // namespace calipso::render
