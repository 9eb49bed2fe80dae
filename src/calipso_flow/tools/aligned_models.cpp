#include "aligned_models.hpp"

#include "calipso_align/depth_image.hpp"
#include "calipso_align/key_frame.hpp"

namespace calipso::flow {

std::vector<AlignedModel> alignedModels(const Scene& scene, const Perturbation& perturbation) {
  cv::Mat image = align::loadKeyImage(scene);
  perturbation.addGrain(0, image);
  align::Segmenter segmenter = align::makeSegmenter(image, scene, true);
  const align::KeyFrame key = align::segmentKeyFrame(image, segmenter, align::loadStrokes(scene));
  std::vector<AlignedModel> models;
  for (size_t k = 0; k < scene.objects.size(); ++k) {
    const SceneObject& object = scene.objects[k];
    align::AlignOptions options;
    options.planes = scene.planes;
    options.depth = align::loadDepth(scene);
    const align::AlignmentResult fit = align::align(
        loadMesh(object.cad_path), scene.camera,
        perturbation.nudged(object.initial_world_from_object, scene.camera, object.index),
        key.contours[k].loops, options);
    AlignedModel aligned;
    aligned.model.name = object.name;
    aligned.model.index = object.index;
    aligned.model.mesh = fit.mesh;
    aligned.model.world_from_object = fit.world_from_object;
    aligned.model.position_covariance = fit.covariance.topLeftCorner<3, 3>();
    aligned.mask = key.labels == object.index;
    models.push_back(std::move(aligned));
  }
  return models;
}

}  // namespace calipso::flow
