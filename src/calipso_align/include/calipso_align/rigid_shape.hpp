#pragma once

#include <memory>
#include <opencv2/core.hpp>

#include "calipso_align/model_view.hpp"

namespace calipso::align {

// An object that moves as a whole, by its model: its pose follows what its surface shows, then the
// outline that the colours bear out, and its silhouette says where the object can be. What the mask
// of the key frame had besides, or lacked, is carried along. One caller at a time.
class RigidShape {
 public:
  // mask: CV_8U, the object in the frame in which the model was fitted.
  RigidShape(const ModelSurface& model, const cv::Mat& mask);
  ~RigidShape();
  RigidShape(RigidShape&&) noexcept;
  RigidShape& operator=(RigidShape&&) noexcept;

  // Whether the model met the mask it was fitted to, and in every frame since about as much of its
  // outline as it did, with the surface looking about as it did: what deforms does not.
  bool holds() const;

  // Moves on to the next frame: `previous` and `now` CV_8U, flow backward, core: CV_8U, where the
  // flow is the object's; hidden, as_before: CV_8U, may be empty: what stood before it in the
  // previous frame, and where this one shows the background as it was.
  void moveAlong(const cv::Mat& previous, const cv::Mat& now, const cv::Mat& flow,
                 const cv::Mat& core, const cv::Mat& hidden = {}, const cv::Mat& as_before = {});

  // The silhouette: CV_8U 0 or 255, the whole picture.
  cv::Mat silhouette() const;

  // Moves the mask's own details along the backward flow of a part of the picture.
  void carryDetails(const cv::Mat& motion, const cv::Rect& roi);

  // Signed distance from where the outline is expected, px; negative inside.
  cv::Mat distance(const cv::Rect& roi) const;

  // Moves to where the colours have the outline.
  // evidence  CV_32F of roi's size, nats by which a pixel favours the object; 0: says nothing
  // other     CV_8U of roi's size: pixels behind which the outline may be hidden
  void meetOutline(const cv::Mat& evidence, const cv::Mat& other, const cv::Rect& roi);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace calipso::align
