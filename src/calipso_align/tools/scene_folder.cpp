#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "alignment_folder.hpp"
#include "calipso_align/depth_image.hpp"
#include "calipso_align/key_frame.hpp"
#include "calipso_align/metrics.hpp"

namespace calipso::align {
namespace {

namespace fs = std::filesystem;

cv::Mat1b trueMask(const Scene& scene, const std::string& object) {
  const std::string path = scene.directory + "/masks/" + object + "_000000.png";
  if (!fs::exists(path)) return {};
  return cv::imread(path, cv::IMREAD_GRAYSCALE) > 127;
}

// Labels of all objects as the true masks have them; empty when one is missing.
cv::Mat1b trueLabels(const Scene& scene) {
  cv::Mat1b labels = cv::Mat1b::zeros(scene.camera.height, scene.camera.width);
  for (const SceneObject& object : scene.objects) {
    const cv::Mat1b mask = trueMask(scene, object.name);
    if (mask.empty()) return {};
    labels.setTo(object.index, mask);
  }
  return labels;
}

// Where the true shape projects to but is not seen: something hides it.
cv::Mat1b hiddenPart(const Truth& truth, const Camera& camera) {
  const Points x = transformed(camera.world_from_camera.inverse() * truth.world_from_object,
                               truth.mesh.vertices);
  return maskOf(renderDepth(x, truth.mesh.triangles, camera), camera) & ~truth.visible;
}

std::optional<Truth> readTruth(const Scene& scene, const SceneObject& object,
                               const YAML::Node& entry, const cv::Mat1b& labels, int cad_vertices) {
  if (!entry["true_mesh"] || !entry["world_T_object"] || labels.empty()) return std::nullopt;
  Truth truth;
  truth.mesh = loadMesh(scene.directory + "/" + entry["true_mesh"].as<std::string>());
  truth.correspondence = entry["correspondence"] && entry["correspondence"].as<bool>() &&
                         truth.mesh.vertexCount() == cad_vertices;
  truth.world_from_object = poseOf(entry["world_T_object"][0], scene.directory + "/scene.yaml");
  truth.visible = labels == object.index;
  truth.ignored = hiddenPart(truth, scene.camera);
  cv::Mat1b everything = labels.clone();
  // An occluder that is no listed object hides the edge as well.
  everything.setTo(255, truth.ignored & (labels == 0));
  truth.contour = traceLoops(everything, object.index, {});
  return truth;
}

YAML::Node entryOf(const YAML::Node& root, const std::string& object) {
  for (const YAML::Node& entry : root["objects"]) {
    if (entry["name"].as<std::string>() == object) return entry;
  }
  return YAML::Node(YAML::NodeType::Map);
}

}  // namespace

std::vector<EvaluationCase> loadSceneFolder(const std::string& directory,
                                            const CaseOptions& options) {
  const Scene scene = loadScene(directory);
  const YAML::Node root = YAML::LoadFile(directory + "/scene.yaml");
  const cv::Mat image = loadKeyImage(scene);
  Segmenter segmenter = makeSegmenter(image, scene, options.use_depth);
  const KeyFrame key = segmentKeyFrame(image, segmenter, loadStrokes(scene));
  const cv::Mat1b labels = trueLabels(scene);
  std::vector<EvaluationCase> cases;
  for (size_t k = 0; k < scene.objects.size(); ++k) {
    const SceneObject& object = scene.objects[k];
    EvaluationCase one;
    one.name = scene.name;
    one.object = object.name;
    one.camera = scene.camera;
    one.cad = loadMesh(object.cad_path);
    one.rough = object.initial_world_from_object;
    one.contour = key.contours[k].loops;
    one.image = image;
    one.options.planes = scene.planes;
    if (options.use_depth) one.options.depth = loadDepth(scene);
    one.ms_segment = key.segmentation_ms + key.contour_ms;
    one.truth = readTruth(scene, object, entryOf(root, object.name), labels, one.cad.vertexCount());
    if (!labels.empty()) {
      one.segmentation_iou =
          intersectionOverUnion(key.labels == object.index, labels == object.index);
    }
    cases.push_back(std::move(one));
  }
  return cases;
}

std::vector<EvaluationCase> loadCases(const std::string& directory, const CaseOptions& options) {
  if (fs::exists(directory + "/alignment.yaml")) return loadAlignmentFolder(directory);
  if (fs::exists(directory + "/scene.yaml")) return loadSceneFolder(directory, options);
  throw std::runtime_error(directory + " holds neither alignment.yaml nor scene.yaml");
}

}  // namespace calipso::align
