#include "frame/surface_shader.hpp"

#include <algorithm>
#include <cstring>

#include "draw/eight_lanes.hpp"
#include "draw/kernels.hpp"
#include "frame/marked.hpp"

namespace calipso::render {
namespace {

void copyTo(float (&to)[3], const cv::Vec3f& from) { std::copy_n(from.val, 3, to); }

}  // namespace

SurfaceShade layOut(const Light& light, const Appearance& appearance, const Look& look,
                    const Gloss& gloss) {
  SurfaceShade s;
  const std::array<cv::Vec3f, 9> around = asMirrored(light).ambient;
  Eigen::Map<Eigen::Vector3f>(s.direction) = light.direction;
  copyTo(s.sun, light.sun), copyTo(s.least, 0.02f * around[0]);
  s.terms = 1;
  for (int i = 0; i < 9; ++i) {
    copyTo(s.ambient[i], around[i]);
    if (around[i] != cv::Vec3f()) s.terms = i == 0 ? 1 : i < 4 ? 4 : 9;
  }
  copyTo(s.floor, lightFloor(appearance.mean_light));
  copyTo(s.tint, look.tint.value_or(cv::Vec3f(1, 1, 1)));
  s.specular = gloss.specular, s.roughness = gloss.roughness, s.around = gloss.around;
  return s;
}

SurfaceShader::SurfaceShader(const StagedFrame& frame, const SeenPlace& place,
                             const DrawnSurfaces& surfaces, const MovedShadow& moved,
                             const RestingLight& resting)
    : frame_(frame),
      planes_(place.view.planes()),
      centre_(surfaces.centre()),
      region_(centre_.region()),
      maps_(findMaps(
          {frame.params.planes, frame.light, {moved.sun.get(), &resting.others()}, *moved.sky})),
      sun_(frame, planes_, surfaces, maps_, moved, resting) {
  for (std::size_t slot = 0; slot < frame.objects.size(); ++slot) {
    const StagedObject& object = frame.objects[slot];
    shades_.push_back(
        layOut(frame.light, appearanceOf(static_cast<int>(slot)), object.look, object.gloss));
  }
}

std::vector<SurfaceMaps> SurfaceShader::findMaps(const ShadedGround& ground) const {
  std::vector<SurfaceMaps> maps;
  for (std::size_t slot = 0; slot < frame_.objects.size(); ++slot) {
    const StagedObject& object = frame_.objects[slot];
    const bool seen =
        object.edited ||
        !(boundsOf(object.actor.screen, 0, frame_.input.bgr.size()) & region_).empty();
    const bool mirrors = object.gloss.around > 0.0f && frame_.prepared.light.from_shadows;
    maps.push_back(seen ? SurfaceMaps(object.actor, appearanceOf(static_cast<int>(slot)),
                                      frame_.light, mirrors ? ground : ShadedGround(), frame_.eye)
                        : SurfaceMaps());
  }
  return maps;
}

unsigned SurfaceShader::shadeStretch(int v, int first, int last, int slot, Row& row) const {
  const std::uint32_t* ids = centre_.ids(v - region_.y);
  const int offset = (first + region_.x) % kLightStep, count = last - first;
  SurfaceRun& run = row.run;
  for (int k = 0; k < count; k += 8)
    eightAt(run.column + offset + k) = static_cast<float>(first + region_.x + k) + lanes();
  const unsigned traits = kernels().locate(maps_[slot].triangles(), ids + first,
                                           {v, count, offset, appearanceOf(slot).region.tl()},
                                           planes_.sightLines(v), run);
  reflectStretch(traits, v, first, last, slot, row);
  sun_.onStretch(v, first, last, slot, row);
  kernels().shade(shades_[slot], offset, offset + count, run);
  for (int c = 0; c < 3; ++c) std::copy_n(&run.colour[c][offset], count, &row.colour[c][first]);
  std::fill_n(&row.colour[3][first], count, 1.0f);
  std::fill_n(&row.colour[4][first], count, grainOf(slot));
  for (int i = nextMarked(row.kinds.data(), first, last, kPlainEdge); i < last;
       i = nextMarked(row.kinds.data(), i + 1, last, kPlainEdge)) {
    const cv::Vec3f& c = row.drawn[i].colour;
    row.set(i, {c[0], c[1], c[2], 1.0f});
  }
  return traits;
}

bool SurfaceShader::isThin(std::uint32_t id) const {
  return maps_[VisibilityBuffer::objectOf(id)]
      .of(VisibilityBuffer::triangleOf(id))
      .is(TriangleMap::kThin);
}

cv::Vec3f SurfaceShader::shadedThin(std::uint32_t id, int u, int v, SurfaceRun& run) const {
  const SurfacePlace place{id, static_cast<float>(u), static_cast<float>(v)};
  shadePlaces(&place, 1, VisibilityBuffer::objectOf(id), run);
  return {run.colour[0][0], run.colour[1][0], run.colour[2][0]};
}

// Reflectance of the pixels [first, last) of row v at their places in row.run.
// @param traits of their triangles
void SurfaceShader::reflectStretch(unsigned traits, int v, int first, int last, int slot,
                                   Row& row) const {
  const int offset = (first + region_.x) % kLightStep;
  const std::optional<cv::Vec3f>& albedo = frame_.objects[slot].look.albedo;
  SurfaceRun& run = row.run;
  if (albedo) {
    for (int c = 0; c < 3; ++c) std::fill_n(&run.colour[c][offset], last - first, (*albedo)[c]);
    return;
  }
  const Appearance& appearance = appearanceOf(slot);
  if ((traits & TriangleMap::kPictured) != 0)
    kernels().sample(appearance.albedo, offset, offset + last - first, run);
  if ((traits & TriangleMap::kTextured) != 0) addTexture(v, first, last, slot, row);
}

// What the texture says of their reflectance.
void SurfaceShader::addTexture(int v, int first, int last, int slot, Row& row) const {
  const SurfaceTexture& texture = appearanceOf(slot).texture;
  const int offset = (first + region_.x) % kLightStep;
  const std::uint32_t* ids = centre_.ids(v - region_.y);
  for (int i = first; i < last; ++i) {
    const int triangle = VisibilityBuffer::triangleOf(ids[i]);
    const TriangleMap& map = maps_[slot].of(triangle);
    if (!map.is(TriangleMap::kTextured) || map.is(TriangleMap::kThin)) continue;
    const Eigen::Vector3f weights =
        barycentric(frame_.objects[slot].actor.screen, triangle, static_cast<float>(i + region_.x),
                    static_cast<float>(v));
    row.run.mix(offset + i - first, texture.at(triangle, weights), map.is(TriangleMap::kPictured));
  }
}

void SurfaceShader::shadePlaces(const SurfacePlace* places, int count, int slot,
                                SurfaceRun& run) const {
  Eigen::Vector3f weights[SurfaceRun::kMost];
  maps_[slot].locate(places, count, run, weights);
  reflectPlaces(places, count, slot, weights, run);
  const Eigen::Vector3f axis = frame_.input.camera.world_from_camera.linear().col(2).cast<float>();
  int uneven[SurfaceRun::kMost], found = 0;
  for (int k = 0; k < count; ++k) {
    const float depth =
        axis.x() * run.sight[0][k] + axis.y() * run.sight[1][k] + axis.z() * run.sight[2][k];
    const auto sun = sun_.between(places[k].u, places[k].v, 1.0f / depth, slot);
    run.sun[k] = sun.value_or(0.0f);
    if (!sun) uneven[found++] = k;
  }
  sun_.onPlaces(uneven, found, nullptr, run);
  kernels().shade(shades_[slot], 0, count, run);
}

// Reflectance of places of one object, run.colour.
// @param weights barycentric, of each place
void SurfaceShader::reflectPlaces(const SurfacePlace* places, int count, int slot,
                                  const Eigen::Vector3f* weights, SurfaceRun& run) const {
  const Appearance& appearance = appearanceOf(slot);
  const std::optional<cv::Vec3f>& albedo = frame_.objects[slot].look.albedo;
  if (albedo) {
    for (int c = 0; c < 3; ++c) std::fill_n(run.colour[c], count, (*albedo)[c]);
    return;
  }
  kernels().sample(appearance.albedo, 0, count, run);
  for (int k = 0; k < count; ++k) {
    const int triangle = VisibilityBuffer::triangleOf(places[k].id);
    const Appearance::Source source = appearance.sources[triangle];
    if (source != Appearance::Source::kPicture)
      run.mix(k, appearance.texture.at(triangle, weights[k]), source == Appearance::Source::kBoth);
  }
}

}  // namespace calipso::render
