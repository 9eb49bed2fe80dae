#include "drawing_case.hpp"

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "calipso_render/shadow_map.hpp"

namespace calipso::render {
namespace {

constexpr int kRings = 71, kColumns = 142;     // 2 * 71 * 142 = 20164 triangles
constexpr double kRadius = 0.1, kLift = 0.02;  // m
constexpr int kLabel = 1;

Camera caseCamera() {
  Camera c;
  c.width = 1280, c.height = 720;
  c.fx = c.fy = 1000.0, c.cx = 639.5, c.cy = 359.5;
  const double down = 0.45, s = std::sin(down), k = std::cos(down), distance = 0.385;
  Eigen::Matrix3d axes;
  axes.col(0) = Eigen::Vector3d(1, 0, 0);
  axes.col(1) = Eigen::Vector3d(0, -s, -k);
  axes.col(2) = Eigen::Vector3d(0, k, -s);
  c.world_from_camera.linear() = axes;
  c.world_from_camera.translation() =
      Eigen::Vector3d(0, 0, kRadius + kLift) - distance * axes.col(2);
  return c;
}

TriangleMesh bumpyBall() {
  TriangleMesh m;
  m.vertices.resize((kRings + 1) * kColumns, 3);
  m.triangles.resize(2 * kRings * kColumns, 3);
  int t = 0;
  for (int i = 0; i <= kRings; ++i) {
    for (int j = 0; j < kColumns; ++j) {
      const double a = M_PI * i / kRings, b = 2.0 * M_PI * j / kColumns;
      const double r = kRadius * (1.0 + 0.03 * std::sin(9.0 * a) * std::sin(8.0 * b));
      m.vertices.row(i * kColumns + j) =
          r * Eigen::RowVector3d(std::sin(a) * std::cos(b), std::sin(a) * std::sin(b), std::cos(a));
      if (i == kRings) continue;
      const int k = (j + 1) % kColumns;
      m.triangles.row(t++) =
          Eigen::RowVector3i(i * kColumns + j, (i + 1) * kColumns + j, (i + 1) * kColumns + k);
      m.triangles.row(t++) =
          Eigen::RowVector3i(i * kColumns + j, (i + 1) * kColumns + k, i * kColumns + k);
    }
  }
  return m;
}

ObjectModel caseModel() {
  ObjectModel model{"ball", kLabel, bumpyBall(), Eigen::Isometry3d::Identity()};
  model.world_from_object.translation() = Eigen::Vector3d(0, 0, kRadius + kLift);
  return model;
}

Light caseLight() {
  Light light;
  light.direction = Eigen::Vector3f(0.5f, -0.4f, 0.77f).normalized();
  light.sun = {0.6f, 0.65f, 0.7f};
  light.ambient[0] = {0.3f, 0.3f, 0.28f};
  return light;
}

// Table and ball in exact light and shadow.
ClipFrame keyFrame(const ObjectModel& model, const std::vector<SupportPlane>& planes) {
  const Camera camera = caseCamera();
  ClipFrame frame{cv::Mat(camera.height, camera.width, CV_8UC3),
                  cv::Mat::zeros(camera.height, camera.width, CV_8U), camera};
  const Surface surface = makeSurface(model);
  const Actor actor = makeActor(surface, surface.key_vertices, camera);
  const VisibilityBuffer buffer({0, 0, camera.width, camera.height}, {&actor.screen});
  const Light light = caseLight();
  const ShadowMap sun({{&actor.vertices, &surface.triangles}}, light.direction.cast<double>(),
                      {768, 0.025, 16});
  const Eigen::Vector3f eye = camera.world_from_camera.translation().cast<float>();
  for (int v = 0; v < camera.height; ++v) {
    for (int u = 0; u < camera.width; ++u) {
      const std::uint32_t id = buffer.ids(v)[u];
      Eigen::Vector3f p = Eigen::Vector3f::Zero(), n = Eigen::Vector3f::UnitZ();
      if (id != VisibilityBuffer::kNothing) {
        const SurfacePoint s = surfacePoint(actor, VisibilityBuffer::triangleOf(id), u, v, eye);
        p = s.position, n = s.normal;
        frame.labels.at<std::uint8_t>(v, u) = kLabel;
      } else if (const auto receiver = receiverAt(planes, camera, u, v)) {
        p = receiver->position;
      }
      const cv::Vec3f shade = diffuseShading(light, n, sun.visibility(p, n));
      const float grain =
          0.3f + 0.1f * std::sin(160.0f * p.x() + 60.0f * p.z()) * std::sin(140.0f * p.y());
      for (int c = 0; c < 3; ++c)
        frame.bgr.at<cv::Vec3b>(v, u)[c] = quantise(codeFromLinear(shade[c] * (grain + 0.1f * c)));
    }
  }
  return frame;
}

}  // namespace

Points DrawingCase::verticesAt(int k) const {
  const Surface& s = prepared->surfaces.front();
  const float swell = 1.0f + 0.01f * static_cast<float>(std::sin(0.7 * k)),
              sink = 0.004f * static_cast<float>(std::cos(0.5 * k));
  const Eigen::Vector3f centre(0, 0, kRadius + kLift);
  Points out = s.key_vertices;
  for (Eigen::Vector3f& p : out)
    p = centre + swell * (p - centre) + Eigen::Vector3f(0.003f, 0, sink);
  return out;
}

FrameInput DrawingCase::input(int k) const {
  FrameInput in{frame, prepared->key_labels, prepared->camera, 40000000LL * k, {}, {}};
  ObjectInFrame ball;
  ball.name = "ball", ball.edited = true, ball.vertices = verticesAt(k);
  in.objects.push_back(ball);
  return in;
}

DrawingCase makeDrawingCase(Quality quality) {
  DrawingCase c;
  SupportPlane table;
  table.name = "table";
  c.params.planes = {table};
  c.params.quality = quality;
  const ObjectModel model = caseModel();
  const ClipFrame key = keyFrame(model, c.params.planes);
  ClipSample clip;
  clip.add(key);
  // Found in one frame the light is off by so much that its shadow would be refuted and not drawn:
  // it is given.
  auto prepared = std::make_shared<Prepared>(prepare(clip, {model}, c.params));
  prepared->light.light = caseLight();
  prepared->shadowless = cv::Mat::zeros(key.labels.size(), CV_8U);
  prepared->colour_blur = 1.0f;  // as video codecs leave it
  c.prepared = prepared;
  c.frame = key.bgr;
  c.coverage = static_cast<double>(cv::countNonZero(key.labels)) / key.labels.total();
  c.triangles = model.mesh.triangleCount();
  return c;
}

}  // namespace calipso::render
