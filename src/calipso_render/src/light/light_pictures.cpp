#include "light/light_pictures.hpp"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "frame/edge_blur.hpp"

namespace calipso::render {
namespace {

constexpr int kWorkingSide = 640;  // px of a picture's longer side, about

int timesTooLarge(const cv::Size& size) {
  return std::max(1, (std::max(size.width, size.height) + kWorkingSide / 2 - 1) / kWorkingSide);
}

// Rows and columns at the end that make no whole square are left out.
cv::Mat reduced(const cv::Mat& picture, int times, int by) {
  if (picture.empty()) return picture;
  const cv::Size size = picture.size() / times;
  cv::Mat out;
  cv::resize(picture(cv::Rect({0, 0}, size * times)), out, size, 0.0, 0.0, by);
  return out;
}

cv::Mat means(const cv::Mat& picture, int times) { return reduced(picture, times, cv::INTER_AREA); }

// One value of each square: labels and depths do not mix.
cv::Mat values(const cv::Mat& picture, int times) {
  return reduced(picture, times, cv::INTER_NEAREST);
}

Camera reduced(Camera c, int times) {
  const double middle = 0.5 * (times - 1);
  c.width /= times, c.height /= times, c.fx /= times, c.fy /= times;
  c.cx = (c.cx - middle) / times, c.cy = (c.cy - middle) / times;
  return c;
}

void reduce(View& view, int times) {
  view.picture = means(view.picture, times), view.labels = values(view.labels, times);
  view.camera = reduced(view.camera, times);
  for (Actor& a : view.actors) {
    const int hidden_side = a.screen.hidden_side;
    a.screen = projectMesh(a.vertices, a.surface->triangles, view.camera);
    a.screen.hidden_side = hidden_side;
  }
}

}  // namespace

LightPictures atWorkingSize(LightPictures pictures) {
  const int times = timesTooLarge(pictures.views.front().picture.size());
  if (times == 1) return pictures;
  for (View& view : pictures.views) reduce(view, times);
  Background& plate = pictures.plate;
  plate.plate = means(plate.plate, times), plate.spread = means(plate.spread, times);
  plate.count = values(plate.count, times);
  pictures.depth = values(pictures.depth, times);
  pictures.blur = outlineBlur(pictures.views.front().picture, pictures.views.front().labels);
  return pictures;
}

}  // namespace calipso::render
