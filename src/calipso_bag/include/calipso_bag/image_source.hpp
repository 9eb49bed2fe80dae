#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

namespace calipso::bag {

// Frames from files: 8 bit, BGR, all of one size.
class ImageSource {
 public:
  virtual ~ImageSource() = default;

  // The next frame, or nothing after the last one.
  // @throw std::runtime_error naming the file and what is wrong with it
  virtual std::optional<cv::Mat> next() = 0;

  virtual double fps() const = 0;  // frames per second of video time
};

// `count` images of a numbered sequence, 0-based. `pattern`: printf style, relative to `directory`.
// @throw std::invalid_argument when the pattern does not hold exactly one integer field,
// or where there is no frame
std::unique_ptr<ImageSource> openSequence(const std::string& directory, const std::string& pattern,
                                          int count, double fps);

// A video file, or a still image (one frame, 30 fps).
// @throw std::runtime_error when the file cannot be read as either
std::unique_ptr<ImageSource> openVideo(const std::string& path);

// Continues a source that is shorter than `frames` with its last frame.
std::unique_ptr<ImageSource> holdLast(std::unique_ptr<ImageSource> source, int frames);

}  // namespace calipso::bag
