#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

namespace calipso::render {

// One way to fill the holes that a scene's objects leave in its key frame, against the scene's true
// plate.
struct FillingResult {
  std::string method;
  std::optional<double> psnr_db, gradient_ratio;  // without a true plate: none
  double hole = 0.0;                              // part of the picture
  double cpu_ms = 0.0;
};

// Ours and OpenCV's: Telea, Navier-Stokes, xphoto's fast frequency selective reconstruction.
// @param pictures folder for the filled pictures; empty: none
std::vector<FillingResult> compareFilling(const std::string& scene_directory,
                                          const std::string& pictures,
                                          const std::function<double()>& clock_ms);

}  // namespace calipso::render
