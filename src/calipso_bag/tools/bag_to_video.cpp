#include <iostream>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <vector>

#include "calipso_bag/arguments.hpp"
#include "ros/bag_images.hpp"
#include "ros/guarded_main.hpp"

using namespace calipso::bag;

namespace {

constexpr char kUsage[] =
    "usage: bag_to_video BAG TOPIC OUT.mp4 [--fps F]\n"
    "  --fps F  frames per second; else from the stamps";
constexpr double kSingleFrameFps = 30.0;

double fpsOf(const std::vector<ros::Time>& stamps) {
  if (stamps.size() < 2) return kSingleFrameFps;
  return static_cast<double>(stamps.size() - 1) / (stamps.back() - stamps.front()).toSec();
}

// H.264 where the codec is installed, else MPEG-4.
cv::VideoWriter openWriter(const std::string& path, double fps, const cv::Size& size) {
  for (const int codec :
       {cv::VideoWriter::fourcc('a', 'v', 'c', '1'), cv::VideoWriter::fourcc('m', 'p', '4', 'v')}) {
    cv::VideoWriter writer(path, cv::CAP_FFMPEG, codec, fps, size);
    if (writer.isOpened()) return writer;
  }
  throw std::runtime_error(path +
                           ": cannot be written as MP4; check the folder, the name's ending (.mp4) "
                           "and OpenCV's FFmpeg");
}

// Both codecs store colour at half resolution and want even sizes.
cv::Mat evenSized(const cv::Mat& image) {
  cv::Mat even;
  cv::copyMakeBorder(image, even, 0, image.rows % 2, 0, image.cols % 2, cv::BORDER_REPLICATE);
  return even;
}

// A writer does not say that its disk is full.
void checkComplete(const std::string& path, std::size_t frames) {
  const cv::VideoCapture written(path, cv::CAP_FFMPEG);
  const double count = written.isOpened() ? written.get(cv::CAP_PROP_FRAME_COUNT) : 0.0;
  if (count + 0.5 < static_cast<double>(frames))
    throw std::runtime_error(path + ": holds " + std::to_string(static_cast<long>(count)) + " of " +
                             std::to_string(frames) + " frames; is the disk full?");
}

void convert(const Arguments& arguments) {
  std::vector<ros::Time> stamps;
  forEachImage(arguments.word(0), arguments.word(1),
               [&](const cv::Mat&, const ros::Time& stamp) { stamps.push_back(stamp); });
  const double fps = arguments.positive("fps", fpsOf(stamps));
  cv::VideoWriter writer;
  forEachImage(arguments.word(0), arguments.word(1), [&](const cv::Mat& image, const ros::Time&) {
    const cv::Mat even = evenSized(image);
    if (!writer.isOpened()) writer = openWriter(arguments.word(2), fps, even.size());
    writer.write(even);
  });
  writer.release();
  checkComplete(arguments.word(2), stamps.size());
  std::cout << arguments.word(2) << ": " << stamps.size() << " frames at " << fps
            << " per second\n";
}

}  // namespace

int main(int argc, char** argv) {
  return runTool([&] { convert(Arguments(argc, argv, 3, {"fps"}, {}, kUsage)); });
}
