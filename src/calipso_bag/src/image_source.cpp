#include "calipso_bag/image_source.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>
#include <stdexcept>
#include <utility>
#include <vector>

#include "calipso_scene/scene.hpp"

namespace calipso::bag {
namespace {

constexpr double kStillFps = 30.0;
constexpr double kMostOf = 0.9;  // of the frames that a video says it has

cv::Mat readImage(const std::string& path) {
  cv::Mat image = cv::imread(path, cv::IMREAD_COLOR);
  if (image.empty()) {
    throw std::runtime_error(path + ": missing, or not an image; every frame must be there");
  }
  return image;
}

void requireSize(const cv::Mat& image, const cv::Size& size, const std::string& what) {
  if (image.size() == size) return;
  throw std::runtime_error(what + " is " + std::to_string(image.cols) + "x" +
                           std::to_string(image.rows) + ", but the first frame is " +
                           std::to_string(size.width) + "x" + std::to_string(size.height) +
                           "; scale all frames to one size");
}

class Sequence : public ImageSource {
 public:
  Sequence(std::string directory, std::string pattern, int count, double fps)
      : directory_(std::move(directory)), pattern_(std::move(pattern)), count_(count), fps_(fps) {}

  std::optional<cv::Mat> next() override {
    if (index_ == count_) return std::nullopt;
    const std::string path = directory_ + "/" + numbered(pattern_, index_);
    cv::Mat image = readImage(path);
    if (index_++ == 0) size_ = image.size();
    requireSize(image, size_, path);
    return image;
  }
  double fps() const override { return fps_; }

 private:
  std::string directory_, pattern_;
  int count_;
  double fps_;
  int index_ = 0;
  cv::Size size_;
};

class Video : public ImageSource {
 public:
  explicit Video(const std::string& path) : path_(path), capture_(path, cv::CAP_FFMPEG) {
    if (!capture_.isOpened())
      throw std::runtime_error(path + ": neither a video nor an image; check the path");
    fps_ = capture_.get(cv::CAP_PROP_FPS);
    if (!(fps_ > 0.0 && fps_ < 1000.0)) {
      throw std::runtime_error(path + ": frame rate " + std::to_string(fps_) +
                               " is not usable; re-encode the video with a constant frame rate");
    }
  }

  std::optional<cv::Mat> next() override {
    cv::Mat image;
    if (!capture_.read(image) || image.empty()) {
      checkComplete();
      return std::nullopt;
    }
    ++frames_;
    if (size_.empty()) size_ = image.size();
    requireSize(image, size_, path_ + ": a frame");
    return image;
  }
  double fps() const override { return fps_; }

 private:
  // How many there are is an estimate in some formats.
  void checkComplete() const {
    const double all = capture_.get(cv::CAP_PROP_FRAME_COUNT);
    if (frames_ >= kMostOf * all) return;
    throw std::runtime_error(path_ + ": holds " + std::to_string(frames_) + " of " +
                             std::to_string(std::lround(all)) +
                             " frames, it is damaged or incomplete; copy it anew, or re-encode "
                             "what there is");
  }

  std::string path_;
  cv::VideoCapture capture_;
  int frames_ = 0;  // read
  double fps_ = 0.0;
  cv::Size size_;
};

class Still : public ImageSource {
 public:
  explicit Still(cv::Mat image) : image_(std::move(image)) {}
  std::optional<cv::Mat> next() override { return std::exchange(image_, std::nullopt); }
  double fps() const override { return kStillFps; }

 private:
  std::optional<cv::Mat> image_;
};

class Held : public ImageSource {
 public:
  Held(std::unique_ptr<ImageSource> source, int frames)
      : source_(std::move(source)), frames_(frames) {}

  std::optional<cv::Mat> next() override {
    std::optional<cv::Mat> image = source_->next();
    if (image) {
      last_ = *image;
    } else if (given_ < frames_ && !last_.empty()) {
      image = last_.clone();
    }
    if (image) ++given_;
    return image;
  }
  double fps() const override { return source_->fps(); }

 private:
  std::unique_ptr<ImageSource> source_;
  int frames_;
  int given_ = 0;
  cv::Mat last_;
};

}  // namespace

std::unique_ptr<ImageSource> openSequence(const std::string& directory, const std::string& pattern,
                                          int count, double fps) {
  const std::string first = directory + "/" + numbered(pattern, 0);
  if (count < 1) {
    throw std::invalid_argument(
        "a sequence of " + std::to_string(count) + " frames, the first of them " + first +
        ": there must be one at least; number them from 0, or give n_frames");
  }
  return std::make_unique<Sequence>(directory, pattern, count, fps);
}

std::unique_ptr<ImageSource> openVideo(const std::string& path) {
  if (cv::haveImageReader(path)) return std::make_unique<Still>(readImage(path));
  return std::make_unique<Video>(path);
}

std::unique_ptr<ImageSource> holdLast(std::unique_ptr<ImageSource> source, int frames) {
  return std::make_unique<Held>(std::move(source), frames);
}

}  // namespace calipso::bag
