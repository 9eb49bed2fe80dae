#include "calipso_align/silhouette.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <utility>

namespace calipso::align {
namespace {

constexpr double kNear = 1e-6;      // m; nothing closer is drawn
constexpr double kRounding = 1e-9;  // px; a pixel on the edge of two triangles belongs to both

// Pixels of all points in the first two columns, 1/z in the third; points behind the camera get
// NaN.
Points projectAll(const Points& x, const Camera& camera) {
  Points pixels(x.rows(), 3);
#pragma omp parallel for schedule(static)
  for (int i = 0; i < x.rows(); ++i) {
    const Eigen::Vector3d p = x.row(i);
    if (p.z() > kNear) {
      pixels.row(i) << camera.project(p).transpose(), 1.0 / p.z();
    } else {
      pixels.row(i).setConstant(std::nan(""));
    }
  }
  return pixels;
}

// The picture's part that holds all pixels, with a margin of background around it where there is
// room.
cv::Rect boundingRoi(const Points& pixels, const Camera& camera) {
  constexpr int kMargin = 3;
  double u0 = 1e9, v0 = 1e9, u1 = -1e9, v1 = -1e9;
  for (int i = 0; i < pixels.rows(); ++i) {
    if (std::isnan(pixels(i, 0))) continue;
    u0 = std::min(u0, pixels(i, 0));
    u1 = std::max(u1, pixels(i, 0));
    v0 = std::min(v0, pixels(i, 1));
    v1 = std::max(v1, pixels(i, 1));
  }
  const auto inside = [](double value, int limit) {
    return static_cast<int>(std::clamp(value, 0.0, static_cast<double>(limit)));
  };
  const int left = inside(std::floor(u0) - kMargin, camera.width);
  const int top = inside(std::floor(v0) - kMargin, camera.height);
  const int right = inside(std::ceil(u1) + kMargin + 1, camera.width);
  const int bottom = inside(std::ceil(v1) + kMargin + 1, camera.height);
  if (right <= left || bottom <= top) return {};
  return {left, top, right - left, bottom - top};
}

// Columns of a picture's row within a triangle: between its left edges and its right ones, all of
// them linear in the row.
class TriangleSpans {
 public:
  explicit TriangleSpans(const Eigen::Vector2d (&p)[3]) {
    const double area =
        (p[1] - p[0]).x() * (p[2] - p[0]).y() - (p[1] - p[0]).y() * (p[2] - p[0]).x();
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector2d& from = p[k];
      const Eigen::Vector2d along = p[(k + 1) % 3] - from;
      const double rise = area > 0.0 ? along.y() : -along.y();
      if (rise == 0.0) continue;  // the triangle's rows end here
      const double slope = along.x() / along.y();
      Edge& edge = rise > 0.0 ? right_[rights_++] : left_[lefts_++];
      edge = {from.x() - slope * from.y(), slope};
    }
  }

  // First and last column whose centre is inside; none when the last comes before the first.
  std::pair<int, int> at(int v) const {
    double from = -1.0, to = 1e6;
    for (int k = 0; k < lefts_; ++k) from = std::max(from, left_[k].u + left_[k].slope * v);
    for (int k = 0; k < rights_; ++k) to = std::min(to, right_[k].u + right_[k].slope * v);
    if (from > 1e6 || to < -1.0) return {0, -1};
    return {cvCeil(from - kRounding), cvFloor(to + kRounding)};
  }

 private:
  struct Edge {
    double u, slope;  // u + slope * v
  };
  Edge left_[3], right_[3];
  int lefts_ = 0, rights_ = 0;
};

// Fills one triangle, whose corners are as projectAll() has them. 1/z is linear on the screen; the
// buffer holds the largest one.
void fillTriangle(const Eigen::Vector3d (&c)[3], const cv::Rect& roi, cv::Mat1f& buffer) {
  const Eigen::Vector2d p[3] = {c[0].head<2>(), c[1].head<2>(), c[2].head<2>()};
  const double area = (p[1] - p[0]).x() * (p[2] - p[0]).y() - (p[1] - p[0]).y() * (p[2] - p[0]).x();
  if (area == 0.0 || !std::isfinite(area)) return;
  const auto [min_v, max_v] = std::minmax({p[0].y(), p[1].y(), p[2].y()});
  const int v_begin = std::max(roi.y, cvCeil(std::max(min_v, -1.0)));
  const int v_end = std::min(roi.y + roi.height - 1, cvFloor(std::min(max_v, 1e6)));
  const auto [min_u, max_u] = std::minmax({p[0].x(), p[1].x(), p[2].x()});
  const bool between_columns =
      max_u < roi.x - 1.0 || min_u > roi.br().x || cvCeil(min_u - kRounding) > max_u + kRounding;
  if (v_end < v_begin || between_columns) return;

  const double d1 = (c[1].z() - c[0].z()) / area, d2 = (c[2].z() - c[0].z()) / area;
  const double by_u = d1 * (p[2] - p[0]).y() - d2 * (p[1] - p[0]).y();
  const double by_v = d2 * (p[1] - p[0]).x() - d1 * (p[2] - p[0]).x();
  const TriangleSpans spans(p);
  for (int v = v_begin; v <= v_end; ++v) {
    const auto [first, last] = spans.at(v);
    const int u_begin = std::max(roi.x, first), u_end = std::min(roi.x + roi.width - 1, last);
    if (u_end < u_begin) continue;
    float* row = buffer[v - roi.y] + (u_begin - roi.x);
    const float start =
        static_cast<float>(c[0].z() + by_u * (u_begin - p[0].x()) + by_v * (v - p[0].y()));
    const float step = static_cast<float>(by_u);
    for (int i = 0; i <= u_end - u_begin; ++i) row[i] = std::max(row[i], start + step * i);
  }
}

// Six times the volume between a face and the camera's centre, positive where its back is seen;
// for all faces.
std::vector<double> volumesBefore(const Points& x, const Triangles& triangles) {
  std::vector<double> volumes(triangles.rows());
#pragma omp parallel for schedule(static)
  for (int f = 0; f < triangles.rows(); ++f) {
    const Eigen::Vector3d a = x.row(triangles(f, 0)), b = x.row(triangles(f, 1)),
                          c = x.row(triangles(f, 2));
    volumes[f] = (b - a).cross(c - a).dot(a);
  }
  return volumes;
}

using Faces = std::vector<int>;

// Front faces of closed shells, whichever way they are wound: a shell's volume says which. All
// faces of what is open.
Faces facesInSight(const Points& x, const MeshTopology& topology) {
  const std::vector<int>& shells = topology.shells();
  const std::vector<double> volumes = volumesBefore(x, topology.triangles());
  std::vector<double> enclosed(volumes.size(), 0.0);  // per shell
  for (size_t f = 0; f < shells.size(); ++f) {
    if (shells[f] != MeshTopology::kOpen) enclosed[shells[f]] += volumes[f];
  }
  Faces faces;
  for (size_t f = 0; f < shells.size(); ++f) {
    const bool is_open = shells[f] == MeshTopology::kOpen;
    if (is_open || volumes[f] * enclosed[shells[f]] <= 0.0) faces.push_back(static_cast<int>(f));
  }
  return faces;
}

Faces allFaces(const Triangles& triangles) {
  Faces all(triangles.rows());
  std::iota(all.begin(), all.end(), 0);
  return all;
}

// The largest 1/z of some triangles at every pixel of the roi; 0 where there is none.
cv::Mat1f largestInverseDepth(const Points& pixels, const Triangles& triangles, const Faces& faces,
                              const cv::Rect& roi) {
  cv::Mat1f all = cv::Mat1f::zeros(roi.size());
  // Every thread draws its share of the triangles; the largest is the same in whatever order.
#pragma omp parallel
  {
    cv::Mat1f own = cv::Mat1f::zeros(roi.size());
#pragma omp for schedule(static) nowait
    for (size_t k = 0; k < faces.size(); ++k) {
      const int f = faces[k];
      fillTriangle(
          {pixels.row(triangles(f, 0)), pixels.row(triangles(f, 1)), pixels.row(triangles(f, 2))},
          roi, own);
    }
#pragma omp critical(largest_inverse_depth)
    std::transform(own.begin(), own.end(), all.begin(), all.begin(),
                   [](float a, float b) { return std::max(a, b); });
  }
  return all;
}

DepthRendering renderFaces(const Points& pixels, const Triangles& triangles, const Faces& faces,
                           const Camera& camera) {
  DepthRendering rendering;
  rendering.roi = boundingRoi(pixels, camera);
  if (rendering.roi.empty()) return rendering;
  rendering.depth = largestInverseDepth(pixels, triangles, faces, rendering.roi);
  for (int v = 0; v < rendering.depth.rows; ++v) {
    float* row = rendering.depth[v];
    for (int u = 0; u < rendering.depth.cols; ++u) row[u] = row[u] > 0.0f ? 1.0f / row[u] : 0.0f;
  }
  return rendering;
}

// Whether the mask ends at the edge: the pixel beyond it is uncovered.
bool bordersBackground(const DepthRendering& rendering, const Eigen::Vector2d& pixel,
                       const Eigen::Vector2d& normal) {
  constexpr double kBeyondPx = 1.0;  // the pixel there has its centre beyond the edge for certain
  const Eigen::Vector2d beyond = pixel + kBeyondPx * normal;
  return rendering.at(cvRound(beyond.x()), cvRound(beyond.y())) <= 0.0f;
}

// Whether a face is seen from its front, for all faces.
std::vector<char> frontFacing(const Points& x, const Triangles& triangles) {
  const std::vector<double> volumes = volumesBefore(x, triangles);
  std::vector<char> front(volumes.size());
  std::transform(volumes.begin(), volumes.end(), front.begin(), [](double v) { return v < 0.0; });
  return front;
}

// The face whose projection lies on the inner side of an outline edge, or -1 where it is none.
int innerFace(const MeshTopology::Edge& edge, const std::vector<char>& front) {
  int front_face = -1, back_face = -1;
  for (const int f : edge.faces) (front[f] ? front_face : back_face) = f;
  if (edge.faces.size() == 1) return edge.faces[0];
  return front_face >= 0 && back_face >= 0 ? front_face : -1;
}

// Unit vector normal to a-b, away from `inner`.
Eigen::Vector2d outwardNormal(const Eigen::Vector2d& a, const Eigen::Vector2d& b,
                              const Eigen::Vector2d& inner) {
  const Eigen::Vector2d along = (b - a).normalized();
  const Eigen::Vector2d normal(along.y(), -along.x());
  return normal.dot(inner - a) > 0.0 ? Eigen::Vector2d(-normal) : normal;
}

int oppositeVertex(const Triangles& triangles, int face, const MeshTopology::Edge& edge) {
  for (int k = 0; k < 3; ++k) {
    const int v = triangles(face, k);
    if (v != edge.v0 && v != edge.v1) return v;
  }
  return edge.v0;
}

// Samples of an edge beyond which the mask ends, `inner` being the third corner of its face.
void appendVisible(const Points& x, const MeshTopology::Edge& edge, int inner,
                   const DepthRendering& rendering, const Camera& camera, double step_px,
                   std::vector<OutlinePoint>& outline) {
  const Eigen::Vector3d a = x.row(edge.v0), b = x.row(edge.v1), c = x.row(inner);
  if (std::min({a.z(), b.z(), c.z()}) <= kNear) return;
  const Eigen::Vector2d pa = camera.project(a), pb = camera.project(b);
  const double length = (pb - pa).norm();
  if (!(length > 1e-9) || length > 1e5) return;
  const Eigen::Vector2d normal = outwardNormal(pa, pb, camera.project(c));

  // Samples in the middle of equal parts of the edge.
  const int parts = std::max(1, static_cast<int>(std::lround(length / step_px)));
  for (int k = 0; k < parts; ++k) {
    const double t = (k + 0.5) / parts;
    const Eigen::Vector3d position = (1.0 - t) * a + t * b;
    const Eigen::Vector2d pixel = camera.project(position);
    const cv::Point at(cvRound(pixel.x()), cvRound(pixel.y()));
    if (!rendering.roi.contains(at)) continue;
    if (!bordersBackground(rendering, pixel, normal)) continue;
    outline.push_back({edge.v0, edge.v1, 1.0 - t, t, position, pixel, normal, length / parts});
  }
}

}  // namespace

DepthRendering renderDepth(const Points& x, const Triangles& triangles, const Camera& camera) {
  return renderFaces(projectAll(x, camera), triangles, allFaces(triangles), camera);
}

DepthRendering renderDepth(const Points& x, const MeshTopology& topology, const Camera& camera) {
  const Points pixels = projectAll(x, camera);
  // What reaches behind the camera is open there.
  const Triangles& triangles = topology.triangles();
  return renderFaces(pixels, triangles,
                     pixels.allFinite() ? facesInSight(x, topology) : allFaces(triangles), camera);
}

cv::Mat1b maskOf(const DepthRendering& rendering, const Camera& camera) {
  cv::Mat1b mask = cv::Mat1b::zeros(camera.height, camera.width);
  if (!rendering.roi.empty()) cv::Mat1b(rendering.depth > 0.0f).copyTo(mask(rendering.roi));
  return mask;
}

cv::Rect boundsOf(const DepthRendering& rendering) {
  if (rendering.roi.empty()) return {};
  const cv::Rect bounds = cv::boundingRect(cv::Mat1b(rendering.depth > 0.0f));
  return bounds.empty() ? bounds : bounds + rendering.roi.tl();
}

std::vector<OutlinePoint> occludingContour(const Points& x, const MeshTopology& topology,
                                           const DepthRendering& rendering, const Camera& camera,
                                           double step_px) {
  if (rendering.roi.empty()) return {};
  const std::vector<char> front = frontFacing(x, topology.triangles());
  // Parts of the edges side by side, put together in their order.
  constexpr int kParts = 16;
  const size_t edges = topology.edges().size();
  std::vector<std::vector<OutlinePoint>> parts(kParts);
#pragma omp parallel for schedule(static)
  for (int part = 0; part < kParts; ++part) {
    for (size_t e = edges * part / kParts; e < edges * (part + 1) / kParts; ++e) {
      const MeshTopology::Edge& edge = topology.edges()[e];
      const int face = innerFace(edge, front);
      if (face < 0) continue;
      const int inner = oppositeVertex(topology.triangles(), face, edge);
      appendVisible(x, edge, inner, rendering, camera, step_px, parts[part]);
    }
  }
  std::vector<OutlinePoint> outline;
  for (const auto& part : parts) outline.insert(outline.end(), part.begin(), part.end());
  return outline;
}

}  // namespace calipso::align
