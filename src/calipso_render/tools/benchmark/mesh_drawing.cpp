#include "mesh_drawing.hpp"

#include <algorithm>
#include <numeric>

#include "draw/kernels.hpp"
#include "frame/surface_shader.hpp"

namespace calipso::render {

MeshDrawing::MeshDrawing(const DrawingCase& drawing)
    : prepared_(*drawing.prepared),
      sight_({}, prepared_.camera),
      shade_(layOut(prepared_.light.light, prepared_.appearances.front(), Look(),
                    prepared_.appearances.front().gloss)),
      codec_(NoiseModel(), 0) {}

cv::Mat MeshDrawing::draw(const Points& vertices) const {
  const Camera& camera = prepared_.camera;
  const Actor actor = makeActor(prepared_.surfaces.front(), vertices, camera);
  const cv::Rect box = boundsOf(actor.screen, 1, {camera.width, camera.height});
  const VisibilityBuffer seen(box, {&actor.screen});
  const SurfaceMaps maps(actor, prepared_.appearances.front(), prepared_.light.light, {},
                         sight_.eye());
  cv::Mat picture = cv::Mat::zeros(camera.height, camera.width, CV_8UC3);
#pragma omp parallel
  {
    SurfaceRun run;
    std::fill(std::begin(run.sun), std::end(run.sun), 1.0f);
#pragma omp for schedule(dynamic, 8)
    for (int v = box.y; v < box.br().y; ++v) drawRow(actor, maps, seen, v, run, picture);
  }
  return picture;
}

// Row v of the picture.
void MeshDrawing::drawRow(const Actor& actor, const SurfaceMaps& maps, const VisibilityBuffer& seen,
                          int v, SurfaceRun& run, cv::Mat& picture) const {
  const cv::Rect& box = seen.region();
  const std::uint32_t* ids = seen.ids(v - box.y);
  const cv::Point corner = prepared_.appearances.front().region.tl();
  const float none[SurfaceRun::kRoom] = {};
  for (int i = 0; i < box.width;) {
    const int first = i, limit = std::min(box.width, first + SurfaceRun::kMost);
    while (i < limit && ids[i] != VisibilityBuffer::kNothing) ++i;
    const int count = i - first, u = first + box.x;
    if (count == 0) {
      ++i;
      continue;
    }
    std::iota(run.column, run.column + count, static_cast<float>(u));
    const unsigned traits = kernels().locate(maps.triangles(), ids + first, {v, count, 0, corner},
                                             sight_.sightLines(v), run);
    kernels().sample(prepared_.appearances.front().albedo, 0, count, run);
    if ((traits & TriangleMap::kTextured) != 0)
      addTexture(actor, maps, ids + first, u, v, count, run);
    kernels().shade(shade_, 0, count, run);
    codec_.encode({run.colour[0], run.colour[1], run.colour[2], none, none}, u, v, count,
                  picture.ptr<cv::Vec3b>(v) + u);
  }
}

// What the texture says of the reflectance of `count` pixels of row v from column u on.
void MeshDrawing::addTexture(const Actor& actor, const SurfaceMaps& maps, const std::uint32_t* ids,
                             int u, int v, int count, SurfaceRun& run) const {
  for (int k = 0; k < count; ++k) {
    const int triangle = VisibilityBuffer::triangleOf(ids[k]);
    const TriangleMap& map = maps.of(triangle);
    if (!map.is(TriangleMap::kTextured)) continue;
    const Eigen::Vector3f weights =
        barycentric(actor.screen, triangle, static_cast<float>(u + k), static_cast<float>(v));
    run.mix(k, prepared_.appearances.front().texture.at(triangle, weights),
            map.is(TriangleMap::kPictured));
  }
}

}  // namespace calipso::render
