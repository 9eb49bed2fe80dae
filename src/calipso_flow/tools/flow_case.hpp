#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace calipso::flow {

// Reads a Middlebury .flo file as CV_32FC2. @throw std::runtime_error naming file and fault
cv::Mat readFlo(const std::string& path);

// End-point error of the dense methods on frame10.png -> frame11.png against flow10.flo: one JSON
// object per method.
std::vector<std::string> evaluateFlow(const std::string& directory);

}  // namespace calipso::flow
