// rosrun calipso_align evaluate [options] PATH...   one JSON object per case and line, no roscore.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <iostream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <sstream>

#include "calipso_align/metrics.hpp"
#include "calipso_align/support_term.hpp"
#include "calipso_scene/help.hpp"
#include "evaluation_case.hpp"
#include "run_evaluation.hpp"

namespace {

using namespace calipso;
using namespace calipso::align;

constexpr char kUsage[] =
    "usage: evaluate [--noise PX,..] [--seeds N] [--deformation D,..] [--nodes N,N] [--no-depth]\n"
    "                [--literal] [--pictures DIR] PATH...\n"
    "  PATH      a folder with alignment.yaml or scene.yaml\n"
    "  --noise   Gaussian noise on the contour's points, px (default 0)\n"
    "  --seeds   random rough placements up to 10 degrees and 5 % of the distance off instead of\n"
    "            the folder's own\n"
    "  --deformation  only these cases of an alignment folder, percent (default all)\n"
    "  --nodes   of the grids, coarse to fine (default 600,2000)\n"
    "  --no-depth  leave a scene's depth image unused\n"
    "  --literal eq. 9 of the paper as it stands\n"
    "  --pictures DIR  writes the fitted models' outlines over the pictures, CASE_OBJECT.png\n";

struct Arguments {
  std::vector<std::string> paths;
  std::vector<double> noise = {0.0};
  int seeds = 0;
  std::vector<double> deformations;
  std::vector<int> nodes;
  std::string pictures;
  bool use_depth = true;
  bool literal = false;
};

template <class T>
std::vector<T> listOf(const std::string& text) {
  std::vector<T> values;
  std::istringstream in(text);
  std::string item;
  while (std::getline(in, item, ',')) values.push_back(static_cast<T>(std::stod(item)));
  return values;
}

Arguments parse(int argc, char** argv) {
  helpIfAsked(argc, argv, kUsage);
  Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const bool takes_value = word == "--noise" || word == "--seeds" || word == "--nodes" ||
                             word == "--deformation" || word == "--pictures";
    if (takes_value && ++i >= argc) throw std::invalid_argument(word + " needs a value\n" + kUsage);
    if (word == "--noise")
      arguments.noise = listOf<double>(argv[i]);
    else if (word == "--seeds")
      arguments.seeds = std::stoi(argv[i]);
    else if (word == "--deformation")
      arguments.deformations = listOf<double>(argv[i]);
    else if (word == "--pictures")
      arguments.pictures = argv[i];
    else if (word == "--nodes")
      arguments.nodes = listOf<int>(argv[i]);
    else if (word == "--no-depth")
      arguments.use_depth = false;
    else if (word == "--literal")
      arguments.literal = true;
    else if (word.rfind("--", 0) == 0)
      throw std::invalid_argument("unknown option " + word + "\n" + kUsage);
    else
      arguments.paths.push_back(word);
  }
  if (arguments.paths.empty()) throw std::invalid_argument(kUsage);
  return arguments;
}

// One line of JSON, key by key; numbers that are not known become null.
class JsonLine {
 public:
  void addNumber(const std::string& key, std::optional<double> value) {
    char text[32] = "null";
    if (value && std::isfinite(*value)) std::snprintf(text, sizeof text, "%.6g", *value);
    put(key, text);
  }
  void addText(const std::string& key, const std::string& value) {
    std::string quoted = "\"";
    for (const char c : value) {
      if (c == '"' || c == '\\') quoted += '\\';
      quoted += c == '\n' ? ' ' : c;
    }
    put(key, quoted + "\"");
  }
  void addFlag(const std::string& key, bool value) { put(key, value ? "true" : "false"); }
  std::string text() const { return "{" + text_ + "}"; }

 private:
  void put(const std::string& key, const std::string& value) {
    text_ += (text_.empty() ? "\"" : ", \"") + key + "\": " + value;
  }
  std::string text_;
};

std::vector<ContourLoop> withNoise(std::vector<ContourLoop> loops, double noise_px, int seed) {
  std::mt19937 generator(1000 + seed);
  std::normal_distribution<double> normal(0.0, noise_px);
  for (ContourLoop& loop : loops) {
    for (Eigen::Vector2d& p : loop.points) {
      if (noise_px > 0.0) p += Eigen::Vector2d(normal(generator), normal(generator));
    }
  }
  return loops;
}

// The true pose, turned about the centroid and moved.
Eigen::Isometry3d randomRough(const EvaluationCase& one, int seed) {
  constexpr double kLargestTurn = 10.0 * M_PI / 180.0, kLargestShift = 0.05;
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::normal_distribution<double> normal;
  const auto direction = [&] {
    return Eigen::Vector3d(normal(generator), normal(generator), normal(generator)).normalized();
  };
  const Eigen::Isometry3d truth = one.truth->world_from_object;
  const Eigen::Vector3d centroid =
      truth * Eigen::Vector3d(one.truth->mesh.vertices.colwise().mean().transpose());
  const double distance = (centroid - one.camera.world_from_camera.translation()).norm();
  const Eigen::Vector3d axis = direction(), shift = direction();
  const double angle = kLargestTurn * uniform(generator);
  return Eigen::Translation3d(centroid + kLargestShift * uniform(generator) * distance * shift) *
         Eigen::AngleAxisd(angle, axis) * Eigen::Translation3d(-centroid) * truth;
}

Points inCamera(const Camera& camera, const Eigen::Isometry3d& pose, const TriangleMesh& mesh) {
  return transformed(camera.world_from_camera.inverse() * pose, mesh.vertices);
}

std::vector<int> allVertices(const Points& x) {
  std::vector<int> all(x.rows());
  for (size_t i = 0; i < all.size(); ++i) all[i] = static_cast<int>(i);
  return all;
}

std::vector<int> contourVertices(const Points& x, const MeshTopology& topology,
                                 const Camera& camera) {
  std::vector<int> vertices;
  const DepthRendering rendering = renderDepth(x, topology, camera);
  for (const OutlinePoint& p : occludingContour(x, topology, rendering, camera, 1e9)) {
    vertices.push_back(p.v0);
    vertices.push_back(p.v1);
  }
  return vertices;
}

double maskIou(const Truth& truth, const Points& x, const Triangles& triangles,
               const Camera& camera) {
  cv::Mat1b mask = maskOf(renderDepth(x, triangles, camera), camera);
  if (!truth.ignored.empty()) mask.setTo(0, truth.ignored);
  return intersectionOverUnion(mask, truth.visible);
}

void addSurfaceError(const EvaluationCase& one, const Points& x, const Points& true_x,
                     const std::string& suffix, JsonLine& line) {
  const double percent = 100.0 / boundingDiagonal(one.truth->mesh);
  const SurfaceError surface =
      surfaceError(x, true_x, one.cad.triangles, one.truth->mesh.triangles);
  line.addNumber("error3d_mean_percent" + suffix, percent * surface.mean);
  line.addNumber("error3d_rms_percent" + suffix, percent * surface.rms);
  line.addNumber("hausdorff_percent" + suffix, percent * surface.hausdorff);
}

// Errors of the model at x; `suffix` tells before from after. After, in 3D also with the scale
// about the camera's centre taken out, which one picture cannot show.
void addErrors(const EvaluationCase& one, const Points& x, const std::string& suffix,
               JsonLine& line) {
  const Truth& truth = *one.truth;
  const MeshTopology topology(one.cad.triangles);
  const Points true_x = inCamera(one.camera, truth.world_from_object, truth.mesh);
  const ContourError contour = contourError(truth.contour, x, topology, one.camera);
  line.addNumber("contour_mean_px" + suffix, contour.mean_px);
  line.addNumber("contour_p95_px" + suffix, contour.p95_px);
  line.addNumber("hull_mean_px" + suffix,
                 hullError(truth.contour, x, topology, one.camera).mean_px);

  std::optional<double> contour_vertex, all_vertex;
  if (truth.correspondence) {
    contour_vertex =
        reprojectionError(x, true_x, one.camera, contourVertices(true_x, topology, one.camera));
    all_vertex = reprojectionError(x, true_x, one.camera, allVertices(x));
  }
  line.addNumber("contour_vertex_px" + suffix, contour_vertex);
  line.addNumber("all_vertex_px" + suffix, all_vertex);
  const double gauge = depthGauge(x, true_x);
  addSurfaceError(one, x, true_x, suffix, line);
  const bool after = suffix.empty();  // what is left without the distance is of no interest before
  if (after) addSurfaceError(one, gauge * x, true_x, "_depth_removed", line);
  line.addNumber("depth_gauge" + suffix, gauge);
  if (!truth.visible.empty()) {
    line.addNumber("model_mask_iou" + suffix, maskIou(truth, x, one.cad.triangles, one.camera));
  }
}

// What the true shape itself would have, without the details that the stock model lacks.
void addFloor(const EvaluationCase& one, JsonLine& line) {
  const Truth& truth = *one.truth;
  const MeshTopology topology(truth.mesh.triangles);
  const Points x = inCamera(one.camera, truth.world_from_object, truth.mesh);
  line.addNumber("contour_floor_px", contourError(truth.contour, x, topology, one.camera).mean_px);
  line.addNumber("hull_floor_px", hullError(truth.contour, x, topology, one.camera).mean_px);
}

void addUnknown(JsonLine& line) {
  for (const char* key : {"contour_mean_px", "contour_p95_px", "contour_vertex_px", "all_vertex_px",
                          "error3d_mean_percent", "error3d_rms_percent", "hausdorff_percent"}) {
    line.addNumber(key, std::optional<double>());
  }
}

// Red where the model's outline lies, over the picture around it.
void drawOutline(const EvaluationCase& one, const Points& x, const std::string& directory) {
  constexpr int kTimes = 2, kMarginPx = 20, kShift = 4;
  const DepthRendering rendering = renderDepth(x, one.cad.triangles, one.camera);
  const cv::Rect roi =
      cv::Rect(rendering.roi.x - kMarginPx, rendering.roi.y - kMarginPx,
               rendering.roi.width + 2 * kMarginPx, rendering.roi.height + 2 * kMarginPx) &
      cv::Rect({}, one.image.size());
  if (roi.empty()) return;
  cv::Mat picture;
  cv::resize(one.image(roi), picture, cv::Size(), kTimes, kTimes, cv::INTER_CUBIC);
  for (const OutlinePoint& p :
       occludingContour(x, MeshTopology(one.cad.triangles), rendering, one.camera, 0.5)) {
    const Eigen::Vector2d at =
        kTimes * (p.pixel - Eigen::Vector2d(roi.x - 0.5, roi.y - 0.5)) - Eigen::Vector2d(0.5, 0.5);
    const cv::Point centre(static_cast<int>(std::lround(at.x() * (1 << kShift))),
                           static_cast<int>(std::lround(at.y() * (1 << kShift))));
    cv::circle(picture, centre, 1 << (kShift - 1), cv::Scalar(0, 0, 255), cv::FILLED, cv::LINE_AA,
               kShift);
  }
  cv::imwrite(directory + "/" + one.name + "_" + one.object + ".png", picture);
}

// Height of the lowest vertex above the highest support plane under it; nothing without a plane.
std::optional<double> clearanceMm(const EvaluationCase& one, const Points& x) {
  std::optional<double> least;
  for (const SupportTarget& support : makeSupportTargets(one.options.planes, one.camera)) {
    const std::optional<double> height = clearance(support, x, one.camera);
    if (height && (!least || *height < *least)) least = height;
  }
  if (!least) return std::nullopt;
  return 1e3 * *least;
}

// Processor time of all threads so far.
double cpuMs() { return 1e3 * std::clock() / CLOCKS_PER_SEC; }

std::string evaluate(const EvaluationCase& one, const Arguments& arguments, double noise_px,
                     int seed) {
  AlignOptions options = one.options;
  if (!arguments.nodes.empty()) options.levels = arguments.nodes;
  if (arguments.literal) options.method = Method::kLiteral;
  const bool random = seed > 0 && one.truth;
  const Eigen::Isometry3d rough = random ? randomRough(one, seed) : one.rough;
  const std::vector<ContourLoop> contour = withNoise(one.contour, noise_px, seed);
  const double cpu_start_ms = cpuMs();
  const AlignmentResult result =
      calipso::align::align(one.cad, one.camera, rough, contour, options);
  const double cpu_ms = cpuMs() - cpu_start_ms;

  if (!arguments.pictures.empty() && !one.image.empty()) {
    drawOutline(one, inCamera(one.camera, result.world_from_object, result.mesh),
                arguments.pictures);
  }

  JsonLine line;
  line.addText("case", one.name);
  line.addText("object", one.object);
  line.addNumber("deformation_percent", one.deformation_percent);
  line.addNumber("noise_px", noise_px);
  line.addNumber("seed", static_cast<double>(seed));
  if (one.truth) {
    addErrors(one, inCamera(one.camera, rough, one.cad), "_before", line);
    addErrors(one, inCamera(one.camera, result.world_from_object, result.mesh), "", line);
    addFloor(one, line);
  } else {
    addUnknown(line);
  }
  line.addNumber("mask_iou", one.segmentation_iou);
  line.addNumber("fit_mean_px", result.contour_mean_px);
  line.addNumber("expected3d_mean_percent", 100.0 * result.expected_error);
  line.addNumber("expected3d_rms_percent", 100.0 * result.expected_rms);
  line.addNumber("distance_sigma_percent", 100.0 * result.distance_sigma);
  line.addNumber("off_probability", result.off_probability);
  line.addNumber("shape_off_probability", result.shape_off_probability);
  line.addNumber("deformation_found", result.deformation);
  line.addNumber("clearance_mm",
                 clearanceMm(one, inCamera(one.camera, result.world_from_object, result.mesh)));
  line.addFlag("trusted", result.trusted);
  line.addText("reason", result.reason);
  line.addNumber("ms_segment", one.ms_segment);
  line.addNumber("ms_align", totalMs(result));
  line.addNumber("cpu_ms_align", cpu_ms);
  for (const StageTime& time : result.times) line.addNumber("ms " + time.stage, time.ms);
  return line.text();
}

bool isAsked(const EvaluationCase& one, const Arguments& arguments) {
  const std::vector<double>& asked = arguments.deformations;
  return asked.empty() || !one.deformation_percent ||
         std::find(asked.begin(), asked.end(), *one.deformation_percent) != asked.end();
}

void evaluateFolder(const std::string& path, const Arguments& arguments) {
  for (const EvaluationCase& one : loadCases(path, {arguments.use_depth})) {
    if (!isAsked(one, arguments)) continue;
    for (const double noise : arguments.noise) {
      const int first = arguments.seeds > 0 ? 1 : 0;
      for (int seed = first; seed <= arguments.seeds; ++seed) {
        std::cout << evaluate(one, arguments, noise, seed) << std::endl;
      }
    }
  }
}

}  // namespace

int main(int argc, char** argv) { return runEvaluation(argc, argv, parse, evaluateFolder); }
