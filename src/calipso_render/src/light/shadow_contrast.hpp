#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <vector>

#include "calipso_render/stage.hpp"
#include "calipso_scene/scene.hpp"
#include "draw/ray_scene.hpp"

namespace calipso::render {

// What the outlines of cast shadows say about the sun where no picture shows the place without
// them: predicted shadow against darkness on the support planes and on what the depth image shows
// to be flat, both less their means nearby.
//   y' = b h' + e
//   y  -log of brightness         h  hidden part of a sun in direction l
//   b  how dark the shadow is     '  less the mean of like-coloured places around
class ShadowContrast {
 public:
  // Cells across the picture: enough to find a direction by; to tell directions near it apart.
  static constexpr int kCoarse = 80, kFine = 160;

  // @param depth CV_32FC1, m, from the same camera, 0: unknown; may be empty
  ShadowContrast(const View& view, const std::vector<SupportPlane>& planes, const cv::Mat& depth,
                 int cells_across);

  // How badly a sun in direction l explains the picture, at its best b >= 0: minus a
  // log-likelihood, 0 without any shadow.
  double misfit(const RayScene& objects, const Eigen::Vector3f& l) const;

  // The directions, of many all around, whose shadows are seen best; best first.
  std::vector<Eigen::Vector3f> candidates(const RayScene& objects) const;

 private:
  void findReceivers(const View& view, const std::vector<SupportPlane>& planes,
                     const cv::Mat& depth);
  void groupByColour(const cv::Mat& smooth);
  cv::Mat meansAround(const cv::Mat& values) const;
  cv::Mat lessGroupMeans(const cv::Mat& values) const;
  // 1: hidden from the sun. @return the cells that the hidden ones influence; empty if none is
  cv::Rect cast(const RayScene& objects, const Eigen::Vector3f& l, cv::Mat& hidden) const;
  bool mayBeHidden(const Eigen::Vector3f& position, const Eigen::Vector3f& l) const;

  struct Group {
    cv::Mat member, per_weight;  // CV_32FC1: 1 in cells of it; 1 / weight of those around
  };

  int step_ = 0;                           // px, side of a cell
  int reach_ = 0;                          // cells, up to which those around one have weight
  cv::Mat receives_;                       // CV_8UC1, of the cells
  std::vector<Eigen::Vector3f> position_;  // world, of all cells in rows
  std::vector<Group> groups_;
  cv::Mat darkness_;  // y', CV_32FC1
  double variance_ = 1.0;
  Eigen::Vector3f centre_ = Eigen::Vector3f::Zero();
  float radius_ = 0.0f;  // m, of a ball around the objects
};

}  // namespace calipso::render
