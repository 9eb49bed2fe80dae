#include "picture_file.hpp"

#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

namespace calipso::render {

void makePictureFolder(const std::string& folder) {
  if (folder.empty()) return;
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (!std::filesystem::is_directory(folder))
    throw std::runtime_error(folder + ": no folder can be made there (" + error.message() +
                             "); name another for the pictures");
}

void writePicture(const std::string& file, const cv::Mat& picture,
                  const std::vector<int>& parameters) {
  if (!cv::imwrite(file, picture, parameters))
    throw std::runtime_error(file + ": the picture cannot be written");
}

}  // namespace calipso::render
