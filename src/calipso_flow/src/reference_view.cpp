#include "calipso_flow/reference_view.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

namespace calipso::flow {
namespace {

constexpr int kMargin = 20;            // px around the surface's window in a warped view
constexpr double kSameSurface = 0.02;  // of the diagonal: depths closer than this agree

// Pixels well inside the object, whose smoothed grey holds nothing of the background.
cv::Mat usablePixels(const SurfaceView& surface, const cv::Mat& mask) {
  cv::Mat usable = surface.depth > 0.0f;
  if (!mask.empty()) usable &= mask(surface.window) != 0;
  const cv::Mat square = cv::getStructuringElement(cv::MORPH_RECT, {5, 5});
  cv::erode(usable, usable, square, {-1, -1}, 1, cv::BORDER_CONSTANT, cv::Scalar(0));
  return usable;
}

void checkMask(const cv::Mat& mask, const Frame& frame) {
  if (mask.empty()) return;
  if (mask.type() != CV_8UC1 || mask.size() != frame.gray.size()) {
    throw std::invalid_argument("reference view: the mask must be 8-bit with one channel and " +
                                std::to_string(frame.gray.cols) + "x" +
                                std::to_string(frame.gray.rows) + ", like the picture");
  }
}

}  // namespace

ReferenceView::ReferenceView(const Frame& frame, const ObjectModel& model,
                             const Eigen::Isometry3d& world_from_object, const cv::Mat& mask,
                             int seed_count)
    : frame_(frame),
      mesh_(model.mesh),
      diagonal_(boundingDiagonal(model.mesh)),
      world_from_object_(world_from_object) {
  checkMask(mask, frame);
  surface_ = viewSurface(mesh_, frame.camera,
                         frame.camera.world_from_camera.inverse() * world_from_object);
  if (surface_.empty()) return;
  usable_ = usablePixels(surface_, mask);
  chooseSeeds(seed_count);
}

void ReferenceView::chooseSeeds(int count) {
  const int area = cv::countNonZero(usable_);
  if (area == 0) return;
  const double spacing = std::max(4.0, std::sqrt(static_cast<double>(area) / count));
  std::vector<cv::Point2f> corners;
  cv::goodFeaturesToTrack(frame_.gray(surface_.window), corners, count, 0.001, 0.8 * spacing,
                          usable_, 5);
  const Eigen::Isometry3d object_from_camera =
      world_from_object_.inverse() * frame_.camera.world_from_camera;
  for (const cv::Point2f& corner : corners) {
    const double depth = surface_.depth.at<float>(cvRound(corner.y), cvRound(corner.x));
    if (depth <= 0.0) continue;
    const Eigen::Vector3d ray =
        frame_.camera.ray(corner.x + surface_.window.x, corner.y + surface_.window.y);
    seeds_.push_back(object_from_camera * (depth * ray));
  }
}

struct ReferenceView::WarpMap {
  cv::Mat source;   // CV_32FC2: pixel of the reference
  cv::Mat weight;   // CV_32F
  cv::Mat covered;  // CV_8U
  // @param window  of the view; the map gets a margin and starts at even pixels, so that its
  //   half-size copy keeps simple coordinates
  explicit WarpMap(const cv::Rect& window)
      : origin((window.x - kMargin) & ~1, (window.y - kMargin) & ~1), offset(window.tl() - origin) {
    const cv::Size size(window.br().x + kMargin - origin.x, window.br().y + kMargin - origin.y);
    source = cv::Mat(size, CV_32FC2, cv::Scalar(-1e4, -1e4));
    weight = cv::Mat(size, CV_32F, cv::Scalar(0));
    covered = cv::Mat(size, CV_8U, cv::Scalar(0));
  }
  cv::Point origin, offset;
};

bool ReferenceView::note(const Eigen::Vector3d& p_reference, int x, int y, WarpMap& map) const {
  const int row = y + map.offset.y, column = x + map.offset.x;
  map.covered.ptr<uchar>(row)[column] = 255;
  if (p_reference.z() <= 0.0) return false;
  const Eigen::Vector2d pixel = frame_.camera.project(p_reference);
  const double u = pixel.x() - surface_.window.x + 0.5, v = pixel.y() - surface_.window.y + 0.5;
  if (!(u >= 0.0 && v >= 0.0 && u < surface_.window.width && v < surface_.window.height))
    return false;
  const int nearest_u = static_cast<int>(u), nearest_v = static_cast<int>(v);
  const float there = surface_.depth.ptr<float>(nearest_v)[nearest_u];
  if (there <= 0.0f || std::abs(there - p_reference.z()) > kSameSurface * diagonal_) return false;
  map.source.ptr<cv::Vec2f>(row)[column] = {static_cast<float>(pixel.x()),
                                            static_cast<float>(pixel.y())};
  if (usable_.ptr<uchar>(nearest_v)[nearest_u] == 0) return false;
  map.weight.ptr<float>(row)[column] = 1.0f;
  return true;
}

ReferenceView::Warped ReferenceView::finish(const WarpMap& map, int visible, int known) const {
  Warped warped;
  cv::remap(frame_.gray, warped.gray.image, map.source, cv::noArray(), cv::INTER_CUBIC,
            cv::BORDER_CONSTANT, cv::Scalar(0));
  warped.weight.image = map.weight;
  warped.covered = map.covered;
  warped.gray.origin = warped.weight.origin = cv::Point2d(map.origin);
  warped.coverage = visible > 0 ? static_cast<double>(known) / visible : 0.0;
  return warped;
}

ReferenceView::Warped ReferenceView::warp(const Camera& camera,
                                          const Eigen::Isometry3d& world_from_object) const {
  const Eigen::Isometry3d camera_from_object =
      camera.world_from_camera.inverse() * world_from_object;
  const SurfaceView view = viewSurface(mesh_, camera, camera_from_object);
  if (view.empty() || surface_.empty()) return {};
  WarpMap map(view.window);
  const Eigen::Isometry3d reference_from_camera =
      frame_.camera.world_from_camera.inverse() * world_from_object_ * camera_from_object.inverse();
  int visible = 0, known = 0;
  const Eigen::Vector3d ray_step = reference_from_camera.linear().col(0) / camera.fx;
  const Eigen::Vector3d origin = reference_from_camera.translation();
  for (int y = 0; y < view.depth.rows; ++y) {
    const float* depth = view.depth.ptr<float>(y);
    const Eigen::Vector3d ray =
        reference_from_camera.linear() * camera.ray(view.window.x, y + view.window.y);
    for (int x = 0; x < view.depth.cols; ++x) {
      if (depth[x] <= 0.0f) continue;
      ++visible;
      known += note(origin + depth[x] * (ray + x * ray_step), x, y, map);
    }
  }
  return finish(map, visible, known);
}

ReferenceView::Warped ReferenceView::warp(const Camera& camera,
                                          const Eigen::Isometry3d& world_from_object,
                                          const decltype(TriangleMesh::vertices)& deformed) const {
  if (surface_.empty()) return {};
  const auto inCamera = [](const decltype(TriangleMesh::vertices)& points,
                           const Eigen::Isometry3d& pose) -> decltype(TriangleMesh::vertices) {
    return (points * pose.linear().transpose()).rowwise() + pose.translation().transpose();
  };
  const CarriedView view = carrySurface(
      mesh_, camera, inCamera(deformed, camera.world_from_camera.inverse() * world_from_object),
      inCamera(mesh_.vertices, frame_.camera.world_from_camera.inverse() * world_from_object_));
  if (view.window.area() == 0) return {};
  WarpMap map(view.window);
  int visible = 0, known = 0;
  for (int y = 0; y < view.position.rows; ++y) {
    const cv::Vec3f* position = view.position.ptr<cv::Vec3f>(y);
    for (int x = 0; x < view.position.cols; ++x) {
      if (position[x][2] <= 0.0f) continue;
      ++visible;
      known += note({position[x][0], position[x][1], position[x][2]}, x, y, map);
    }
  }
  return finish(map, visible, known);
}

ReferenceView ReferenceView::reduced(int factor) const {
  if (factor == 1) return *this;
  ReferenceView small = *this;
  small.frame_ = flow::reduced(frame_, factor);
  if (surface_.empty()) return small;
  small.surface_ =
      viewSurface(mesh_, small.frame_.camera,
                  small.frame_.camera.world_from_camera.inverse() * world_from_object_);
  if (small.surface_.empty()) return small;
  cv::Mat all(frame_.gray.size(), CV_8U, cv::Scalar(0)), fewer;
  usable_.copyTo(all(surface_.window));
  const cv::Rect whole({0, 0}, small.frame_.gray.size() * factor);
  cv::resize(all(whole), fewer, small.frame_.gray.size(), 0, 0, cv::INTER_AREA);
  small.usable_ = (fewer(small.surface_.window) > 127) & (small.surface_.depth > 0.0f);
  return small;
}

int ReferenceView::seenPixels() const { return usable_.empty() ? 0 : cv::countNonZero(usable_); }

std::vector<Eigen::Vector3d> ReferenceView::gridPoints(int count) const {
  std::vector<Eigen::Vector3d> points;
  if (surface_.empty()) return points;
  const double area = cv::countNonZero(usable_);
  const double spacing = std::max(4.0, std::sqrt(area / count));
  const Eigen::Isometry3d object_from_camera =
      world_from_object_.inverse() * frame_.camera.world_from_camera;
  for (double v = 0.5 * spacing; v < usable_.rows; v += spacing) {
    for (double u = 0.5 * spacing; u < usable_.cols; u += spacing) {
      const cv::Point at(static_cast<int>(u), static_cast<int>(v));
      if (usable_.at<uchar>(at) == 0) continue;
      const Eigen::Vector3d ray =
          frame_.camera.ray(at.x + surface_.window.x, at.y + surface_.window.y);
      points.push_back(object_from_camera * (surface_.depth.at<float>(at) * ray));
    }
  }
  return points;
}

}  // namespace calipso::flow
