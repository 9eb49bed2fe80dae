#pragma once

#include <array>
#include <optional>
#include <vector>

#include "texture/texture_fill.hpp"

namespace calipso::render {

constexpr int kAnyPart = -1;

// A point of the surface, world axes, key frame.
struct Place {
  Eigen::Vector3f point, normal;
  int part = kAnyPart;   // of the mesh, that has to be seen there
  int piece = kAnyPart;  // the same, of its smooth parts
  float open = 0.0f;     // SkySeen::open
};

// How well a picture shows a place: 0 not at all, 1 straight on and well inside the mask.
struct Sighting {
  float weight = 0.0f;
  // pixels per area of surface, 1 = straight on from where the key frame's camera is
  float detail = 0.0f;
  float u = 0.0f, v = 0.0f;  // in Reflectance::region
};

// How well the pictures of an object show places of it.
class Sightings {
 public:
  explicit Sightings(const SeenObject& object);

  // @param before how far, in extents, the place may lie before the front that is seen there
  Sighting lookAt(std::size_t view, const Place& place, float before) const;

  // Whether a picture may show points of a triangle: not if it is turned away from the camera.
  // @param corners its vertices and their normals
  bool mayShow(std::size_t view, const std::array<Place, 3>& corners) const;

  // The front of the object before a place, where that is the front's mirror image across the plane
  // of the key frame's picture, and not the other side of a wall.
  Sighting frontBefore(const Place& place) const;

  // Reflectance::clear where a look falls.
  float clearAt(std::size_t view, const Sighting& look) const;

  // How far the front that a look falls on is as open to the sky as a place: what other parts of the
  // object hide more of is darker than light tells, for their contact.
  float asOpen(std::size_t view, const Sighting& look, const Place& place) const;

  int partOf(int triangle) const { return parts_[triangle]; }
  int pieceOf(int triangle) const { return pieces_[triangle]; }  // smoothParts()
  const std::vector<int>& pieces() const { return pieces_; }
  const std::vector<int>& parts() const { return parts_; }  // connectedParts()
  bool isSheet() const { return is_sheet_; }
  float extent() const { return extent_; }       // of the object, m
  float keyDepth() const { return key_depth_; }  // of the object in the key frame, m

 private:
  std::optional<Sighting> pixelOf(std::size_t view, const Eigen::Vector3f& in_camera) const;
  bool ofPart(const Reflectance& r, const cv::Point& pixel, const Place& place) const;
  bool sameFace(const Reflectance& r, const cv::Point& pixel, const Place& place) const;
  template <typename Accepts>
  float trustAround(std::size_t view, const Sighting& look, Accepts accepts) const;

  const std::vector<const View*>& views_;
  const std::vector<Reflectance>& pictures_;
  std::vector<Eigen::Isometry3f> camera_from_world_;
  std::vector<Eigen::Matrix3f> axes_;  // of the cameras, in the world
  std::vector<int> parts_, pieces_;
  float extent_ = 0.0f, key_depth_ = 1.0f;
  bool is_sheet_ = false;   // closed or not
  bool two_sided_ = false;  // a sheet shows one side what the other is like
};

}  // namespace calipso::render
