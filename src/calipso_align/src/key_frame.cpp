#include "calipso_align/key_frame.hpp"

#include <chrono>
#include <iomanip>
#include <opencv2/imgcodecs.hpp>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "calipso_align/alignment.hpp"
#include "calipso_align/depth_image.hpp"
#include "calipso_align/silhouette.hpp"
#include "calipso_scene/triangle_mesh.hpp"
#include "segmentation_checks.hpp"

namespace calipso::align {
namespace {

double millisecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
      .count();
}

cv::Mat readImage(const std::string& path, int flags) {
  cv::Mat image = cv::imread(path, flags);
  if (image.empty())
    throw std::runtime_error(path + ": no readable image; give a PNG or JPEG file");
  return image;
}

// Nothing where the model cannot be fitted to anything; what is wrong with it the alignment says.
std::optional<AlignmentResult> fitted(const TriangleMesh& mesh, const Camera& camera,
                                      const Eigen::Isometry3d& rough,
                                      const std::vector<ContourLoop>& contour,
                                      const AlignOptions& options) {
  try {
    AlignmentResult fit = align(mesh, camera, rough, contour, options);
    if (fit.placed) return fit;
  } catch (const std::invalid_argument&) {
  }
  return std::nullopt;
}

// Fits no more than a coarse grid: what is to be told is where the contour is implausible, and how
// the model goes on as a whole. What is attached somewhere cannot: low-order deformations do.
ModelFitter modelFitter(const Scene& scene, const SceneObject& object, const TriangleMesh& mesh,
                        const std::optional<DepthObservation>& depth) {
  AlignOptions options;
  constexpr int kCoarse = 600;  // nodes
  if (object.attachments.empty())
    options.levels = {kCoarse};
  else
    options.levels = {};
  options.judge_depth = false;
  options.planes = scene.planes;
  options.depth = depth;
  return [mesh, camera = scene.camera, options, moves_whole = object.attachments.empty(),
          rough = object.initial_world_from_object](
             const std::vector<ContourLoop>& contour) -> std::optional<ModelView> {
    constexpr double kLeastTolerancePx = 1.5;
    const auto fit = fitted(mesh, camera, rough, contour, options);
    if (!fit) return std::nullopt;
    const Points x = transformed(camera.world_from_camera.inverse() * fit->world_from_object,
                                 fit->mesh.vertices);
    const DepthRendering rendering = renderDepth(x, mesh.triangles, camera);
    ModelView view{maskOf(rendering, camera),
                   cv::Mat1f::zeros(camera.height, camera.width),
                   std::max(kLeastTolerancePx, 2.0 * fit->met_mean_px),
                   {}};
    if (moves_whole) view.surface = {x, mesh.triangles, camera};
    if (!rendering.roi.empty()) rendering.depth.copyTo(view.depth(rendering.roi));
    return view;
  };
}

// Where the user's rough placement puts an object's model in the key frame: CV_8U, 255 inside; with
// a margin of a quarter of the picture on every side; all zero behind the camera.
cv::Mat placedSilhouette(Camera camera, const SceneObject& object, const TriangleMesh& mesh) {
  const int margin_u = camera.width / 4, margin_v = camera.height / 4;
  camera.width += 2 * margin_u;
  camera.height += 2 * margin_v;
  camera.cx += margin_u;
  camera.cy += margin_v;
  const Points x = transformed(
      camera.world_from_camera.inverse() * object.initial_world_from_object, mesh.vertices);
  return maskOf(renderDepth(x, mesh.triangles, camera), camera);
}

std::string enlargedRemark(const std::string& path, double factor) {
  std::ostringstream text;
  text << path << " is a smaller image, enlarged " << std::setprecision(3) << factor
       << " times by repeating its pixels: it places the models, but masks are found without it; "
          "enlarge it by interpolation within surfaces";
  return text.str();
}

}  // namespace

std::vector<SegmentationTarget> segmentationTargets(const Scene& scene,
                                                    const std::optional<DepthObservation>& depth) {
  std::vector<SegmentationTarget> targets;
  for (const SceneObject& object : scene.objects) {
    const cv::Rect rect(object.rect[0], object.rect[1], object.rect[2], object.rect[3]);
    const TriangleMesh mesh = loadMesh(object.cad_path);
    targets.push_back({object.name, object.index, rect,
                       placedSilhouette(scene.camera, object, mesh),
                       modelFitter(scene, object, mesh, depth)});
  }
  return targets;
}

cv::Mat loadKeyImage(const Scene& scene) { return readImage(scene.framePath(0), cv::IMREAD_COLOR); }

cv::Mat loadStrokes(const Scene& scene) {
  return scene.strokes_path.empty() ? cv::Mat()
                                    : readImage(scene.strokes_path, cv::IMREAD_GRAYSCALE);
}

std::vector<ObjectContour> extractContours(const cv::Mat& image, const cv::Mat& labels,
                                           const std::vector<SegmentationTarget>& targets) {
  std::vector<ObjectContour> contours;
  for (const SegmentationTarget& target : targets)
    contours.push_back(extractContour(image, labels, target.label, target.name));
  return contours;
}

Segmenter makeSegmenter(const cv::Mat& image, const Scene& scene, bool use_depth) {
  std::optional<DepthObservation> depth;
  if (use_depth) depth = loadDepth(scene);
  // Where pixels were repeated the steps between them would be taken for edges.
  const double repeated = depth ? enlargement(depth->depth) : 1.0;
  if (!depth || repeated > 1.0) {
    Segmenter segmenter(image, segmentationTargets(scene, depth));
    if (depth) segmenter.addRemark(enlargedRemark(scene.depth_path, repeated));
    return segmenter;
  }
  return Segmenter(image, segmentationTargets(scene, depth), {}, depth->depth,
                   supportDepths(scene.planes, scene.camera));
}

KeyFrame segmentKeyFrame(const cv::Mat& image, Segmenter& segmenter, const cv::Mat& strokes) {
  KeyFrame result;
  const auto start = std::chrono::steady_clock::now();
  result.labels = segmenter.segment(strokes).clone();
  result.models = segmenter.models();
  result.remarks = segmenter.remarks();
  for (std::string& remark : strayStrokes(strokes, segmenter.targets()))
    result.remarks.push_back(std::move(remark));
  result.segmentation_ms = millisecondsSince(start);
  const auto traced = std::chrono::steady_clock::now();
  result.contours = extractContours(image, result.labels, segmenter.targets());
  result.contour_ms = millisecondsSince(traced);
  return result;
}

}  // namespace calipso::align
