#include "draw/ray_scene.hpp"

#include <embree3/rtcore.h>

#include <Eigen/Geometry>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>

namespace calipso::render {
namespace {

constexpr float kLift = 1e-3f;  // of the scene's radius: rays start that far off the surface

// One single-threaded device for the process: the renderer's own loops use the cores.
RTCDevice device() {
  static const RTCDevice shared = rtcNewDevice("threads=1");
  if (shared == nullptr)
    throw std::runtime_error(
        "Embree has no device on this machine: neither light nor final frames are possible");
  return shared;
}

}  // namespace

struct RayScene::Handle {
  RTCScene scene = rtcNewScene(device());
  ~Handle() { rtcReleaseScene(scene); }
  void add(const Occluder& occluder) const {
    RTCGeometry geometry = rtcNewGeometry(device(), RTC_GEOMETRY_TYPE_TRIANGLE);
    const std::size_t points = occluder.vertices->size(), faces = occluder.triangles->size();
    void* vertices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                             3 * sizeof(float), points);
    void* indices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                            3 * sizeof(unsigned), faces);
    if (vertices == nullptr || indices == nullptr)
      throw std::runtime_error("Embree could not take a mesh of " + std::to_string(faces) +
                               " triangles");
    std::memcpy(vertices, occluder.vertices->data(), points * 3 * sizeof(float));
    std::memcpy(indices, occluder.triangles->data(), faces * 3 * sizeof(unsigned));
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
  }
};

RayScene::RayScene(const std::vector<Occluder>& occluders) {
  Eigen::AlignedBox3f box;
  for (const Occluder& o : occluders) {
    if (o.triangles->empty()) continue;
    if (!handle_) handle_ = std::make_unique<Handle>();
    handle_->add(o);
    for (const Eigen::Vector3f& p : *o.vertices) box.extend(p);
  }
  if (!handle_) return;
  rtcSetSceneFlags(handle_->scene, RTC_SCENE_FLAG_ROBUST);
  rtcCommitScene(handle_->scene);
  centre_ = box.center();
  radius_ = 0.5f * box.diagonal().norm();
}

RayScene::~RayScene() = default;
RayScene::RayScene(RayScene&&) noexcept = default;

bool RayScene::blocked(const Eigen::Vector3f& p, const Eigen::Vector3f& n,
                       const Eigen::Vector3f& d) const {
  if (!handle_) return false;
  const Eigen::Vector3f from = p + n * (kLift * radius_), to_centre = centre_ - from;
  const float along = to_centre.dot(d);
  if (to_centre.squaredNorm() - along * along > radius_ * radius_ || along < -radius_) return false;
  return blocked(from, d);
}

bool RayScene::blocked(const Eigen::Vector3f& from, const Eigen::Vector3f& d) const {
  if (!handle_) return false;
  RTCRay r{};
  r.org_x = from.x(), r.org_y = from.y(), r.org_z = from.z();
  r.dir_x = d.x(), r.dir_y = d.y(), r.dir_z = d.z();
  r.tnear = 0.0f, r.tfar = std::numeric_limits<float>::infinity(), r.mask = ~0u;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(handle_->scene, &context, &r);
  return r.tfar < 0.0f;
}

std::optional<RayScene::Hit> RayScene::hit(const Eigen::Vector3f& p, const Eigen::Vector3f& n,
                                           const Eigen::Vector3f& d) const {
  if (!handle_) return std::nullopt;
  const Eigen::Vector3f from = p + n * (kLift * radius_);
  RTCRayHit r{};
  r.ray.org_x = from.x(), r.ray.org_y = from.y(), r.ray.org_z = from.z();
  r.ray.dir_x = d.x(), r.ray.dir_y = d.y(), r.ray.dir_z = d.z();
  r.ray.tnear = 0.0f, r.ray.tfar = std::numeric_limits<float>::infinity(), r.ray.mask = ~0u;
  r.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(handle_->scene, &context, &r);
  if (r.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
  const Eigen::Vector3f normal(r.hit.Ng_x, r.hit.Ng_y, r.hit.Ng_z);
  return Hit{static_cast<int>(r.hit.geomID), static_cast<int>(r.hit.primID), r.hit.u, r.hit.v,
             normal.dot(d) > 0.0f};
}

}  // namespace calipso::render
