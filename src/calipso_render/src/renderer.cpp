#include "calipso_render/renderer.hpp"

#include <algorithm>
#include <stdexcept>

#include "frame/frame_compositor.hpp"
#include "place/blank_frames.hpp"
#include "place/exposure.hpp"
#include "place/view_warp.hpp"

namespace calipso::render {

Renderer::Renderer(std::shared_ptr<const Prepared> prepared, const RenderParams& params)
    : prepared_(std::move(prepared)),
      params_(params),
      caches_(std::make_unique<FrameCaches>()),
      meter_(std::make_unique<ExposureMeter>(prepared_->key_picture, prepared_->key_labels)) {}

Renderer::~Renderer() = default;

namespace {

// A surface that no frame of the clip shows; its colour comes from its look.
Surface surfaceOf(const ObjectInFrame& o) {
  ObjectModel model{o.name, -1, {}, Eigen::Isometry3d::Identity()};
  model.mesh.vertices.resize(static_cast<Eigen::Index>(o.vertices.size()), 3);
  model.mesh.triangles.resize(static_cast<Eigen::Index>(o.triangles.size()), 3);
  for (std::size_t i = 0; i < o.vertices.size(); ++i)
    model.mesh.vertices.row(i) = o.vertices[i].cast<double>().transpose();
  for (std::size_t t = 0; t < o.triangles.size(); ++t)
    model.mesh.triangles.row(t) = o.triangles[t].transpose();
  return makeSurface(model);
}

Appearance plainAppearance(const Surface& surface, const Camera& camera) {
  Appearance plain;
  plain.texture =
      SurfaceTexture(surface.key_vertices, surface.triangles, 1.0f, surface.triangles.size());
  plain.texture.texels.assign(plain.texture.size(), cv::Vec4f(0.5f, 0.5f, 0.5f, 0.0f));
  plain.key_camera = camera;
  plain.mean_light = cv::Vec3f(1.0f, 1.0f, 1.0f);
  plain.findSources();
  return plain;
}

FrameOutput unedited(const FrameInput& frame) {
  return {frame.bgr.clone(), cv::Mat::zeros(frame.bgr.size(), CV_8U)};
}

}  // namespace

// A copy is drawn like the object it was made from, an inserted object by its own triangles.
void Renderer::addNewcomers(const FrameInput& frame) {
  const auto find = [this](const std::string& name) {
    const std::vector<Surface>& all = prepared_->surfaces;
    return std::find_if(all.begin(), all.end(), [&](const Surface& s) { return s.name == name; }) -
           all.begin();
  };
  for (const ObjectInFrame& o : frame.objects) {
    const std::size_t count = prepared_->surfaces.size();
    const bool copied = !o.source.empty();
    if ((!copied && o.triangles.empty()) || static_cast<std::size_t>(find(o.name)) < count)
      continue;
    const std::size_t from = static_cast<std::size_t>(find(o.source));
    if (copied && from == count)
      throw std::invalid_argument("'" + o.name + "' is a copy of '" + o.source +
                                  "', which has no model");
    auto more = std::make_shared<Prepared>(*prepared_);
    Surface surface = copied ? more->surfaces[from] : surfaceOf(o);
    surface.name = o.name;
    surface.index = -1;
    surface.in_video = false;
    more->appearances.push_back(copied ? more->appearances[from]
                                       : plainAppearance(surface, more->camera));
    more->surfaces.push_back(std::move(surface));
    more->moves.push_back(true);
    more->outlines.emplace_back();
    more->fronts.emplace_back();
    more->footprints.emplace_back();
    prepared_ = std::move(more);
  }
}

FrameOutput Renderer::composite(const FrameInput& frame) {
  const bool touched = std::any_of(frame.objects.begin(), frame.objects.end(),
                                   [](const ObjectInFrame& o) { return o.edited || o.removed; });
  if (!touched) return unedited(frame);
  const cv::Size expected(prepared_->camera.width, prepared_->camera.height);
  if (!frame.labels.empty() && frame.labels.size() != frame.bgr.size())
    throw std::invalid_argument("segmentation and frame differ in size");
  if (frame.bgr.size() != expected) {
    throw std::invalid_argument("frame is " + std::to_string(frame.bgr.cols) + " x " +
                                std::to_string(frame.bgr.rows) + ", but the clip was " +
                                std::to_string(expected.width) + " x " +
                                std::to_string(expected.height) + "; play both at one size");
  }
  if (isBlankAgainst(frame.bgr, prepared_->background.plate)) return unedited(frame);
  addNewcomers(frame);
  if (!prepared_->camera_moves && sameView(prepared_->camera, frame.camera)) {
    const cv::Mat& labels = frame.labels.empty() ? prepared_->key_labels : frame.labels;
    if (const auto gain = meter_->gainOf(frame.bgr, labels)) return compositeAt(*gain, frame);
  }
  return FrameCompositor(*prepared_, params_, frame, *caches_).run();
}

FrameOutput Renderer::compositeAt(const cv::Vec3f& gain, const FrameInput& frame) {
  FrameInput even = frame;
  even.bgr = exposedAsKey(frame.bgr, gain);
  FrameOutput output = FrameCompositor(*prepared_, params_, even, *caches_).run();
  output.bgr = exposedBy(output.bgr, gain);
  frame.bgr.copyTo(output.bgr, output.provenance == kOriginal);
  return output;
}

}  // namespace calipso::render
