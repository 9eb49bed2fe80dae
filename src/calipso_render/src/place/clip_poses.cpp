#include "calipso_render/clip_poses.hpp"

#include <algorithm>

#include "calipso_render/rasterizer.hpp"

namespace calipso::render {
namespace {

constexpr double kOfKeyOverlap = 0.7;  // by which what rests has to overlap its mask

// Of the model drawn at a pose with the object's mask; what another object's mask covers does not
// count.
double overlap(const ObjectModel& model, const ObjectPose& pose, const ClipFrame& frame) {
  Points vertices;
  Triangles triangles;
  for (int i = 0; i < model.mesh.vertexCount(); ++i)
    vertices.push_back((pose.world_from_object * model.mesh.vertex(i)).cast<float>());
  for (int t = 0; t < model.mesh.triangleCount(); ++t)
    triangles.push_back(model.mesh.triangles.row(t));
  const ScreenMesh mesh = projectMesh(vertices, triangles, frame.camera);
  const VisibilityBuffer buffer({0, 0, frame.labels.cols, frame.labels.rows}, {&mesh});
  long both = 0, either = 0;
  for (int v = 0; v < frame.labels.rows; ++v) {
    const std::uint32_t* ids = buffer.ids(v);
    const std::uint8_t* labels = frame.labels.ptr<std::uint8_t>(v);
    for (int u = 0; u < frame.labels.cols; ++u) {
      const bool drawn = ids[u] != VisibilityBuffer::kNothing, seen = labels[u] == pose.index;
      if (!seen && labels[u] != 0) continue;
      both += drawn && seen, either += drawn || seen;
    }
  }
  // Where neither has it, it has left the picture or is hidden.
  return either > 0 ? static_cast<double>(both) / static_cast<double>(either) : 1.0;
}

// Whether every frame says that the object is where the key frame has it.
bool restsThroughout(const PosesByStamp& poses, const ObjectModel& model) {
  return std::all_of(poses.begin(), poses.end(), [&](const auto& frame) {
    return std::any_of(frame.second.begin(), frame.second.end(), [&](const ObjectPose& pose) {
      return pose.index == model.index &&
             pose.world_from_object.isApprox(model.world_from_object, 1e-6);
    });
  });
}

}  // namespace

PosesTaken takePoses(const PosesByStamp& poses, const std::vector<ObjectModel>& models,
                     ClipSample& clip, double least) {
  PosesTaken taken;
  std::map<int, double> needed;
  for (const ObjectModel& m : models) {
    needed[m.index] = least;
    if (!restsThroughout(poses, m)) continue;
    const double at_key = overlap(m, {m.index, m.world_from_object}, clip.frames().front());
    needed[m.index] = std::min(least, kOfKeyOverlap * at_key);
  }
  for (std::size_t i = 0; i < clip.frames().size(); ++i) {
    const ClipFrame& frame = clip.frames()[i];
    const auto here = poses.find(frame.stamp_ns);
    if (here == poses.end()) continue;
    std::vector<ObjectPose> fitting;
    for (const ObjectPose& pose : here->second) {
      const auto model = std::find_if(models.begin(), models.end(),
                                      [&](const ObjectModel& m) { return m.index == pose.index; });
      if (model == models.end()) continue;
      ++taken.offered;
      const double fit = overlap(*model, pose, frame);
      if (fit < needed[pose.index]) continue;
      ++taken.accepted;
      taken.worst_accepted_overlap = std::min(taken.worst_accepted_overlap, fit);
      fitting.push_back(pose);
    }
    clip.setPoses(i, fitting);
  }
  return taken;
}

}  // namespace calipso::render
