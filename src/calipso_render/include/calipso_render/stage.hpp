#pragma once

#include <Eigen/Geometry>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "calipso_render/edge_coverage.hpp"
#include "calipso_render/light.hpp"
#include "calipso_render/rasterizer.hpp"
#include "calipso_render/visibility.hpp"
#include "calipso_scene/scene.hpp"
#include "calipso_scene/triangle_mesh.hpp"

namespace calipso::render {

// An object's surface as fitted to the key frame.
struct ObjectModel {
  std::string name;
  int index = 0;                                                        // label in the masks
  TriangleMesh mesh;                                                    // object frame, m
  Eigen::Isometry3d world_from_object = Eigen::Isometry3d::Identity();  // at the key frame
  // the stock model that the mesh was bent from, of the same vertices; empty: it was not
  TriangleMesh stock = {};
};

// What a vertex of a detail hangs on: a triangle of the model, and where the vertex is in its frame.
struct Hold {
  int triangle;
  float part;          // in the vertex' place; all of a vertex add up to 1
  Eigen::Vector3f at;  // m
};

// What never changes about an object's surface.
struct Surface {
  static constexpr std::size_t kHolds = 6;  // per vertex of a detail

  std::string name;
  int index = 0;         // of its label in the video; -1: the video does not have it
  bool in_video = true;  // false: a copy, drawn only where a state has it
  Triangles triangles;
  std::vector<MeshEdge> edges;
  Points object_vertices;  // object frame, m
  Points key_vertices;     // world, key frame, m
  Points stock_vertices;   // the stock model's, laid over those as one piece
  // Normals, several for a vertex at a crease: per triangle the numbers of its corners' ones, and
  // per number the vertex
  Triangles corners;
  std::vector<int> vertex_of_normal;
  Points key_normals;  // world, unit
  // of its triangles seen from outside: 1 counterclockwise, -1 clockwise, 0 it is open
  int winding = 0;
  // per normal, world, key frame: of the side that its normal is on, and of the other one unless the
  // mesh hides that
  std::vector<SkySeen> seen, seen_behind;
  // kHolds for each of the last vertices: details that the model lacks (addDetails())
  std::vector<Hold> holds;
  std::size_t detailVertices() const { return holds.size() / kHolds; }
};

// @throw std::invalid_argument naming the object and what is wrong with its mesh
Surface makeSurface(const ObjectModel& model);

// Edges, normals and what is seen of the sky, for the vertices and triangles that it has.
void findNormals(Surface& surface);

// Area-weighted vertex normals, unit length (zero where a vertex has no face).
Points vertexNormals(const Points& vertices, const Triangles& triangles);

// The same of a surface, one for each piece of it that meets others at a crease.
Points surfaceNormals(const Surface& surface, const Points& vertices);

Points transformed(const Points& points, const Eigen::Isometry3d& transform);

// A surface at one instant, seen by one camera.
struct Actor {
  const Surface* surface = nullptr;
  Points vertices;                         // world, m
  Points normals;                          // as Surface::key_normals; world, unit
  std::vector<SkySeen> seen, seen_behind;  // the surface's, turned as it is now
  ScreenMesh screen;
};

Actor makeActor(const Surface& surface, Points vertices, const Camera& camera);

// @pre the actors outlive them
std::vector<Occluder> occludersOf(const std::vector<Actor>& actors);

// A point of an actor's surface, with the same material point at the key frame.
struct SurfacePoint {
  Eigen::Vector3f position, normal;          // world; the normal faces the viewer
  Eigen::Vector3f key_position, key_normal;  // world, key frame; the normal on the same side
  SkySeen seen;                              // Actor::seen there, of the viewer's side
  int triangle = -1;
  Eigen::Vector3f weights = Eigen::Vector3f::Zero();  // barycentric
};

// The point that pixel (u, v) sees of a triangle. @param eye world position of the camera
SurfacePoint surfacePoint(const Actor& actor, int triangle, float u, float v,
                          const Eigen::Vector3f& eye);

// The same where its barycentric weights are known.
SurfacePoint surfacePoint(const Actor& actor, int triangle, const Eigen::Vector3f& weights,
                          const Eigen::Vector3f& eye);

// One picture of the clip with its objects where they were.
struct View {
  cv::Mat picture;  // code values: CV_32FC3, the key frame's; CV_8UC3, another frame's own
  cv::Mat labels;   // CV_8UC1
  Camera camera;
  std::vector<Actor> actors;

  cv::Vec3f codeAt(int v, int u) const {
    return picture.depth() == CV_8U ? cv::Vec3f(picture.at<cv::Vec3b>(v, u))
                                    : picture.at<cv::Vec3f>(v, u);
  }
};

// Which objects further views show from elsewhere than the key frame's, the first: those that move,
// and all of them if the camera does.
std::vector<bool> shownAnew(const std::vector<View>& views, const std::vector<bool>& moves);

// The support plane that pixel (u, v) of the camera looks at.
struct Receiver {
  // world
  Eigen::Vector3f position = Eigen::Vector3f::Zero(), normal = Eigen::Vector3f::Zero();
};
std::optional<Receiver> receiverAt(const std::vector<SupportPlane>& planes, const Camera& camera,
                                   float u, float v);

}  // namespace calipso::render
