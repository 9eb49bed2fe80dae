#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "calipso_flow/object_model.hpp"
#include "calipso_scene/scene.hpp"
#include "perturbation.hpp"
#include "truth.hpp"

namespace calipso::flow {

// A scene folder as the evaluator puts it before the analysis: its clip, and of every object with a
// truth the model that is given, where it is seen in the key frame, and the truth.
struct ClipCase {
  Scene scene;  // its camera is that of the enlarged frames
  int scale = 1;
  Perturbation perturbation;
  std::vector<ObjectModel> models;
  std::vector<cv::Mat> masks;
  std::vector<TrueObject> truths;

  cv::Mat frame(int k) const;  // enlarged
};

// @param models  see DynamicsOptions
// @param scale   the frames are enlarged by this factor
// @throw std::runtime_error when the folder holds no truth
ClipCase loadClipCase(const std::string& directory, const std::string& models, int scale,
                      const Perturbation& perturbation = Perturbation());

}  // namespace calipso::flow
