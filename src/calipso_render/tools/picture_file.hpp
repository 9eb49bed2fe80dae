#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace calipso::render {

// Makes a folder for pictures, with those that it lies in; empty: none is wanted.
// @throw std::runtime_error naming it
void makePictureFolder(const std::string& folder);

// @param parameters cv::imwrite()'s. @throw std::runtime_error naming the file
void writePicture(const std::string& file, const cv::Mat& picture,
                  const std::vector<int>& parameters = {});

}  // namespace calipso::render
