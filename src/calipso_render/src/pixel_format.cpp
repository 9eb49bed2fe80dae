#include "calipso_render/pixel_format.hpp"

#include <opencv2/imgproc.hpp>
#include <stdexcept>

namespace calipso::render {
namespace {

// Rec. 601 luma, as cv::cvtColor has it, so that grey pictures stay grey.
std::uint8_t luma(const cv::Vec3b& c) {
  return static_cast<std::uint8_t>((1868 * c[0] + 9617 * c[1] + 4899 * c[2] + 8192) >> 14);
}

void writePixel(const cv::Vec3b& c, PixelFormat format, std::uint8_t* out) {
  switch (format) {
    case PixelFormat::kMono8:
      out[0] = luma(c);
      return;
    case PixelFormat::kBgr8:
    case PixelFormat::kBgra8:
      out[0] = c[0], out[1] = c[1], out[2] = c[2];
      return;
    case PixelFormat::kRgb8:
    case PixelFormat::kRgba8:
      out[0] = c[2], out[1] = c[1], out[2] = c[0];
      return;
  }
}

int conversionCode(PixelFormat format) {
  switch (format) {
    case PixelFormat::kRgb8:
      return cv::COLOR_RGB2BGR;
    case PixelFormat::kMono8:
      return cv::COLOR_GRAY2BGR;
    case PixelFormat::kBgra8:
      return cv::COLOR_BGRA2BGR;
    default:
      return cv::COLOR_RGBA2BGR;
  }
}

}  // namespace

PixelFormat pixelFormat(const std::string& encoding) {
  if (encoding == "bgr8" || encoding == "8UC3") return PixelFormat::kBgr8;
  if (encoding == "rgb8") return PixelFormat::kRgb8;
  if (encoding == "mono8" || encoding == "8UC1") return PixelFormat::kMono8;
  if (encoding == "bgra8" || encoding == "8UC4") return PixelFormat::kBgra8;
  if (encoding == "rgba8") return PixelFormat::kRgba8;
  throw std::invalid_argument(
      "image encoding '" + encoding +
      "' cannot be edited; convert the images to bgr8, rgb8, mono8, bgra8 or rgba8");
}

int channels(PixelFormat format) {
  if (format == PixelFormat::kMono8) return 1;
  return format == PixelFormat::kBgra8 || format == PixelFormat::kRgba8 ? 4 : 3;
}

cv::Mat toBgr(const cv::Mat& image, PixelFormat format) {
  CV_Assert(image.depth() == CV_8U && image.channels() == channels(format));
  if (format == PixelFormat::kBgr8) return image;
  cv::Mat bgr;
  cv::cvtColor(image, bgr, conversionCode(format));
  return bgr;
}

void writeChanged(const cv::Mat& bgr, const cv::Mat& changed, PixelFormat format, cv::Mat& image) {
  const int bytes = channels(format);
  for (int v = 0; v < image.rows; ++v) {
    const std::uint8_t* flag = changed.ptr<std::uint8_t>(v);
    const cv::Vec3b* in = bgr.ptr<cv::Vec3b>(v);
    std::uint8_t* out = image.ptr<std::uint8_t>(v);
    for (int u = 0; u < image.cols; ++u) {
      if (flag[u] != 0) writePixel(in[u], format, out + bytes * u);
    }
  }
}

}  // namespace calipso::render
