#include "frame/staged_frame.hpp"

#include <algorithm>
#include <opencv2/core/hal/intrin.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "frame/mask_morphology.hpp"
#include "model_details.hpp"
#include "place/view_warp.hpp"
#include "smooth_step.hpp"

namespace calipso::render {
namespace {

constexpr int kRestReach = 2;  // px: what lies that near to a change may take part in it
constexpr int kSameCodes = 8;  // code values, mean over 3 x 3 pixels, that noise may make
// part of an object's mask that lies within its outline if that is right
constexpr float kSeenWithin = 0.8f;

Light lightOf(const Prepared& prepared, const SunChange& sun) {
  Light light = prepared.light.light;
  if (sun.direction) light.direction = sun.direction->normalized();
  light.sun *= sun.factor;
  return light;
}

// A perfect mirror would show the sun nowhere but in one direction: that far it is no mirror.
constexpr float kSmoothest = 0.02f;

Gloss glossOf(const Gloss& own, const Look& look) {
  return {look.specular.value_or(own.specular),
          std::max(kSmoothest, look.roughness.value_or(own.roughness)),
          look.specular ? std::min(*look.specular, kAllAround) : own.around};
}

// @return per surface; nullptr: as in the video, at rest
std::vector<const ObjectInFrame*> statesOf(const std::vector<Surface>& surfaces,
                                           const std::vector<ObjectInFrame>& objects) {
  std::vector<const ObjectInFrame*> states(surfaces.size(), nullptr);
  for (const ObjectInFrame& o : objects) {
    const auto it = std::find_if(surfaces.begin(), surfaces.end(),
                                 [&](const Surface& s) { return s.name == o.name; });
    if (it == surfaces.end() && o.removed) continue;  // gone before it was ever drawn
    if (it == surfaces.end())
      throw std::invalid_argument("state names object '" + o.name + "', which has no model");
    states[it - surfaces.begin()] = &o;
  }
  return states;
}

// Where the frame differs from the key frame around what either shows of an object. CV_8UC1
cv::Mat differenceFromKey(const StagedFrame& frame, cv::Rect box) {
  box = grown(box, kRestReach) & frame.whole();
  cv::Mat picture, key_picture, different;
  cv::blur(frame.input.bgr(box), picture, {3, 3});
  cv::blur(frame.prepared.key_picture(box), key_picture, {3, 3});
  cv::absdiff(picture, key_picture, picture);
  cv::inRange(picture, cv::Scalar(), cv::Scalar::all(kSameCodes), different);
  cv::bitwise_not(different, different);
  cv::morphologyEx(different, different, cv::MORPH_OPEN, cv::Mat::ones(3, 3, CV_8U));
  cv::Mat whole = cv::Mat::zeros(frame.labels.size(), CV_8U);
  cv::dilate(different, whole(box), disc(kRestReach));
  return whole;
}

// Whether the video has an object, or a part of one that moves or sways, where the key frame has
// it. Adds to frame.elsewhere where not.
bool findRest(int surface, StagedFrame& frame) {
  const Prepared& prepared = frame.prepared;
  if (!prepared.surfaces[surface].in_video) return false;
  const bool moves = prepared.moves[surface];
  if (!moves && !prepared.sways[surface]) return true;
  if (!frame.edited[surface] || !frame.at_key_camera) return !moves;
  const int index = prepared.surfaces[surface].index;
  const cv::Mat now = frame.labels == index, key = prepared.key_labels == index;
  const cv::Rect box = cv::boundingRect(now | key);
  if (box.empty()) return false;
  const cv::Mat elsewhere = differenceFromKey(frame, box), same = now & ~elsewhere;
  if (cv::countNonZero(same) == 0) return false;
  frame.elsewhere = frame.elsewhere.empty() ? elsewhere : cv::Mat(frame.elsewhere | elsewhere);
  return true;
}

// World, m. @param state nullptr: as in the video, at rest
Points verticesNow(const Prepared& prepared, int surface, const ObjectInFrame* state) {
  const Surface& s = prepared.surfaces[surface];
  if (state != nullptr && state->edited) return withDetails(s, state->vertices);
  if (state != nullptr && prepared.moves[surface])
    return transformed(s.object_vertices, state->world_from_object);
  return s.key_vertices;
}

// Adds the object if the frame's picture can show it.
void stageObject(int surface, const ObjectInFrame* state, StagedFrame& frame) {
  const Prepared& prepared = frame.prepared;
  const Surface& s = prepared.surfaces[surface];
  if (state != nullptr ? state->removed : !s.in_video) return;
  Points vertices = verticesNow(prepared, surface, state);
  const bool edited = frame.edited[surface];
  if (!edited && prepared.moves[surface] && !frame.isSeenAt(surface, vertices)) return;
  if (vertices.size() != s.key_vertices.size()) {
    throw std::invalid_argument("object '" + s.name + "': state has " +
                                std::to_string(vertices.size()) + " vertices, its model " +
                                std::to_string(s.key_vertices.size() - s.detailVertices()));
  }
  const Look look = state != nullptr ? state->look : Look();
  const Camera& camera = frame.input.camera;
  frame.objects.push_back({makeActor(s, std::move(vertices), camera), surface, edited, look,
                           glossOf(prepared.appearances[surface].gloss, look),
                           edited && frame.at_rest[surface]
                               ? projectMesh(s.key_vertices, s.triangles, camera)
                               : ScreenMesh{}});
}

std::vector<bool> movedSurfaces(const StagedFrame& frame) {
  std::vector<bool> moved = frame.edited;
  const auto isNear = [](const Eigen::Vector3f& a, const Eigen::Vector3f& b) {
    return (a - b).head<2>().norm() < kMovedPx;
  };
  for (const StagedObject& object : frame.objects) {
    const Points &now = object.actor.screen.points, &then = object.observed.points;
    if (object.isAtRestInVideo() && std::equal(now.begin(), now.end(), then.begin(), isNear))
      moved[object.surface] = false;
  }
  return moved;
}

std::optional<Points> observedPlace(const StagedFrame& frame, int surface) {
  const Surface& s = frame.prepared.surfaces[surface];
  const ObjectInFrame* state = frame.states[surface];
  if (!frame.edited[surface] || !frame.prepared.moves[surface] || !s.in_video || state == nullptr ||
      !state->observed)
    return std::nullopt;
  const Points vertices = transformed(s.object_vertices, *state->observed);
  return frame.isSeenAt(surface, vertices) ? std::optional<Points>(vertices) : std::nullopt;
}

// Whether an edited object is where the video has it as it moves, under the video's sun.
bool isAsObserved(const StagedFrame& frame, const StagedObject& object) {
  const auto& observed = frame.observed[object.surface];
  const Points& now = object.actor.vertices;
  if (!frame.params.keep_still || !object.edited || !observed || observed->size() != now.size() ||
      frame.light.direction != frame.prepared.light.light.direction)
    return false;
  const auto focal = static_cast<float>(frame.input.camera.fx);
  for (std::size_t i = 0; i < now.size(); ++i) {
    const float px_per_m = focal * object.actor.screen.points[i].z();
    if (!((now[i] - (*observed)[i]).norm() * px_per_m < kMovedPx)) return false;
  }
  return true;
}

}  // namespace

StagedFrame::StagedFrame(const Prepared& prepared, const RenderParams& params,
                         const FrameInput& input)
    : prepared(prepared),
      params(params),
      input(input),
      light(lightOf(prepared, input.sun)),
      labels(input.labels.empty() ? prepared.key_labels : input.labels),
      at_key_camera(sameView(input.camera, prepared.camera)),
      eye(input.camera.world_from_camera.translation().cast<float>()) {
  states = statesOf(prepared.surfaces, input.objects);
  for (const ObjectInFrame* state : states)
    edited.push_back(state != nullptr && (state->edited || state->removed));
  const int count = static_cast<int>(states.size());
  for (int i = 0; i < count; ++i) at_rest.push_back(findRest(i, *this));
  for (int i = 0; i < count; ++i) stageObject(i, states[i], *this);
  moved = movedSurfaces(*this);
  for (int i = 0; i < count; ++i) observed.push_back(observedPlace(*this, i));
  follows.assign(count, false);
  for (const StagedObject& object : objects) follows[object.surface] = isAsObserved(*this, object);
}

bool StagedFrame::isSeenAt(int surface, const Points& vertices) const {
  const Surface& s = prepared.surfaces[surface];
  const cv::Mat seen = labels == s.index;
  const cv::Rect box = cv::boundingRect(seen);
  if (box.empty()) return true;  // something hides it
  const ScreenMesh mesh = projectMesh(vertices, s.triangles, input.camera);
  const VisibilityBuffer outline(box, {&mesh});
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

bool StagedFrame::movesInVideo() const {
  for (std::size_t i = 0; i < edited.size(); ++i) {
    if (edited[i] && prepared.moves[i] && prepared.surfaces[i].in_video) return true;
  }
  return false;
}

Eigen::Vector2f StagedFrame::movement(std::uint32_t id, float u, float v) const {
  const StagedObject& object = objectOf(id);
  const ScreenMesh& now = object.actor.screen;
  const int triangle = VisibilityBuffer::triangleOf(id);
  const Eigen::Vector3i& t = object.actor.surface->triangles[triangle];
  const Eigen::Vector3f w = barycentric(now, triangle, u, v);
  Eigen::Vector2f moved = Eigen::Vector2f::Zero();
  for (int i = 0; i < 3; ++i)
    moved += w[i] * (now.points[t[i]] - object.observed.points[t[i]]).head<2>();
  return moved;
}

float StagedFrame::stillness(std::uint32_t id, float u, float v) const {
  const StagedObject& object = objectOf(id);
  if (!object.isAtRestInVideo()) return 0.0f;
  const float moved = smoothStep(kStillPx, kMovedPx, movement(id, u, v).norm());
  if (moved == 1.0f) return 0.0f;
  const Actor& actor = object.actor;
  const int triangle = VisibilityBuffer::triangleOf(id);
  const Eigen::Vector3i& corners = actor.surface->corners[triangle];
  const Eigen::Vector3f w = barycentric(actor.screen, triangle, u, v);
  Eigen::Vector3f turned = Eigen::Vector3f::Zero();
  for (int i = 0; i < 3; ++i)
    turned += w[i] * (actor.normals[corners[i]] - actor.surface->key_normals[corners[i]]);
  return (1.0f - moved) * (1.0f - smoothStep(kStillTurn, kTurned, turned.norm()));
}

bool mayMoveLess(const Points& now, const Points& then, const Eigen::Vector3i& triangle, float px) {
  const auto moved = [&](int i) {  // u, v, 0, 0
    return cv::v_load_low(now[triangle[i]].data()) - cv::v_load_low(then[triangle[i]].data());
  };
  const cv::v_float32x4 a = moved(0), b = moved(1), c = moved(2),
                        low = cv::v_min(cv::v_min(a, b), c), high = cv::v_max(cv::v_max(a, b), c);
  return cv::v_check_all((low < cv::v_setall_f32(px)) & (high > cv::v_setall_f32(-px)));
}

}  // namespace calipso::render
