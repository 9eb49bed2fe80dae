#include "light/light_pictures.hpp"

#include "frame/edge_blur.hpp"
#include "working_size.hpp"

namespace calipso::render {
namespace {

Camera reduced(Camera c, int times) {
  const double middle = 0.5 * (times - 1);
  c.width /= times, c.height /= times, c.fx /= times, c.fy /= times;
  c.cx = (c.cx - middle) / times, c.cy = (c.cy - middle) / times;
  return c;
}

void reduce(View& view, int times) {
  view.picture = reducedMeans(view.picture, times), view.labels = reducedValues(view.labels, times);
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
  plate.plate = reducedMeans(plate.plate, times), plate.spread = reducedMeans(plate.spread, times);
  plate.count = reducedValues(plate.count, times);
  pictures.depth = reducedValues(pictures.depth, times);
  pictures.blur = outlineBlur(pictures.views.front().picture, pictures.views.front().labels);
  return pictures;
}

}  // namespace calipso::render
