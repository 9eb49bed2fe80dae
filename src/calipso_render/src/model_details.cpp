#include "model_details.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "calipso_render/visibility.hpp"
#include "frame/mask_morphology.hpp"
#include "place/masked_quantile.hpp"

namespace calipso::render {
namespace {

constexpr float kBeside = 4.0f;  // px by which a model may be beside its place
constexpr int kLeast = 9;        // px of area
constexpr int kRoot = 2;         // px by which a detail goes on over the model
constexpr int kAround = 15;      // px around a detail within which depths of its model are compared
// times a pixel's size: by which details may be before their model, and how thick they are
constexpr double kBefore = 3.0, kThick = 0.1;
constexpr double kDeepest = 2.0;  // times its mean: what a detail's distance may be somewhere
// a detail's pixel and those around it tell what it hangs on: where they are, in steps of so many
// px and half its distance from the model
constexpr int kStep = 2;
const std::array<cv::Point, Surface::kHolds> kSteps = {
    {{0, 0}, {0, 0}, {1, 0}, {-1, 0}, {0, 1}, {0, -1}}};
constexpr double kKnown = 0.5;  // part of its pixels whose depth the image has to tell

// The object's model as the key frame shows it.
struct SeenModel {
  cv::Mat nearness;              // CV_32FC1, 1/m; 0: not there
  cv::Mat seen;                  // CV_8UC1
  cv::Mat beside;                // CV_32FC1, px: how far beside it
  cv::Mat nearest;               // CV_32SC1: number of the model's pixel that is nearest to each
  cv::Mat next;                  // CV_32FC1, 1/m: nearness of that
  std::vector<int> triangle_of;  // by number
};

SeenModel seenModel(const Actor& actor, const cv::Size& size) {
  SeenModel model{cv::Mat::zeros(size, CV_32F), cv::Mat::zeros(size, CV_8U), {}, {}, {}, {}};
  const VisibilityBuffer buffer({{0, 0}, size}, {&actor.screen});
  for (int v = 0; v < size.height; ++v) {
    for (int u = 0; u < size.width; ++u) {
      if (buffer.ids(v)[u] == VisibilityBuffer::kNothing) continue;
      model.seen.at<std::uint8_t>(v, u) = 255;
      model.nearness.at<float>(v, u) = buffer.nearness(v)[u];
    }
  }
  if (cv::countNonZero(model.seen) == 0) return model;
  cv::distanceTransform(~model.seen, model.beside, model.nearest, cv::DIST_L2, 5,
                        cv::DIST_LABEL_PIXEL);
  double most;
  cv::minMaxLoc(model.nearest, nullptr, &most);
  std::vector<float> nearness_of(static_cast<std::size_t>(most) + 1, 0.0f);
  model.triangle_of.resize(nearness_of.size(), 0);
  for (int v = 0; v < size.height; ++v) {
    for (int u = 0; u < size.width; ++u) {
      if (model.seen.at<std::uint8_t>(v, u) == 0) continue;
      const int number = model.nearest.at<int>(v, u);
      nearness_of[number] = model.nearness.at<float>(v, u);
      model.triangle_of[number] = VisibilityBuffer::triangleOf(buffer.ids(v)[u]);
    }
  }
  model.next.create(size, CV_32F);
  for (int v = 0; v < size.height; ++v) {
    for (int u = 0; u < size.width; ++u)
      model.next.at<float>(v, u) = nearness_of[model.nearest.at<int>(v, u)];
  }
  return model;
}

// Is what a piece of the mask shows beside its model as near as that, or as the place behind it?
// The model may be too near or too far as a whole.
// @param piece CV_8UC1
bool isOfObject(const cv::Mat& piece, const SeenModel& model, const cv::Mat& depth,
                const cv::Mat& place) {
  cv::Mat around;
  cv::dilate(piece, around, disc(kAround));
  const cv::Mat measured = depth > 0.0f, there = piece & measured,
                of_model = around & ~piece & model.seen & measured;
  if (cv::countNonZero(of_model) == 0 || cv::countNonZero(there) < kKnown * cv::countNonZero(piece))
    return false;
  const cv::Mat here = 1.0f / depth;
  const float by = quantileOf(1.0f / depth.mul(model.nearness), of_model, 0.5),
              seen = quantileOf(here, there, 0.5);
  return std::abs(seen - by * quantileOf(model.next, there, 0.5)) <
         std::abs(seen - quantileOf(place, there, 0.5));
}

// What the mask shows of an object beyond its model.
// @param objects CV_8UC1: where the model of any object is seen
// @return CV_8UC1, with its roots on the model
cv::Mat detailsOf(const View& key, int index, const SeenModel& model, const cv::Mat& objects,
                  const cv::Mat& depth, const cv::Mat& place) {
  const cv::Mat own = key.labels == index, beyond = own & ~objects;
  cv::Mat pieces, extents, middles, details = cv::Mat::zeros(own.size(), CV_8U);
  const int count = cv::connectedComponentsWithStats(beyond, pieces, extents, middles);
  for (int i = 1; i < count; ++i) {
    if (extents.at<int>(i, cv::CC_STAT_AREA) < kLeast) continue;
    const cv::Mat piece = pieces == i;
    double farthest;
    cv::minMaxLoc(model.beside, nullptr, &farthest, nullptr, nullptr, piece);
    if (farthest < kBeside || !isOfObject(piece, model, depth, place)) continue;
    cv::Mat reach;
    cv::dilate(piece & (model.beside >= kBeside), reach, disc(static_cast<int>(2 * kBeside)));
    details |= piece & reach;
  }
  cv::Mat roots;
  cv::dilate(details, roots, disc(kRoot));
  return details | (roots & own & model.seen);
}

// How near the pieces of a shape are: each one plane (nearness is affine in the picture) that is
// as near as the model beside it, or a little nearer, so that the model does not shade it.
// @return CV_32FC1
cv::Mat flatNearness(const cv::Mat& shape, const SeenModel& model, double fx) {
  cv::Mat pieces, nearness = cv::Mat::zeros(shape.size(), CV_32F);
  const int count = cv::connectedComponents(shape, pieces);
  for (int i = 1; i < count; ++i) {
    std::vector<cv::Point> pixels;
    cv::findNonZero(pieces == i, pixels);
    const int pixel_count = static_cast<int>(pixels.size());
    cv::Mat places = cv::Mat::zeros(std::max(3, pixel_count), 3, CV_64F),  // 3: or it is no plane
        near = cv::Mat::zeros(places.rows, 1, CV_64F), plane;
    for (int k = 0; k < pixel_count; ++k) {
      places.at<double>(k, 0) = 1.0;
      places.at<double>(k, 1) = pixels[k].x - pixels[0].x;
      places.at<double>(k, 2) = pixels[k].y - pixels[0].y;
      near.at<double>(k) = model.next.at<float>(pixels[k]);
    }
    cv::solve(places, near, plane, cv::DECOMP_SVD | cv::DECOMP_NORMAL);
    const cv::Mat fitted = places * plane, behind = near - fitted;
    double farthest;
    cv::minMaxLoc(behind.rowRange(0, pixel_count), nullptr, &farthest);
    const double mean = cv::sum(near)[0] / pixel_count,
                 nearer = std::min(farthest, kBefore * mean / fx);
    for (int k = 0; k < pixel_count; ++k) {
      nearness.at<float>(pixels[k]) = static_cast<float>(
          std::clamp(fitted.at<double>(k) + nearer, mean / kDeepest, mean * kDeepest));
    }
  }
  return nearness;
}

// A thin body of a shape in the picture.
class Body {
 public:
  // @param shape CV_8UC1
  // @param outside 1: its triangles are to wind counterclockwise, seen from outside; -1 clockwise
  Body(const cv::Mat& shape, const SeenModel& model, const Camera& camera, int outside)
      : shape_(shape),
        camera_(camera),
        outside_(outside),
        nearness_(flatNearness(shape, model, camera.fx)),
        numbers_(shape.size(), CV_32SC3, cv::Scalar::all(-1)) {
    for (int v = 0; v + 1 < shape.rows; ++v) {
      for (int u = 0; u + 1 < shape.cols; ++u) addCell(u, v);
    }
  }

  Points vertices;                // world, m
  std::vector<cv::Point> pixels;  // of the vertices
  Triangles triangles;

 private:
  enum Place { kHere, kAcross, kDown };  // at a pixel's centre, half a pixel to its right, or below

  bool isIn(int u, int v) const { return shape_.at<std::uint8_t>(v, u) != 0; }

  void addVertex(double u, double v, double depth, const cv::Point& pixel) {
    vertices.push_back(
        (camera_.world_from_camera * Eigen::Vector3d(camera_.ray(u, v) * depth)).cast<float>());
    pixels.push_back(pixel);
  }

  // The number of a vertex on the front. The back's is the next; at the shape's edge they are one.
  int vertexAt(int u, int v, Place place) {
    int& number = numbers_.at<cv::Vec3i>(v, u)[place];
    if (number >= 0) return number;
    number = static_cast<int>(vertices.size());
    const bool own = isIn(u, v);
    const cv::Point pixel(place == kAcross && !own ? u + 1 : u, place == kDown && !own ? v + 1 : v);
    const double depth = 1.0 / nearness_.at<float>(pixel);
    addVertex(u + (place == kAcross ? 0.5 : 0.0), v + (place == kDown ? 0.5 : 0.0), depth, pixel);
    if (place == kHere) addVertex(u, v, depth * (1.0 + kThick / camera_.fx), pixel);
    return number;
  }

  void addTriangle(int a, int b, int c) {
    if (outside_ < 0) std::swap(b, c);
    triangles.emplace_back(a, b, c);
  }

  // The part of a square between four pixels that is in the shape (marching squares).
  void addCell(int u, int v) {
    const std::array<cv::Point, 4> corners = {
        {{u, v}, {u, v + 1}, {u + 1, v + 1}, {u + 1, v}}};  // counterclockwise
    std::vector<int> front, back;
    for (int i = 0; i < 4; ++i) {
      const cv::Point a = corners[i], b = corners[(i + 1) % 4];
      if (isIn(a.x, a.y)) {
        front.push_back(vertexAt(a.x, a.y, kHere));
        back.push_back(front.back() + 1);
      }
      if (isIn(a.x, a.y) != isIn(b.x, b.y)) {
        front.push_back(
            vertexAt(std::min(a.x, b.x), std::min(a.y, b.y), a.x == b.x ? kDown : kAcross));
        back.push_back(front.back());
      }
    }
    for (std::size_t i = 2; i < front.size(); ++i) {
      addTriangle(front[0], front[i - 1], front[i]);
      addTriangle(back[0], back[i], back[i - 1]);
    }
  }

  const cv::Mat shape_;
  const Camera& camera_;
  const int outside_;
  const cv::Mat nearness_;
  cv::Mat numbers_;
};

// A triangle's place and its axes: along its first edge, in it, and its normal.
struct TriangleFrame {
  Eigen::Vector3f origin;
  Eigen::Matrix3f axes;
};

TriangleFrame frameOf(const Points& vertices, const Eigen::Vector3i& t) {
  const Eigen::Vector3f &a = vertices[t[0]], &b = vertices[t[1]], &c = vertices[t[2]];
  TriangleFrame frame;
  frame.origin = (a + b + c) / 3.0f;
  const Eigen::Vector3f along = (b - a).normalized(), normal = along.cross(c - a).normalized();
  frame.axes << along, normal.cross(along), normal;
  return frame;
}

// What the body's vertices hang on: the triangles seen nearest to them and to what is around them,
// the farther around, the farther off the model they are.
std::vector<Hold> holdsOf(const Body& body, const SeenModel& model, const Points& vertices,
                          const Triangles& triangles) {
  const cv::Rect picture({0, 0}, model.seen.size());
  std::vector<Hold> holds;
  for (std::size_t i = 0; i < body.vertices.size(); ++i) {
    const cv::Point at = body.pixels[i];
    const int around = kStep + cvRound(0.5f * model.beside.at<float>(at));
    for (const cv::Point& step : kSteps) {
      cv::Point there = at + around * step;
      if (!picture.contains(there)) there = at;
      const int t = model.triangle_of[model.nearest.at<int>(there)];
      const TriangleFrame frame = frameOf(vertices, triangles[t]);
      holds.push_back(
          {t, 1.0f / Surface::kHolds, frame.axes.transpose() * (body.vertices[i] - frame.origin)});
    }
  }
  return holds;
}

void hangOn(const Body& body, const SeenModel& seen, const ObjectModel& model, Surface& surface) {
  surface.holds = holdsOf(body, seen, surface.key_vertices, surface.triangles);
  const Eigen::Vector3i first = Eigen::Vector3i::Constant(surface.key_vertices.size());
  for (const Eigen::Vector3i& t : body.triangles) surface.triangles.push_back(first + t);
  const Points of_object = transformed(body.vertices, model.world_from_object.inverse());
  const auto append = [](Points& to, const Points& more) {
    to.insert(to.end(), more.begin(), more.end());
  };
  append(surface.object_vertices, of_object), append(surface.key_vertices, body.vertices),
      append(surface.stock_vertices, body.vertices);
  findNormals(surface);
}

}  // namespace

bool addDetails(const View& key, const cv::Mat& depth, const cv::Mat& nearness,
                const std::vector<ObjectModel>& models, std::vector<Surface>& surfaces) {
  if (depth.empty()) return false;
  std::vector<SeenModel> seen;
  cv::Mat objects = cv::Mat::zeros(key.labels.size(), CV_8U);
  for (const Actor& actor : key.actors) {
    seen.push_back(seenModel(actor, key.labels.size()));
    objects |= seen.back().seen;
  }
  bool any = false;
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    if (seen[i].nearest.empty()) continue;
    const cv::Mat details = detailsOf(key, surfaces[i].index, seen[i], objects, depth, nearness);
    if (cv::countNonZero(details) == 0) continue;
    hangOn(Body(details, seen[i], key.camera, surfaces[i].winding), seen[i], models[i],
           surfaces[i]);
    any = true;
  }
  return any;
}

Points withDetails(const Surface& surface, Points vertices) {
  const std::size_t details = surface.detailVertices();
  if (details == 0 || vertices.size() + details != surface.key_vertices.size()) return vertices;
  for (std::size_t i = 0; i < details; ++i) {
    Eigen::Vector3f place = Eigen::Vector3f::Zero();
    for (std::size_t k = 0; k < Surface::kHolds; ++k) {
      const Hold& hold = surface.holds[i * Surface::kHolds + k];
      const TriangleFrame frame = frameOf(vertices, surface.triangles[hold.triangle]);
      place += hold.part * (frame.origin + frame.axes * hold.at);
    }
    vertices.push_back(place);
  }
  return vertices;
}

Points withoutDetails(const Surface& surface, const Points& vertices) {
  return {vertices.begin(), vertices.end() - static_cast<long>(surface.detailVertices())};
}

Triangles modelTriangles(const Surface& surface) {
  Triangles triangles;
  for (std::size_t t = 0; t < surface.triangles.size(); ++t) {
    if (!isDetail(surface, static_cast<int>(t))) triangles.push_back(surface.triangles[t]);
  }
  return triangles;
}

bool isDetail(const Surface& surface, int triangle) {
  const std::size_t of_model = surface.key_vertices.size() - surface.detailVertices();
  return surface.triangles[triangle][0] >= static_cast<int>(of_model);
}

}  // namespace calipso::render
