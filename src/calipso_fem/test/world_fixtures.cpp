#include "world_fixtures.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>
#include <utility>

namespace calipso::fem::test {
namespace {

TriangleMesh meshOf(const std::vector<Eigen::Vector3d>& vertices,
                    const std::vector<Eigen::Vector3i>& triangles) {
  TriangleMesh mesh;
  mesh.vertices.resize(vertices.size(), 3);
  mesh.triangles.resize(triangles.size(), 3);
  for (size_t i = 0; i < vertices.size(); ++i) mesh.vertices.row(i) = vertices[i].transpose();
  for (size_t i = 0; i < triangles.size(); ++i) mesh.triangles.row(i) = triangles[i].transpose();
  return mesh;
}

}  // namespace

TriangleMesh boxSurface(const Eigen::Vector3d& size, int n) {
  return boxSurface(size, Eigen::Vector3i::Constant(n));
}

TriangleMesh boxSurface(const Eigen::Vector3d& size, const Eigen::Vector3i& n) {
  std::map<std::tuple<int, int, int>, int> ids;
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Eigen::Vector3i> triangles;
  const auto id = [&](const Eigen::Vector3i& l) {
    const auto [it, fresh] =
        ids.emplace(std::make_tuple(l.x(), l.y(), l.z()), static_cast<int>(vertices.size()));
    if (fresh)
      vertices.push_back(size.cwiseProduct(l.cast<double>().cwiseQuotient(n.cast<double>()) -
                                           Eigen::Vector3d::Constant(0.5)));
    return it->second;
  };
  for (int axis = 0; axis < 3; ++axis)
    for (const int side : {0, n[axis]})
      for (int i = 0; i < n[(axis + 1) % 3]; ++i)
        for (int j = 0; j < n[(axis + 2) % 3]; ++j) {
          const auto at = [&](int a, int b) {
            Eigen::Vector3i l;
            l[axis] = side;
            l[(axis + 1) % 3] = a;
            l[(axis + 2) % 3] = b;
            return id(l);
          };
          const int a = at(i, j), b = at(i + 1, j), c = at(i + 1, j + 1), d = at(i, j + 1);
          if (side)
            triangles.insert(triangles.end(), {{a, b, c}, {a, c, d}});
          else
            triangles.insert(triangles.end(), {{a, c, b}, {a, d, c}});
        }
  return meshOf(vertices, triangles);
}

TriangleMesh sphereSurface(double radius, int rings, int segments) {
  std::vector<Eigen::Vector3d> vertices = {{0, 0, radius}};
  std::vector<Eigen::Vector3i> triangles;
  for (int i = 1; i < rings; ++i)
    for (int j = 0; j < segments; ++j) {
      const double theta = M_PI * i / rings, phi = 2.0 * M_PI * j / segments;
      vertices.push_back(radius * Eigen::Vector3d(std::sin(theta) * std::cos(phi),
                                                  std::sin(theta) * std::sin(phi),
                                                  std::cos(theta)));
    }
  vertices.push_back({0, 0, -radius});
  const int last = static_cast<int>(vertices.size()) - 1;
  const auto at = [&](int ring, int j) { return 1 + (ring - 1) * segments + j % segments; };
  for (int j = 0; j < segments; ++j) {
    triangles.push_back({0, at(1, j), at(1, j + 1)});
    triangles.push_back({last, at(rings - 1, j + 1), at(rings - 1, j)});
    for (int i = 1; i + 1 < rings; ++i) {
      triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  return meshOf(vertices, triangles);
}

TriangleMesh beaker() {
  const double outer = 0.04, inner = 0.034, height = 0.09, floor = 0.006;
  const int n = 24;
  const std::vector<std::pair<double, double>> profile = {
      // r, z from the bottom's centre round
      {0.0, 0.0}, {outer, 0.0}, {outer, height}, {inner, height}, {inner, floor}, {0.0, floor}};
  const int rings = static_cast<int>(profile.size()) - 2;
  std::vector<Eigen::Vector3d> vertices = {{0, 0, -0.5 * height}, {0, 0, floor - 0.5 * height}};
  std::vector<Eigen::Vector3i> triangles;
  const auto at = [&](int ring, int j) { return 2 + ring * n + j % n; };
  for (int r = 0; r < rings; ++r)
    for (int j = 0; j < n; ++j) {
      const auto& [radius, z] = profile[r + 1];
      const double phi = 2 * M_PI * j / n;
      vertices.push_back({radius * std::cos(phi), radius * std::sin(phi), z - 0.5 * height});
    }
  for (int j = 0; j < n; ++j) {
    triangles.push_back({0, at(0, j + 1), at(0, j)});
    triangles.push_back({1, at(rings - 1, j), at(rings - 1, j + 1)});
    for (int r = 0; r + 1 < rings; ++r) {
      triangles.push_back({at(r, j), at(r, j + 1), at(r + 1, j + 1)});
      triangles.push_back({at(r, j), at(r + 1, j + 1), at(r + 1, j)});
    }
  }
  return meshOf(vertices, triangles);
}

TriangleMesh bentRod(double size, double thickness) {
  // A sphere stretched along x and bent upwards at both ends in the xz plane, then laid on its
  // side.
  TriangleMesh mesh = sphereSurface(1.0, 16, 24);
  for (int i = 0; i < mesh.vertexCount(); ++i) {
    const Eigen::Vector3d p = mesh.vertex(i);
    const double x = 0.5 * size * p.z(), r = 0.5 * thickness;
    mesh.vertices.row(i) << x, r * p.x() + 1.2 * x * x / size, r * p.y();
  }
  // The map (x, y, z) -> (z, x, y) keeps the orientation.
  return mesh;
}

TriangleMesh horseshoe(double length, double radius, double thickness, double width,
                       const Eigen::Vector3i& n) {
  const double bend = M_PI * radius;
  TriangleMesh mesh = boxSurface({2.0 * length + bend, width, thickness}, n);
  for (int i = 0; i < mesh.vertexCount(); ++i) {
    const Eigen::Vector3d p = mesh.vertex(i);
    const double along = std::clamp(p.x(), -0.5 * bend, 0.5 * bend), beyond = p.x() - along;
    const double phi = along / radius, r = radius + p.z();
    const Eigen::Vector3d out(std::sin(phi), 0.0, std::cos(phi)),
        on(std::cos(phi), 0.0, -std::sin(phi));
    mesh.vertices.row(i) = (r * out + beyond * on + p.y() * Eigen::Vector3d::UnitY()).transpose();
  }
  return mesh;
}

WorldScene sceneWith(const TriangleMesh& mesh, const Eigen::Vector3d& position, bool table) {
  WorldScene scene;
  scene.camera.width = 640;
  scene.camera.height = 480;
  scene.camera.fx = scene.camera.fy = 600.0;
  scene.camera.cx = 319.5;
  scene.camera.cy = 239.5;
  scene.camera.world_from_camera.linear() << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  scene.camera.world_from_camera.translation() = position - Eigen::Vector3d(0, 1, 0);
  if (table) scene.planes.push_back({"table", Eigen::Vector3d::UnitZ(), 0.0, std::nullopt});
  WorldObject object;
  object.name = "thing";
  object.index = 1;
  object.mesh = mesh;
  object.world_from_object.translation() = position;
  scene.objects.push_back(object);
  return scene;
}

Edit editOf(EditKind kind, EditMode mode, double time) {
  Edit edit;
  edit.object = "thing";
  edit.kind = kind;
  edit.mode = mode;
  edit.time = time;
  return edit;
}

EditOutcome outcomeOf(World& world, Edit edit) {
  edit.time = world.time();
  world.submit(edit);
  return world.advanceTo(world.time()).at(0);
}

void play(World& world, double seconds) {
  const double start = world.time();
  const int frames = static_cast<int>(std::lround(seconds * 30.0));
  for (int k = 1; k <= frames; ++k) world.advanceTo(start + k / 30.0);
}

Eigen::Vector3d centerOf(const WorldState& state, int object) {
  return state.objects[object].vertices.colwise().mean().transpose();
}

}  // namespace calipso::fem::test
