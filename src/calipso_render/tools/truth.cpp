#include "truth.hpp"

#include <yaml-cpp/yaml.h>

#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

namespace calipso::render {
namespace {

Eigen::Isometry3d toIsometry(const YAML::Node& rows) {
  Eigen::Matrix4d m;
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) m(i, j) = rows[i][j].as<double>();
  }
  Eigen::Isometry3d pose;
  pose.matrix() = m;
  return pose;
}

// The shapes of a deforming object, from an array of NumPy's format 1.0: little-endian floats,
// frames x vertices x 3.
std::vector<Points> loadShapes(const std::string& file, int vertices,
                               const Eigen::Isometry3d& world_from_object) {
  std::ifstream in(file, std::ios::binary);
  char start[10] = {};
  in.read(start, sizeof(start));
  std::string header(
      static_cast<unsigned char>(start[8]) + 256 * static_cast<unsigned char>(start[9]), ' ');
  in.read(header.data(), static_cast<std::streamsize>(header.size()));
  int frames = 0, count = 0;
  const std::size_t shape = header.find("'shape': (");
  const bool floats = header.find("'<f4'") != std::string::npos &&
                      header.find("'fortran_order': False") != std::string::npos;
  if (!in || !floats || shape == std::string::npos ||
      std::sscanf(header.c_str() + shape, "'shape': (%d, %d, 3)", &frames, &count) != 2) {
    throw std::runtime_error(file + ": no array of 32-bit floats, frames x vertices x 3");
  }
  if (count != vertices)
    throw std::runtime_error(file + ": has " + std::to_string(count) + " vertices, the true mesh " +
                             std::to_string(vertices));
  std::vector<Points> shapes(frames, Points(count));
  for (Points& points : shapes) {
    in.read(reinterpret_cast<char*>(points.data()),
            static_cast<std::streamsize>(sizeof(Eigen::Vector3f) * points.size()));
    points = transformed(points, world_from_object);
  }
  if (!in) throw std::runtime_error(file + ": ends too early");
  return shapes;
}

Truth::Object toObject(const Scene& scene, const YAML::Node& node) {
  Truth::Object object;
  object.model.name = node["name"].as<std::string>();
  object.model.index = node["index"].as<int>();
  object.model.mesh = loadMesh(scene.directory + "/" + node["true_mesh"].as<std::string>());
  object.model.stock = loadMesh(scene.directory + "/" + node["cad"].as<std::string>());
  for (const YAML::Node& pose : node["world_T_object"]) object.poses.push_back(toIsometry(pose));
  object.model.world_from_object = object.poses.front();
  if (const YAML::Node file = node["true_vertices_per_frame"]) {
    object.shapes = loadShapes(scene.directory + "/" + file.as<std::string>(),
                               object.model.mesh.vertexCount(), object.poses.front());
  }
  const YAML::Node material = node["material"];
  if (material && material.size() > 0 && material[0]["roughness"])
    object.roughness = material[0]["roughness"].as<double>();
  return object;
}

// As large as an enlarged scene's picture. @param by cv::InterpolationFlags
cv::Mat asLarge(const Scene& scene, const cv::Mat& picture, int by) {
  const cv::Size size(scene.camera.width, scene.camera.height);
  const int times = picture.empty() ? 1 : size.width / picture.cols;
  if (times < 2 || size != picture.size() * times) return picture;
  cv::Mat large;
  cv::resize(picture, large, size, 0.0, 0.0, by);
  return large;
}

}  // namespace

Scene enlarged(Scene scene, int times) {
  Camera& c = scene.camera;
  c.width *= times, c.height *= times, c.fx *= times, c.fy *= times;
  c.cx = times * c.cx + 0.5 * (times - 1), c.cy = times * c.cy + 0.5 * (times - 1);
  return scene;
}

Truth loadTruth(const Scene& scene) {
  const std::string file = scene.directory + "/scene.yaml";
  try {
    const YAML::Node root = YAML::LoadFile(file);
    Truth truth;
    for (const YAML::Node& node : root["objects"]) truth.objects.push_back(toObject(scene, node));
    const YAML::Node lights = root["lights"];
    if (lights && lights["sun"]) {
      const YAML::Node sun = lights["sun"]["direction_to_sun_world"];
      truth.to_sun = Eigen::Vector3d(sun[0].as<double>(), sun[1].as<double>(), sun[2].as<double>());
    }
    return truth;
  } catch (const YAML::Exception& error) {
    throw std::runtime_error(file + ": no ground truth to evaluate against (" + error.what() + ")");
  }
}

cv::Mat loadFrame(const Scene& scene, int k) {
  const std::string file = scene.framePath(k);
  const cv::Mat frame = cv::imread(file, cv::IMREAD_COLOR);
  if (frame.empty()) throw std::runtime_error(file + ": cannot be read as a picture");
  return asLarge(scene, frame, cv::INTER_CUBIC);
}

cv::Mat loadLabels(const Scene& scene, int k) {
  cv::Mat labels = cv::Mat::zeros(scene.camera.height, scene.camera.width, CV_8U);
  for (const SceneObject& o : scene.objects) {
    const std::string stem = scene.directory + "/masks/" + o.name;
    cv::Mat mask = cv::imread(stem + numbered("_%06d.png", k), cv::IMREAD_GRAYSCALE);
    if (mask.empty()) mask = cv::imread(stem + "_000000.png", cv::IMREAD_GRAYSCALE);
    if (mask.empty()) throw std::runtime_error(stem + "_000000.png: no mask");
    labels.setTo(o.index, asLarge(scene, mask, cv::INTER_LINEAR) > 127);
  }
  return labels;
}

cv::Mat loadDepth(const Scene& scene) {
  cv::Mat depth;
  if (scene.depth_path.empty()) return depth;
  const cv::Mat coded = cv::imread(scene.depth_path, cv::IMREAD_UNCHANGED);
  if (coded.type() != CV_16UC1)
    throw std::runtime_error(scene.depth_path + ": no picture with one channel of 16 bits");
  coded.convertTo(depth, CV_32F, scene.depth_scale);
  return asLarge(scene, depth, cv::INTER_NEAREST);
}

std::optional<cv::Mat> loadPlate(const Scene& scene, int k) {
  cv::Mat plate = cv::imread(scene.directory + numbered("/plates/%06d.png", k), cv::IMREAD_COLOR);
  if (plate.empty()) plate = cv::imread(scene.directory + "/plates/000000.png", cv::IMREAD_COLOR);
  if (plate.empty()) return std::nullopt;
  return asLarge(scene, plate, cv::INTER_CUBIC);
}

std::optional<cv::Mat> loadAlbedo(const Scene& scene) {
  const cv::Mat coded =
      cv::imread(scene.directory + "/truth/albedo_000000.png", cv::IMREAD_UNCHANGED);
  if (coded.type() != CV_16UC3) return std::nullopt;
  cv::Mat albedo;
  coded.convertTo(albedo, CV_32F, 1.0 / 65535.0);
  return asLarge(scene, albedo, cv::INTER_NEAREST);
}

}  // namespace calipso::render
