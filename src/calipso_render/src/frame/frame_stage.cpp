// The part of FrameCompositor that stages a frame: who is where, and which pixels that can change.

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "calipso_render/colour.hpp"
#include "draw/side_by_side.hpp"
#include "frame/frame_compositor.hpp"
#include "place/key_cover.hpp"
#include "place/place_depth.hpp"
#include "place/view_warp.hpp"

namespace calipso::render {
namespace {

constexpr int kRegionMargin = 8;  // px
constexpr int kRestReach = 2;     // px: what lies that near to a change may take part in it
constexpr int kSameCodes = 8;     // code values, mean over 3 x 3 pixels, that noise may make
// part of an object's mask that lies within its outline if that is right
constexpr float kSeenWithin = 0.8f;

cv::Rect grown(const cv::Rect& r, int margin) {
  return {r.x - margin, r.y - margin, r.width + 2 * margin, r.height + 2 * margin};
}

// Bounding box of an object's pixels.
cv::Rect boxOf(const cv::Mat& labels, int index) {
  if (index < 0) return {};  // the video does not have it
  int left = labels.cols, right = -1, top = labels.rows, bottom = -1;
  for (int v = 0; v < labels.rows; ++v) {
    const std::uint8_t* row = labels.ptr<std::uint8_t>(v);
    const void* first = std::memchr(row, index, labels.cols);
    if (first == nullptr) continue;
    top = std::min(top, v), bottom = v;
    left = std::min(left, static_cast<int>(static_cast<const std::uint8_t*>(first) - row));
    const void* last = memrchr(row, index, labels.cols);
    right = std::max(right, static_cast<int>(static_cast<const std::uint8_t*>(last) - row));
  }
  return bottom < 0 ? cv::Rect() : cv::Rect({left, top}, cv::Point(right + 1, bottom + 1));
}

Gloss glossOf(const Gloss& own, const Look& look) {
  return {look.specular.value_or(own.specular), look.roughness.value_or(own.roughness),
          look.specular.value_or(own.around)};
}

}  // namespace

FrameCompositor::FrameCompositor(const Prepared& prepared, const RenderParams& params,
                                 const FrameInput& frame, ShadowCache& shadows, RestPicture& rest)
    : prepared_(prepared),
      params_(params),
      frame_(frame),
      shadows_(shadows),
      light_(lightOf(frame)),
      rest_(rest),
      labels_(frame.labels.empty() ? prepared.key_labels : frame.labels),
      eye_(frame.camera.world_from_camera.translation().cast<float>()),
      place_view_(PlaneView(params.planes, frame.camera)),
      codec_(params.add_noise ? prepared.noise : NoiseModel(), frame.stamp_ns) {
  if (labels_.size() != frame.bgr.size())
    throw std::invalid_argument("segmentation and frame differ in size");
}

FrameOutput FrameCompositor::run() {
  prepareFrame();
  if (region_.empty()) return {frame_.bgr.clone(), cv::Mat::zeros(frame_.bgr.size(), CV_8U)};
  findResidual();
  FrameOutput out{cv::Mat(frame_.bgr.size(), CV_8UC3), cv::Mat(frame_.bgr.size(), CV_8U)};
#pragma omp parallel
  {
    Row row;
#pragma omp for schedule(dynamic, 8)
    for (int v = 0; v < frame_.bgr.rows; ++v) {
      std::memcpy(out.bgr.ptr(v), frame_.bgr.ptr(v), 3 * static_cast<std::size_t>(frame_.bgr.cols));
      std::memset(out.provenance.ptr(v), kOriginal, frame_.bgr.cols);
      if (v >= region_.y && v < region_.br().y) composeRow(v, row, out);
    }
  }
  softenOutlines(out);
  return out;
}

void FrameCompositor::prepareFrame() {
  stage();
  findMirrored();
  prepareShadows();
  findShaded();
  findPassingShadows();
  chooseRegion();
  if (region_.empty()) return;
  findRemoved();
  drawVisibility();
  sideBySide(
      params_.quality == Quality::kLive,
      [this] {
        sampleEdges();
        findMaps();
        findSurfaceSun();
        findStill();
      },
      [this] {
        findCovered();
        measureLight();
        findScreened();
        findRelit();
      });
}

Light FrameCompositor::lightOf(const FrameInput& frame) const {
  Light light = prepared_.light.light;
  if (frame.sun.direction) light.direction = frame.sun.direction->normalized();
  light.sun *= frame.sun.factor;
  return light;
}

void FrameCompositor::stage() {
  stageStates();
  stageActors();
  stagePlace();
}

void FrameCompositor::stageStates() {
  const std::vector<Surface>& surfaces = prepared_.surfaces;
  states_.assign(surfaces.size(), nullptr);
  edited_.assign(surfaces.size(), false);
  for (const ObjectInFrame& o : frame_.objects) {
    const auto it = std::find_if(surfaces.begin(), surfaces.end(),
                                 [&](const Surface& s) { return s.name == o.name; });
    if (it == surfaces.end())
      throw std::invalid_argument("state names object '" + o.name + "', which has no model");
    states_[it - surfaces.begin()] = &o;
    edited_[it - surfaces.begin()] = o.edited || o.removed;
  }
  for (std::size_t i = 0; i < surfaces.size(); ++i)
    at_rest_.push_back(findRest(static_cast<int>(i)));
}

void FrameCompositor::stageActors() {
  const std::vector<Surface>& surfaces = prepared_.surfaces;
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    const ObjectInFrame* o = states_[i];
    if (o != nullptr ? o->removed : !surfaces[i].in_video) continue;
    Points vertices = surfaces[i].key_vertices;
    if (o != nullptr && o->edited)
      vertices = o->vertices;
    else if (o != nullptr && prepared_.moves[i])
      vertices = transformed(surfaces[i].object_vertices, o->world_from_object);
    if (!edited_[i] && prepared_.moves[i] && !isSeenAt(static_cast<int>(i), vertices)) continue;
    if (vertices.size() != surfaces[i].key_vertices.size()) {
      throw std::invalid_argument("object '" + surfaces[i].name + "': state has " +
                                  std::to_string(vertices.size()) + " vertices, its model " +
                                  std::to_string(surfaces[i].key_vertices.size()));
    }
    actors_.push_back(makeActor(surfaces[i], std::move(vertices), frame_.camera));
    surface_of_slot_.push_back(static_cast<int>(i));
    glosses_.push_back(
        glossOf(prepared_.appearances[i].gloss, lookOf(static_cast<int>(glosses_.size()))));
    const bool as_seen = edited_[i] && at_rest_[i];
    observed_.push_back(
        as_seen ? projectMesh(surfaces[i].key_vertices, surfaces[i].triangles, frame_.camera)
                : ScreenMesh{});
  }
}

// The place as this frame's camera sees it.
void FrameCompositor::stagePlace() {
  const std::size_t count = prepared_.surfaces.size();
  fronts_.assign(count, cv::Mat());
  footprints_.assign(count, cv::Mat());
  plate_ = prepared_.plate_linear;
  invented_ = prepared_.background.invented;
  const DriftingBackground& drifting = prepared_.background.drifting;
  if (const auto shift = drifting.shiftAt(frame_.stamp_ns)) {
    plate_ = plate_.clone(), invented_ = invented_.clone();
    drifting.draw(*shift, plate_, invented_);
    if (sameView(frame_.camera, prepared_.camera))
      drifting.matchTo(frame_.bgr, grown(labels_ != 0, params_.background.mask_margin_px), plate_);
    drifts_ = drifting.where();
  } else if (drifting.established()) {
    // Where it has drifted to is not known: what comes to light is filled from the frame at hand.
    invented_ = invented_ | drifting.where();
  }
  if (sameView(frame_.camera, prepared_.camera)) {
    live_ = prepared_.background.live.empty() ? nullptr : &prepared_.background.live;
    shadowless_ = prepared_.shadowless;
    place_view_ = PlaceView(place_view_.planes(), prepared_.relief);
    for (std::size_t i = 0; i < count; ++i) {
      if (prepared_.fronts[i].empty() || (prepared_.moves[i] && !at_rest_[i])) continue;
      fronts_[i] =
          elsewhere_.empty() ? prepared_.fronts[i] : cv::Mat(prepared_.fronts[i] & ~elsewhere_);
    }
    footprints_ = prepared_.footprints;
  } else {
    const cv::Mat map = viewWarp(nearnessFrom(prepared_.nearness, prepared_.camera, frame_.camera),
                                 prepared_.camera, frame_.camera);
    cv::Mat plate, invented;
    cv::remap(plate_, plate, map, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
    cv::remap(invented_, invented, map, cv::noArray(), cv::INTER_NEAREST, cv::BORDER_CONSTANT,
              cv::Scalar(255));
    plate_ = plate, invented_ = invented, view_from_key_ = map;
    place_view_ = PlaceView(place_view_.planes(), warped(prepared_.relief, map));
  }
}

// Whether the video shows an object where its state has it: most of what is seen of it lies within
// its outline there.
bool FrameCompositor::isSeenAt(int surface, const Points& vertices) const {
  const cv::Mat seen = labels_ == prepared_.surfaces[surface].index;
  const cv::Rect box = cv::boundingRect(seen);
  if (box.empty()) return true;  // something hides it
  VisibilityBuffer outline(box);
  outline.draw(projectMesh(vertices, prepared_.surfaces[surface].triangles, frame_.camera), 0);
  int within = 0, all = 0;
  for (int v = 0; v < box.height; ++v) {
    const std::uint8_t* row = seen.ptr<std::uint8_t>(box.y + v) + box.x;
    for (int u = 0; u < box.width; ++u) {
      if (row[u] == 0) continue;
      ++all, within += outline.ids(v)[u] != VisibilityBuffer::kNothing;
    }
  }
  return within >= kSeenWithin * all;
}

// Whether the video has an object, or a part of one that moves or sways, where the key frame has
// it. Adds to elsewhere_ where not.
bool FrameCompositor::findRest(int surface) {
  if (!prepared_.surfaces[surface].in_video) return false;
  const bool moves = prepared_.moves[surface];
  if (!moves && !prepared_.sways[surface]) return true;
  if (!edited_[surface] || !sameView(frame_.camera, prepared_.camera)) return !moves;
  const int index = prepared_.surfaces[surface].index;
  const cv::Mat now = labels_ == index, key = prepared_.key_labels == index, either = now | key;
  cv::Rect box = cv::boundingRect(either);
  if (box.empty()) return false;
  box = cv::Rect(box.x - kRestReach, box.y - kRestReach, box.width + 2 * kRestReach,
                 box.height + 2 * kRestReach) &
        cv::Rect(cv::Point(), either.size());
  cv::Mat picture, key_picture, different;
  cv::blur(frame_.bgr(box), picture, {3, 3});
  cv::blur(prepared_.key_picture(box), key_picture, {3, 3});
  cv::absdiff(picture, key_picture, picture);
  cv::inRange(picture, cv::Scalar(), cv::Scalar::all(kSameCodes), different);
  cv::bitwise_not(different, different);
  cv::morphologyEx(different, different, cv::MORPH_OPEN, cv::Mat::ones(3, 3, CV_8U));
  cv::Mat elsewhere = cv::Mat::zeros(either.size(), CV_8U), same;
  cv::dilate(different, elsewhere(box), disc(kRestReach));
  same = now & ~elsewhere;
  if (cv::countNonZero(same) == 0) return false;
  elsewhere_ = elsewhere_.empty() ? elsewhere : elsewhere_ | elsewhere;
  return true;
}

void FrameCompositor::chooseRegion() {
  const cv::Size size = frame_.bgr.size();
  const cv::Rect all(0, 0, size.width, size.height);
  for (std::size_t i = 0; i < edited_.size(); ++i) {
    if (!edited_[i]) continue;
    shown_box_ |= boxOf(labels_, prepared_.surfaces[i].index);
  }
  if (!shown_box_.empty()) region_ |= grown(shown_box_, kRegionMargin);
  for (std::size_t slot = 0; slot < actors_.size(); ++slot) {
    const cv::Rect box = boundsOf(actors_[slot].screen, kRegionMargin, size);
    if (edited_[surface_of_slot_[slot]] || may_be_shaded_[slot]) region_ |= box;
    drawn_box_ |= box;
  }
  region_ |= shadows_.bounds | shadows_.shaded_box | moved_bounds_;
  if (!passing_.empty()) region_ |= cv::boundingRect(passing_);
  if (!remirrored_.empty()) region_ |= cv::boundingRect(remirrored_ == kChanged);
  region_ &= all, drawn_box_ &= region_;
  shown_box_ |= shadows_.footprints;
  if (!shown_box_.empty())
    shown_box_ = grown(shown_box_, params_.background.mask_margin_px) & region_;
}

void FrameCompositor::findMaps() {
  for (std::size_t slot = 0; slot < actors_.size(); ++slot) {
    const int surface = surface_of_slot_[slot];
    const bool seen = edited_[surface] ||
                      !(boundsOf(actors_[slot].screen, 0, frame_.bgr.size()) & region_).empty();
    maps_.push_back(seen ? SurfaceMaps(actors_[slot], prepared_.appearances[surface], light_, eye_)
                         : SurfaceMaps());
  }
}

void FrameCompositor::drawVisibility() {
  for (const int surface : surface_of_slot_)
    always_drawn_.push_back(edited_[surface] && fronts_[surface].empty());
  centre_.emplace(region_);
  for (std::size_t slot = 0; slot < actors_.size(); ++slot)
    centre_->draw(actors_[slot].screen, static_cast<int>(slot));
}

void FrameCompositor::sampleEdges() {
  edges_.emplace(*centre_, drawn_box_ - region_.tl());
  for (std::size_t slot = 0; slot < actors_.size(); ++slot) {
    if (edited_[surface_of_slot_[slot]])
      edges_->chooseSilhouette(actors_[slot].screen, actors_[slot].surface->edges, *centre_);
  }
  for (std::size_t slot = 0; slot < actors_.size(); ++slot)
    edges_->draw(actors_[slot].screen, static_cast<int>(slot));
  edges_->settle(*centre_);
}

}  // namespace calipso::render
