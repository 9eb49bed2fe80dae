#include "texture/sightings.hpp"

#include <algorithm>
#include <cmath>

#include "calipso_render/surface_symmetry.hpp"
#include "smooth_step.hpp"
#include "texture/mesh_topology.hpp"

namespace calipso::render {
namespace {

// of the object's extent: a point that far behind the front is hidden
constexpr float kDepthTolerance = 0.012f;
// of the extent: what is that thin is a wall, whose sides need not look alike
constexpr float kThinnest = 0.1f;
constexpr float kFlattest = 0.05f,
                kFull = 0.25f;     // cosine of the view from which a surface is seen, and well seen
constexpr float kSameFace = 0.5f;  // cosine to the front's normal of what may be that front
// sky that a place has less of than another, from which it is not like it, and is not at all
constexpr float kLittleLess = 0.03f, kMuchLess = 0.1f;
constexpr float kAskew = 0.6f,
                kAlike = 0.9f;  // cosine between normals that are not, and are, mirror images

}  // namespace

Sightings::Sightings(const SeenObject& object) : views_(object.views), pictures_(object.pictures) {
  const Surface& surface = *object.actors.front()->surface;
  extent_ = boxOf(surface.key_vertices).diagonal().norm();
  is_sheet_ = render::isSheet(surface.key_vertices, surface.triangles);
  // Open, or with shells that wind otherwise than the others.
  two_sided_ = is_sheet_ || surface.winding != 1 ||
               std::any_of(surface.edges.begin(), surface.edges.end(),
                           [](const MeshEdge& e) { return e.b < 0; });
  for (const View* v : views_)
    camera_from_world_.push_back(v->camera.world_from_camera.inverse().cast<float>()),
        axes_.push_back(v->camera.world_from_camera.linear().cast<float>());
  key_depth_ = std::max(1e-6f, (camera_from_world_[0] * surface.key_vertices.front()).z());
  parts_ = connectedParts(surface.key_vertices, surface.triangles);
  pieces_ = smoothParts(surface.key_vertices, surface.triangles);
}

// The pixel of a picture that a point comes to, if it is before the camera.
std::optional<Sighting> Sightings::pixelOf(std::size_t view,
                                           const Eigen::Vector3f& in_camera) const {
  if (!(in_camera.z() > 0.0f)) return std::nullopt;
  const Eigen::Vector2d pixel = views_[view]->camera.project(in_camera.cast<double>());
  const cv::Rect& region = pictures_[view].region;
  return Sighting{0.0f, 0.0f, static_cast<float>(pixel.x()) - region.x,
                  static_cast<float>(pixel.y()) - region.y};
}

// A part that lies just under another one, or behind it, is not seen there.
bool Sightings::ofPart(const Reflectance& r, const cv::Point& pixel, const Place& place) const {
  const int triangle = r.triangle.at<int>(pixel);
  return (place.part == kAnyPart || place.part == parts_[triangle]) &&
         (place.piece == kAnyPart || place.piece == pieces_[triangle]);
}

bool Sightings::sameFace(const Reflectance& r, const cv::Point& pixel, const Place& place) const {
  const cv::Vec3f& n = r.normal.at<cv::Vec3f>(pixel);
  const float alike = place.normal.dot(Eigen::Vector3f(n[0], n[1], n[2]));
  return ofPart(r, pixel, place) && (two_sided_ ? std::abs(alike) : alike) >= kSameFace;
}

// The best trust around a pixel among those of the object's front that `accepts` takes.
template <typename Accepts>
float Sightings::trustAround(std::size_t view, const Sighting& look, Accepts accepts) const {
  const Reflectance& r = pictures_[view];
  const int u = static_cast<int>(std::lround(std::clamp(look.u, -9.0f, r.region.width + 9.0f)));
  const int v = static_cast<int>(std::lround(std::clamp(look.v, -9.0f, r.region.height + 9.0f)));
  float trust = 0.0f;
  for (int y = std::max(0, v - 1); y <= std::min(r.region.height - 1, v + 1); ++y) {
    const float *here = r.trust.ptr<float>(y), *nearness = r.nearness.ptr<float>(y);
    for (int x = std::max(0, u - 1); x <= std::min(r.region.width - 1, u + 1); ++x) {
      if (here[x] > trust && nearness[x] > 0.0f && accepts(cv::Point(x, y))) trust = here[x];
    }
  }
  return trust;
}

Sighting Sightings::lookAt(std::size_t view, const Place& place, float before) const {
  const Eigen::Vector3f q = camera_from_world_[view] * place.point;
  const float facing = -place.normal.dot(axes_[view] * q) / q.norm();
  const float cosine = two_sided_ ? std::abs(facing) : facing;
  if (cosine < kFlattest) return {};
  const auto pixel = pixelOf(view, q);
  if (!pixel) return {};
  Sighting look = *pixel;
  const float trust = trustAround(view, look, [&](const cv::Point& pixel) {
    const Reflectance& r = pictures_[view];
    const float depth = 1.0f / r.nearness.at<float>(pixel);
    return q.z() <= depth + kDepthTolerance * extent_ && q.z() >= depth - before * extent_ &&
           sameFace(r, pixel, place);
  });
  look.weight = trust * std::min(1.0f, (cosine - kFlattest) / (kFull - kFlattest));
  look.detail = cosine *
                static_cast<float>(std::pow(views_[view]->camera.fx / views_[0]->camera.fx, 2)) *
                std::pow(key_depth_ / q.z(), 2.0f);
  return look;
}

// Between the corners, too, as normal and way from the camera are weighted means of theirs.
bool Sightings::mayShow(std::size_t view, const std::array<Place, 3>& corners) const {
  if (two_sided_) return true;
  const Eigen::Vector3f eye = views_[view]->camera.world_from_camera.translation().cast<float>();
  for (const Place& at : corners) {
    for (const Place& of : corners) {
      if (of.normal.dot(at.point - eye) < 0.0f) return true;
    }
  }
  return false;
}

Sighting Sightings::frontBefore(const Place& place) const {
  const Eigen::Vector3f q = camera_from_world_[0] * place.point;
  auto look = pixelOf(0, q);
  const Reflectance& r = pictures_[0];
  const cv::Point pixel =
      look ? cv::Point(std::lround(look->u), std::lround(look->v)) : cv::Point(-1, -1);
  if (!cv::Rect(cv::Point(), r.region.size()).contains(pixel) ||
      r.nearness.at<float>(pixel) <= 0.0f || !ofPart(r, pixel, place) ||
      q.z() - 1.0f / r.nearness.at<float>(pixel) < kThinnest * extent_)
    return {};
  const Eigen::Vector3f sight =
      (place.point - views_[0]->camera.world_from_camera.translation().cast<float>()).normalized();
  const cv::Vec3f& front = r.normal.at<cv::Vec3f>(pixel);
  const Eigen::Vector3f mirrored = MirrorPlane{sight, 0.0f}.vector({front[0], front[1], front[2]});
  look->weight = r.trust.at<float>(pixel) * smoothStep(kAskew, kAlike, mirrored.dot(place.normal));
  return *look;
}

float Sightings::asOpen(std::size_t view, const Sighting& look, const Place& place) const {
  const cv::Mat& open = pictures_[view].open;
  const int u = std::clamp(static_cast<int>(std::lround(look.u)), 0, open.cols - 1),
            v = std::clamp(static_cast<int>(std::lround(look.v)), 0, open.rows - 1);
  return 1.0f - smoothStep(kLittleLess, kMuchLess, place.open - open.at<float>(v, u));
}

float Sightings::clearAt(std::size_t view, const Sighting& look) const {
  const cv::Mat& clear = pictures_[view].clear;
  const int u = std::clamp(static_cast<int>(std::lround(look.u)), 0, clear.cols - 1),
            v = std::clamp(static_cast<int>(std::lround(look.v)), 0, clear.rows - 1);
  return clear.at<float>(v, u);
}

}  // namespace calipso::render
