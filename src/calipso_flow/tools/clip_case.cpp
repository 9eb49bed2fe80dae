#include "clip_case.hpp"

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <stdexcept>

#include "aligned_models.hpp"
#include "calipso_scene/attachment.hpp"

namespace calipso::flow {
namespace {

// The camera of a picture whose pixels were each divided into scale x scale.
Camera enlarged(Camera camera, int scale) {
  camera.width *= scale, camera.height *= scale;
  camera.fx *= scale, camera.fy *= scale;
  camera.cx = scale * (camera.cx + 0.5) - 0.5, camera.cy = scale * (camera.cy + 0.5) - 0.5;
  return camera;
}

constexpr double kPlacementOff = 0.05;

double meanDepth(const TriangleMesh& mesh, const Eigen::Isometry3d& camera_from_object) {
  double sum = 0.0;
  for (int i = 0; i < mesh.vertexCount(); ++i) sum += (camera_from_object * mesh.vertex(i)).z();
  return sum / mesh.vertexCount();
}

// The true surface grown about the camera until it has the rough placement's depth: the best that a
// fit to the picture can do while the depth is held.
ObjectModel heldAtDepth(const SceneObject& object, const Camera& camera, ObjectModel model) {
  const Eigen::Isometry3d camera_from_world = camera.world_from_camera.inverse();
  const double held =
      meanDepth(loadMesh(object.cad_path), camera_from_world * object.initial_world_from_object);
  const double factor = held / meanDepth(model.mesh, camera_from_world * model.world_from_object);
  const Eigen::Vector3d eye = camera.world_from_camera.translation();
  const Eigen::Vector3d sight = model.world_from_object.translation() - eye;
  // A rough placement is off by 5 % of the distance in any direction.
  model.position_covariance = kPlacementOff * kPlacementOff / 3.0 * sight * sight.transpose();
  model.mesh.vertices *= factor;
  model.world_from_object.translation() =
      eye + factor * (model.world_from_object.translation() - eye);
  return model;
}

// The same surface with the true object's frame, so that poses compare.
ObjectModel inFrame(const Eigen::Isometry3d& world_from_object, ObjectModel model) {
  const Eigen::Isometry3d change = world_from_object.inverse() * model.world_from_object;
  for (int i = 0; i < model.mesh.vertexCount(); ++i) {
    model.mesh.vertices.row(i) = (change * model.mesh.vertex(i)).transpose();
  }
  model.world_from_object = world_from_object;
  return model;
}

// @param aligned  of this object; read when `models` asks for it
ObjectModel modelOf(const Scene& scene, const SceneObject& object, const TrueObject& truth,
                    const std::string& models, const std::optional<AlignedModel>& aligned) {
  const Eigen::Isometry3d& pose = truth.world_from_object.front();
  if (aligned) return inFrame(pose, aligned->model);
  ObjectModel model;
  model.name = object.name;
  model.index = object.index;
  if (models == "true" || models == "held") {
    model.world_from_object = pose;
    model.mesh = loadMesh(truth.mesh_path);
    return models == "true" ? model : heldAtDepth(object, scene.camera, model);
  }
  model.mesh = loadMesh(models + "/" + object.name + ".obj");
  return inFrame(pose, model);
}

cv::Mat maskOf(const TrueObject& truth, const std::optional<AlignedModel>& aligned, int scale) {
  cv::Mat mask;
  if (aligned) {
    mask = aligned->mask;
  } else if (!truth.mask_path.empty()) {
    mask = cv::imread(truth.mask_path, cv::IMREAD_GRAYSCALE);
  }
  if (!mask.empty()) cv::resize(mask, mask, {}, scale, scale, cv::INTER_NEAREST);
  return mask;
}

}  // namespace

cv::Mat ClipCase::frame(int k) const {
  const std::string path = scene.framePath(k);
  cv::Mat picture = cv::imread(path, cv::IMREAD_COLOR);
  if (picture.empty()) throw std::runtime_error(path + " is no picture that can be read");
  perturbation.addGrain(k, picture);
  if (scale > 1) cv::resize(picture, picture, {}, scale, scale, cv::INTER_CUBIC);
  return picture;
}

ClipCase loadClipCase(const std::string& directory, const std::string& models, int scale,
                      const Perturbation& perturbation) {
  ClipCase clip{loadScene(directory), scale, perturbation, {}, {}, {}};
  const Scene& scene = clip.scene;
  std::vector<std::optional<AlignedModel>> aligned(scene.objects.size());
  if (models == "aligned") {
    std::vector<AlignedModel> fits = alignedModels(scene, perturbation);
    std::move(fits.begin(), fits.end(), aligned.begin());
  }
  for (size_t i = 0; i < scene.objects.size(); ++i) {
    const SceneObject& object = scene.objects[i];
    const std::optional<TrueObject> truth = readTruth(directory, object.name);
    if (!truth) continue;
    clip.models.push_back(modelOf(scene, object, *truth, models, aligned[i]));
    ObjectModel& model = clip.models.back();
    model.attached = attachedVertices(model.mesh, model.world_from_object, object.attachments);
    clip.masks.push_back(maskOf(*truth, aligned[i], scale));
    clip.truths.push_back(*truth);
  }
  if (clip.truths.empty()) throw std::runtime_error(directory + " holds no truth to compare with");
  clip.scene.camera = enlarged(scene.camera, scale);
  return clip;
}

}  // namespace calipso::flow
