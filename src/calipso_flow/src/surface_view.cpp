#include "calipso_flow/surface_view.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace calipso::flow {
namespace {

constexpr double kNear = 1e-6;  // m; nothing nearer is projected
constexpr int kWide = 4;        // px; rows of wider triangles are worth clipping

struct ProjectedVertex {
  double u, v;       // px
  double inverse_z;  // 1/m; 0 = behind the camera, or nowhere
  // of u and v, not farther out than matters to any window
  int u_floor, u_ceiling, v_floor, v_ceiling;
};

using Vertices = decltype(TriangleMesh::vertices);

// The conversions of the C library cost as much as the rest of a small triangle.
int floorOf(double value) {
  const int whole = static_cast<int>(value);
  return whole - (whole > value);
}

int ceilingOf(double value) { return -floorOf(-value); }

// Each vertex is rounded once, and not with each of its triangles, most of which show nothing.
ProjectedVertex roundedVertex(const Eigen::Vector2d& pixel, double inverse_z) {
  constexpr double kFarPx = 1e8;
  const double u = std::clamp(pixel.x(), -kFarPx, kFarPx);
  const double v = std::clamp(pixel.y(), -kFarPx, kFarPx);
  return {pixel.x(), pixel.y(), inverse_z, floorOf(u), ceilingOf(u), floorOf(v), ceilingOf(v)};
}

// @param vertices  camera frame
std::vector<ProjectedVertex> projectVertices(const Vertices& vertices, const Camera& camera) {
  std::vector<ProjectedVertex> projected(vertices.rows());
  for (int i = 0; i < vertices.rows(); ++i) {
    const Eigen::Vector3d p = vertices.row(i).transpose();
    if (!p.allFinite() || p.z() < kNear) {
      projected[i] = {};
      continue;
    }
    projected[i] = roundedVertex(camera.project(p), 1.0 / p.z());
  }
  return projected;
}

cv::Rect boundingWindow(const std::vector<ProjectedVertex>& vertices, const Camera& camera) {
  double u_min = camera.width, u_max = -1.0, v_min = camera.height, v_max = -1.0;
  for (const ProjectedVertex& p : vertices) {
    if (p.inverse_z == 0.0) continue;
    u_min = std::min(u_min, p.u), u_max = std::max(u_max, p.u);
    v_min = std::min(v_min, p.v), v_max = std::max(v_max, p.v);
  }
  const int left = std::max(0, static_cast<int>(std::floor(std::max(u_min, 0.0))));
  const int top = std::max(0, static_cast<int>(std::floor(std::max(v_min, 0.0))));
  const int right = static_cast<int>(std::ceil(std::min(u_max, camera.width - 1.0)));
  const int bottom = static_cast<int>(std::ceil(std::min(v_max, camera.height - 1.0)));
  if (right < left || bottom < top) return {};
  return {left, top, right - left + 1, bottom - top + 1};
}

// Pixels of a row outside of which value + slope (x - from) is negative, by more than rounding.
struct Span {
  int first, last;
  void clip(double value, double slope, int from) {
    if (slope == 0.0) return;
    const double zero = std::clamp(from - value / slope, first - 2.0, last + 2.0);
    if (slope > 0.0)
      first = std::max(first, floorOf(zero) - 1);
    else
      last = std::min(last, ceilingOf(zero) + 1);
  }
};

// Calls draw(x, y, wb, wc) for the pixels of a triangle with their weights of b and c.
template <class Draw>
void scanTriangle(const ProjectedVertex& a, const ProjectedVertex& b, const ProjectedVertex& c,
                  const cv::Rect& window, Draw draw) {
  // Most triangles of a fine mesh lie between pixel centres.
  const int x0 = std::max(window.x, std::min({a.u_ceiling, b.u_ceiling, c.u_ceiling}));
  const int x1 = std::min(window.br().x - 1, std::max({a.u_floor, b.u_floor, c.u_floor}));
  if (x0 > x1) return;
  const int y0 = std::max(window.y, std::min({a.v_ceiling, b.v_ceiling, c.v_ceiling}));
  const int y1 = std::min(window.br().y - 1, std::max({a.v_floor, b.v_floor, c.v_floor}));
  if (y0 > y1) return;
  const double area = (b.u - a.u) * (c.v - a.v) - (b.v - a.v) * (c.u - a.u);
  if (area == 0.0) return;
  const double db_du = (c.v - a.v) / area, db_dv = -(c.u - a.u) / area;
  const double dc_du = -(b.v - a.v) / area, dc_dv = (b.u - a.u) / area;
  for (int y = y0; y <= y1; ++y) {
    Span span{x0, x1};
    if (x1 - x0 > kWide) {  // slender and aslant, it fills little of its rectangle
      const double wb = db_du * (x0 - a.u) + db_dv * (y - a.v);
      const double wc = dc_du * (x0 - a.u) + dc_dv * (y - a.v);
      span.clip(wb, db_du, x0);
      span.clip(wc, dc_du, x0);
      span.clip(1.0 - wb - wc, -db_du - dc_du, x0);
    }
    for (int x = span.first; x <= span.last; ++x) {
      const double wb = db_du * (x - a.u) + db_dv * (y - a.v);
      const double wc = dc_du * (x - a.u) + dc_dv * (y - a.v);
      if (wb >= 0.0 && wc >= 0.0 && wb + wc <= 1.0) draw(x - window.x, y - window.y, wb, wc);
    }
  }
}

// Writes the largest 1/z of the triangle's pixels. 1/z is linear in the picture.
void drawTriangle(const ProjectedVertex& a, const ProjectedVertex& b, const ProjectedVertex& c,
                  const cv::Rect& window, cv::Mat& inverse_z) {
  scanTriangle(a, b, c, window, [&](int x, int y, double wb, double wc) {
    const double iz =
        a.inverse_z + wb * (b.inverse_z - a.inverse_z) + wc * (c.inverse_z - a.inverse_z);
    float& nearest = inverse_z.ptr<float>(y)[x];
    nearest = std::max(nearest, static_cast<float>(iz));
  });
}

}  // namespace

float SurfaceView::depthAt(double u, double v) const {
  const cv::Point pixel(static_cast<int>(std::lround(u)), static_cast<int>(std::lround(v)));
  return window.contains(pixel) ? depth.at<float>(pixel - window.tl()) : 0.0f;
}

SurfaceView viewSurface(const TriangleMesh& mesh, const Camera& camera,
                        const Eigen::Isometry3d& camera_from_object) {
  const Vertices moved = (mesh.vertices * camera_from_object.linear().transpose()).rowwise() +
                         camera_from_object.translation().transpose();
  const std::vector<ProjectedVertex> vertices = projectVertices(moved, camera);
  SurfaceView view;
  view.window = boundingWindow(vertices, camera);
  if (view.empty()) return view;
  cv::Mat inverse_z(view.window.size(), CV_32F, cv::Scalar(0));
  for (int t = 0; t < mesh.triangleCount(); ++t) {
    const ProjectedVertex& a = vertices[mesh.triangles(t, 0)];
    const ProjectedVertex& b = vertices[mesh.triangles(t, 1)];
    const ProjectedVertex& c = vertices[mesh.triangles(t, 2)];
    if (a.inverse_z > 0.0 && b.inverse_z > 0.0 && c.inverse_z > 0.0) {
      drawTriangle(a, b, c, view.window, inverse_z);
    }
  }
  cv::divide(1.0, inverse_z, view.depth);  // for CV_32F this gives inf where inverse_z is 0
  view.depth.setTo(0.0f, inverse_z == 0.0f);
  return view;
}

CarriedView carrySurface(const TriangleMesh& mesh, const Camera& camera, const Vertices& moved,
                         const Vertices& carried) {
  const std::vector<ProjectedVertex> vertices = projectVertices(moved, camera);
  CarriedView view;
  view.window = boundingWindow(vertices, camera);
  view.position = cv::Mat(view.window.size(), CV_32FC3, cv::Scalar::all(0.0));
  if (view.window.area() == 0) return view;
  cv::Mat inverse_z(view.window.size(), CV_32F, cv::Scalar(0));
  for (int t = 0; t < mesh.triangleCount(); ++t) {
    const Eigen::Vector3i corner = mesh.triangles.row(t).transpose();
    const ProjectedVertex &a = vertices[corner[0]], &b = vertices[corner[1]],
                          &c = vertices[corner[2]];
    if (!(a.inverse_z > 0.0 && b.inverse_z > 0.0 && c.inverse_z > 0.0)) continue;
    // carried / z is linear in the picture, as 1/z is.
    const Eigen::Vector3d ca = carried.row(corner[0]).transpose() * a.inverse_z;
    const Eigen::Vector3d cb = carried.row(corner[1]).transpose() * b.inverse_z - ca;
    const Eigen::Vector3d cc = carried.row(corner[2]).transpose() * c.inverse_z - ca;
    scanTriangle(a, b, c, view.window, [&](int x, int y, double wb, double wc) {
      const double iz =
          a.inverse_z + wb * (b.inverse_z - a.inverse_z) + wc * (c.inverse_z - a.inverse_z);
      float& nearest = inverse_z.at<float>(y, x);
      if (iz <= nearest) return;
      nearest = static_cast<float>(iz);
      const Eigen::Vector3f p = ((ca + wb * cb + wc * cc) / iz).cast<float>();
      view.position.at<cv::Vec3f>(y, x) = {p.x(), p.y(), p.z()};
    });
  }
  return view;
}

}  // namespace calipso::flow
