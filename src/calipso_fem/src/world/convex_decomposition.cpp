#include "calipso_fem/world/convex_decomposition.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <limits>
#include <set>
#include <tuple>

#include "calipso_fem/voxel_grid.hpp"
#include "calipso_fem/world/mass_properties.hpp"

namespace calipso::fem {
namespace {

using Box = Eigen::AlignedBox3d;
using Points = std::vector<Eigen::Vector3d>;

// The solid behind the surface: how much of it lies in a box, and whether a point is inside.
class Solid {
 public:
  Solid(const TriangleMesh& mesh, int grid) {
    VoxelizeOptions options;
    options.cell_size =
        (mesh.vertices.colwise().maxCoeff() - mesh.vertices.colwise().minCoeff()).maxCoeff() / grid;
    options.separate_branches = false;
    grid_ = voxelize(mesh, options);
    for (int c = 0; c < grid_.cellCount(); ++c)
      if (grid_.fraction[c] > 0.5) inside_.insert(key(grid_.cell_lattice.row(c)));
  }

  double volumeIn(const Box& box) const {
    const double h = grid_.cell_size;
    double cells = 0.0;
    for (int c = 0; c < grid_.cellCount(); ++c) {
      const Eigen::Vector3d center =
          grid_.origin +
          h * (grid_.cell_lattice.row(c).cast<double>().transpose().array() + 0.5).matrix();
      if (box.contains(center)) cells += grid_.fraction[c];
    }
    return cells * h * h * h;
  }

  bool contains(const Eigen::Vector3d& p) const {
    const Eigen::Vector3d q = (p - grid_.origin) / grid_.cell_size;
    return inside_.count(key(q.array().floor().cast<int>().matrix().transpose())) > 0;
  }

 private:
  static std::array<int, 3> key(const Eigen::RowVector3i& c) { return {c.x(), c.y(), c.z()}; }

  VoxelGrid grid_;
  std::set<std::array<int, 3>> inside_;
};

struct Part {
  Box box;
  std::vector<std::array<Eigen::Vector3d, 3>> triangles;  // the surface clipped to the box
  TriangleMesh hull;
  double concavity = 0.0;  // m^3
};

using Triangles = std::vector<std::array<Eigen::Vector3d, 3>>;

// The part of each triangle on the side where sign * (x[axis] - at) <= 0.
Triangles clip(const Triangles& triangles, int axis, double at, double sign) {
  Triangles kept;
  for (const auto& t : triangles) {
    Points polygon;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d &a = t[k], &b = t[(k + 1) % 3];
      const double da = sign * (a[axis] - at), db = sign * (b[axis] - at);
      if (da <= 0.0) polygon.push_back(a);
      if ((da < 0.0 && db > 0.0) || (da > 0.0 && db < 0.0))
        polygon.push_back(a + da / (da - db) * (b - a));
    }
    for (size_t k = 2; k < polygon.size(); ++k)
      kept.push_back({polygon[0], polygon[k - 1], polygon[k]});
  }
  return kept;
}

// Adds those of the box's corners that lie inside the solid.
void addCorners(const Box& box, const Solid& solid, Points& points) {
  for (int c = 0; c < 8; ++c) {
    const Eigen::Vector3d corner = box.corner(static_cast<Box::CornerType>(c));
    if (solid.contains(corner)) points.push_back(corner);
  }
}

// Empty when flat.
TriangleMesh hullOf(const Points& points) {
  if (points.size() < 4) return {};
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> rows(points.size(), 3);
  for (size_t i = 0; i < points.size(); ++i) rows.row(static_cast<Eigen::Index>(i)) = points[i];
  try {
    return convexHull(rows);
  } catch (const std::invalid_argument&) {
    return {};  // a sliver without volume
  }
}

double hullVolume(const TriangleMesh& hull) {
  return hull.triangleCount() ? signedVolume(hull) : 0.0;
}

struct Cut {
  int axis = -1;
  double at = 0.0;
  double volume = std::numeric_limits<double>::infinity();  // of the two hulls together
};

Box half(const Box& box, int axis, double at, double sign) {
  Box b = box;
  (sign > 0.0 ? b.max() : b.min())[axis] = at;
  return b;
}

// The surface's points sorted between parallel planes, each once.
struct Slabs {
  std::vector<Points> between;  // one more than planes
  std::vector<Points> on;       // where the surface crosses a plane
};

void keepOneOfEach(Points& points) {
  const auto less = [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
  };
  std::sort(points.begin(), points.end(), less);
  points.erase(std::unique(points.begin(), points.end()), points.end());
}

// Of points on a plane those that their hull needs (Andrew's monotone chain), in any order.
Points planarHull(const Points& points, int axis) {
  const int u = (axis + 1) % 3, v = (axis + 2) % 3;
  Points sorted = points, chain;
  std::sort(sorted.begin(), sorted.end(), [&](const auto& a, const auto& b) {
    return std::tie(a[u], a[v]) < std::tie(b[u], b[v]);
  });
  for (const int pass : {0, 1}) {
    const size_t start = chain.size();
    for (const Eigen::Vector3d& p : sorted) {
      const auto turnsRight = [&] {
        const Eigen::Vector3d &a = chain.end()[-2], &b = chain.end()[-1];
        return (b[u] - a[u]) * (p[v] - a[v]) <= (b[v] - a[v]) * (p[u] - a[u]);
      };
      while (chain.size() >= start + 2 && turnsRight()) chain.pop_back();
      chain.push_back(p);
    }
    if (!chain.empty()) chain.pop_back();  // begins the other pass
    if (pass == 0) std::reverse(sorted.begin(), sorted.end());
  }
  return chain;
}

Slabs sortInto(const Triangles& triangles, int axis, const std::vector<double>& planes) {
  Slabs slabs{std::vector<Points>(planes.size() + 1), std::vector<Points>(planes.size())};
  const auto slabOf = [&](const Eigen::Vector3d& p) {
    return std::lower_bound(planes.begin(), planes.end(), p[axis]) - planes.begin();
  };
  for (const auto& t : triangles)
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d &a = t[k], &b = t[(k + 1) % 3];
      const auto from = slabOf(a), to = slabOf(b);
      slabs.between[from].push_back(a);
      if (static_cast<size_t>(from) < planes.size() && a[axis] == planes[from])
        slabs.on[from].push_back(a);
      for (auto i = std::min(from, to); i < std::max(from, to); ++i)
        slabs.on[i].push_back(a + (planes[i] - a[axis]) / (b[axis] - a[axis]) * (b - a));
    }
  for (Points& points : slabs.between) keepOneOfEach(points);
  for (Points& points : slabs.on) points = planarHull(points, axis);
  return slabs;
}

// Volumes of the hulls of what lies on one side of each plane. From plane to plane a hull's corners
// stand for all that it holds. @param sign 1: below the planes; -1: above
std::vector<double> sweep(const Slabs& slabs, const std::vector<double>& planes, const Box& box,
                          int axis, double sign, const Solid& solid) {
  const int count = static_cast<int>(planes.size());
  std::vector<double> volumes(count);
  Points held;
  for (int step = 0; step < count; ++step) {
    const int i = sign > 0.0 ? step : count - 1 - step;
    const Points &more = slabs.between[sign > 0.0 ? i : i + 1], &rim = slabs.on[i];
    held.insert(held.end(), more.begin(), more.end());
    held.insert(held.end(), rim.begin(), rim.end());
    addCorners(half(box, axis, planes[i], sign), solid, held);
    const TriangleMesh hull = hullOf(held);
    volumes[i] = hullVolume(hull);
    if (hull.triangleCount() == 0) continue;
    held.clear();
    for (int k = 0; k < hull.vertexCount(); ++k) held.push_back(hull.vertex(k));
  }
  return volumes;
}

Cut bestCut(const Part& part, const Solid& solid, int cuts_per_axis) {
  Box extent;
  for (const auto& t : part.triangles)
    for (const auto& p : t) extent.extend(p);
  std::vector<double> planes[3], volumes[6];
  for (int axis = 0; axis < 3; ++axis)
    for (int i = 1; i <= cuts_per_axis; ++i) {
      const double s = i / (cuts_per_axis + 1.0);
      planes[axis].push_back((1.0 - s) * extent.min()[axis] + s * extent.max()[axis]);
    }
#pragma omp parallel for schedule(dynamic, 1)
  for (int k = 0; k < 6; ++k) {
    const int axis = k / 2;
    volumes[k] = sweep(sortInto(part.triangles, axis, planes[axis]), planes[axis], part.box, axis,
                       k % 2 == 0 ? 1.0 : -1.0, solid);
  }
  Cut best;
  for (int axis = 0; axis < 3; ++axis)
    for (int i = 0; i < cuts_per_axis; ++i) {
      const double volume = volumes[2 * axis][i] + volumes[2 * axis + 1][i];
      if (volume < best.volume) best = {axis, planes[axis][i], volume};
    }
  return best;
}

Part makePart(Triangles triangles, const Box& box, const Solid& solid) {
  Part part{box, std::move(triangles), {}, 0.0};
  Points points;
  for (const auto& t : part.triangles) points.insert(points.end(), t.begin(), t.end());
  addCorners(box, solid, points);
  part.hull = hullOf(points);
  part.concavity = std::max(0.0, hullVolume(part.hull) - solid.volumeIn(box));
  return part;
}

// Splits the worst part until all are convex enough, or there are as many as may be.
std::vector<Part> split(Part whole, const Solid& solid, double tolerance, int max_hulls,
                        int cuts_per_axis) {
  std::vector<Part> parts = {std::move(whole)};
  while (static_cast<int>(parts.size()) < max_hulls) {
    const auto worst =
        std::max_element(parts.begin(), parts.end(),
                         [](const Part& a, const Part& b) { return a.concavity < b.concavity; });
    if (worst->concavity < tolerance) break;
    const Part part = std::move(*worst);
    parts.erase(worst);
    const Cut cut = bestCut(part, solid, cuts_per_axis);
    for (const double sign : {1.0, -1.0})
      parts.push_back(makePart(clip(part.triangles, cut.axis, cut.at, sign),
                               half(part.box, cut.axis, cut.at, sign), solid));
  }
  return parts;
}

}  // namespace

std::vector<TriangleMesh> decomposeConvex(const TriangleMesh& mesh,
                                          const DecompositionParams& params) {
  const TriangleMesh whole = convexHull(mesh.vertices);  // also refuses flat meshes
  // A closed mesh that fills its hull needs no grid to be known as convex.
  if (isClosed(mesh) && std::abs(signedVolume(mesh)) > (1.0 - 1e-6) * hullVolume(whole))
    return {whole};
  Box box;
  for (int i = 0; i < mesh.vertexCount(); ++i) box.extend(mesh.vertex(i));
  const Solid solid(mesh, params.grid);
  const double tolerance = params.concavity * solid.volumeIn(box);
  if (hullVolume(whole) - solid.volumeIn(box) < 2.0 * tolerance) return {whole};

  Triangles all;
  for (int f = 0; f < mesh.triangleCount(); ++f)
    all.push_back({mesh.vertex(mesh.triangles(f, 0)), mesh.vertex(mesh.triangles(f, 1)),
                   mesh.vertex(mesh.triangles(f, 2))});
  // Each cut is the best for the next two parts, not for all to come: planes elsewhere may end far
  // better.
  constexpr int kTries = 3;
  std::vector<Part> parts;
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0, cuts = params.cuts_per_axis; i < kTries && least > 0.0;
       ++i, cuts += (cuts + 1) / 2) {
    std::vector<Part> tried =
        split(makePart(all, box, solid), solid, tolerance, params.max_hulls, cuts);
    const bool done = static_cast<int>(tried.size()) < params.max_hulls;
    double volume = 0.0;
    for (const Part& part : tried) volume += hullVolume(part.hull);
    if (done) volume = 0.0;
    if (volume >= least) continue;
    least = volume;
    parts = std::move(tried);
  }
  std::vector<TriangleMesh> hulls;
  for (const Part& part : parts)
    if (part.hull.triangleCount()) hulls.push_back(part.hull);
  return hulls;
}

}  // namespace calipso::fem
