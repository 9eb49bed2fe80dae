#include "light/sky_seen.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "calipso_render/light.hpp"
#include "calipso_render/stage.hpp"

namespace calipso::render {
namespace {

// An open box of 2 x 2 x 2: its floor's middle, and its walls' insides, see part of the sky.
struct OpenBox {
  Points points = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0},  {-1, 1, 0}, {-1, -1, 2},
                   {1, -1, 2},  {1, 1, 2},  {-1, 1, 2}, {0, 0, 0}};
  Triangles faces = {{8, 0, 1}, {8, 1, 2}, {8, 2, 3}, {8, 3, 0}, {0, 1, 5}, {0, 5, 4},
                     {1, 2, 6}, {1, 6, 5}, {2, 3, 7}, {2, 7, 6}, {3, 0, 4}, {3, 4, 7}};
  Points normals;
  std::vector<SkySeen> seen, behind;
  OpenBox() : normals(points.size(), Eigen::Vector3f::UnitZ()) {
    normals[4] = Eigen::Vector3f(-1, -1, 0).normalized();
    findSkySeen(points, normals, faces, true, seen, behind);
  }
};

TEST(SkySeen, IsFullOutsideAndPartInABox) {
  const OpenBox box;
  EXPECT_FLOAT_EQ(box.seen[4].open, 1.0f);
  EXPECT_LT((box.seen[4].towards - box.normals[4]).norm(), 1e-6f);
  EXPECT_EQ(box.seen[4].thrown, 0.0f);
  EXPECT_FLOAT_EQ(box.behind[8].open, 1.0f);  // the floor from below
  const SkySeen& floor = box.seen[8];
  EXPECT_NEAR(floor.open, 0.24f, 0.06f);  // form factor of the opening; 48 rays
  // Nearly overhead: 1.5 times the mean cosine of the opening's directions, 0.85 to 1.
  EXPECT_NEAR(floor.towards.z() / floor.open, 1.4f, 0.1f);
  EXPECT_LT(floor.towards.head<2>().norm(), 0.1f);
  EXPECT_GT(floor.thrown, 0.1f);                       // walls that see part of the sky
  EXPECT_LT(floor.thrown, 1.0f - floor.open + 1e-6f);  // no more than what hides it could
}

// The floor's middle sees sky to within 27 to 35 degrees of overhead, walls beyond.
TEST(SkySeen, IsOpenInSomeDirections) {
  const OpenBox box;
  const SkySeen& floor = box.seen[8];
  // The polynomial of degree two smooths the opening's edge.
  EXPECT_GT(floor.openTowards({0, 0, 1}), 0.6f);
  for (const Eigen::Vector3f& side :
       {Eigen::Vector3f(0.9f, 0, 0.436f), Eigen::Vector3f(0, -0.9f, 0.436f)}) {
    EXPECT_LT(floor.openTowards(side), 0.15f);
    EXPECT_LT(skyMirrored(floor, side), kThrownBack);
  }
  EXPECT_FLOAT_EQ(box.seen[4].openTowards(Eigen::Vector3f(-1, 0, 0)), 1.0f);
  const Eigen::Matrix3f turn(Eigen::AngleAxisf(1.1f, Eigen::Vector3f(1, 2, 3).normalized()));
  const Eigen::Vector3f w = Eigen::Vector3f(0.3f, -0.4f, 0.8f).normalized();
  EXPECT_NEAR(floor.turned(turn).openTowards(turn * w), floor.openTowards(w), 1e-4f);
}

// Under a sky that is red above and blue below, the floor of a box gets the red of its opening, and
// more of it than what comes from all sides would give.
TEST(AmbientOn, ComesFromWhereASurfaceSees) {
  Light light;
  light.sun = {};
  light.ambient[0] = {0.5f, 0.3f, 0.5f}, light.ambient[2] = {-0.4f, 0.0f, 0.4f};
  const OpenBox box;
  const cv::Vec3f floor = ambientOn(light, box.seen[8], {}),
                  open = ambientOn(light, SkySeen::all({0, 0, 1}), {}),
                  wall = ambientOn(light, SkySeen::all({1, 0, 0}), {});
  EXPECT_LT(cv::norm(open, ambientAt(light, {0, 0, 1})), 1e-6);
  EXPECT_GT(floor[2] / floor[1], open[2] / open[1]);
  EXPECT_FLOAT_EQ(wall[2] / wall[0], 1.0f);
  const cv::Vec3f red_box = ambientOn(light, box.seen[8], {0.1f, 0.1f, 0.9f});
  EXPECT_GT(red_box[2], floor[2]);
}

Surface surfaceOf(const Points& points, const Triangles& faces) {
  ObjectModel model{"box", 1, {}, Eigen::Isometry3d::Identity()};
  model.mesh.vertices.resize(points.size(), 3);
  model.mesh.triangles.resize(faces.size(), 3);
  for (std::size_t i = 0; i < points.size(); ++i)
    model.mesh.vertices.row(i) = points[i].cast<double>().transpose();
  for (std::size_t t = 0; t < faces.size(); ++t) model.mesh.triangles.row(t) = faces[t].transpose();
  return makeSurface(model);
}

TEST(Actor, SeesTheSkyAsItIsTurned) {
  const OpenBox box;
  const Surface surface = surfaceOf(box.points, box.faces);
  Eigen::Isometry3d pose(Eigen::AngleAxisd(1.1, Eigen::Vector3d(0.3, -0.2, 0.8).normalized()));
  pose.pretranslate(Eigen::Vector3d(3, 2, 1));
  const Actor actor =
      makeActor(surface, transformed(surface.key_vertices, pose), {8, 8, 8, 8, 4, 4, {}});
  ASSERT_EQ(actor.seen.size(), surface.seen.size());
  for (std::size_t i = 0; i < actor.seen.size(); ++i) {
    EXPECT_EQ(actor.seen[i].open, surface.seen[i].open);
    EXPECT_LT(
        (actor.seen[i].towards - pose.linear().cast<float>() * surface.seen[i].towards).norm(),
        1e-4f);
  }
}

// Each side of a box is flat up to its edges, also where three sides share a vertex, and however
// the box is sheared; a bend of 40 degrees is a smooth surface's.
TEST(SurfaceNormals, EndAtCreases) {
  const OpenBox box;
  const Surface surface = surfaceOf(box.points, box.faces);
  Points sheared = surface.key_vertices;
  for (Eigen::Vector3f& p : sheared) p.x() += 0.3f * p.z();
  const Actor actor = makeActor(surface, sheared, {8, 8, 8, 8, 4, 4, {}});
  for (std::size_t t = 0; t < box.faces.size(); ++t) {
    const Eigen::Vector3f &a = sheared[box.faces[t][0]], &b = sheared[box.faces[t][1]],
                          &c = sheared[box.faces[t][2]];
    const Eigen::Vector3f flat = (b - a).cross(c - a).normalized();
    for (int k = 0; k < 3; ++k)
      EXPECT_LT((actor.normals[surface.corners[t][k]] - flat).norm(), 1e-6f) << t << ", " << k;
  }
  const float x = std::cos(0.7f), z = std::sin(0.7f);
  const Surface roof =
      surfaceOf({{-1, -1, 0}, {0, -1, 0}, {0, 1, 0}, {-1, 1, 0}, {x, -1, z}, {x, 1, z}},
                {{0, 1, 2}, {0, 2, 3}, {1, 4, 5}, {1, 5, 2}});
  EXPECT_EQ(roof.corners, roof.triangles);
  EXPECT_LT(roof.key_normals[1].x(), -0.1f);  // between its sides' 0 and -0.64
  EXPECT_GT(roof.key_normals[1].x(), -0.6f);
}

// A box with faces outwards, from corner to corner.
void addBox(const Eigen::Vector3f& low, const Eigen::Vector3f& high, Points& points,
            Triangles& faces) {
  const int first = static_cast<int>(points.size());
  for (int i = 0; i < 8; ++i)
    points.emplace_back((i & 1) != 0 ? high.x() : low.x(), (i & 2) != 0 ? high.y() : low.y(),
                        (i & 4) != 0 ? high.z() : low.z());
  for (const Eigen::Vector4i& f :
       {Eigen::Vector4i(0, 2, 3, 1), Eigen::Vector4i(4, 5, 7, 6), Eigen::Vector4i(0, 1, 5, 4),
        Eigen::Vector4i(2, 6, 7, 3), Eigen::Vector4i(0, 4, 6, 2), Eigen::Vector4i(1, 3, 7, 5)}) {
    faces.emplace_back(first + f[0], first + f[1], first + f[2]);
    faces.emplace_back(first + f[0], first + f[2], first + f[3]);
  }
}

Surface surfaceOfBoxes(const Eigen::AlignedBox3f& a, const Eigen::AlignedBox3f& b, Triangles& faces,
                       Points& points) {
  addBox(a.min(), a.max(), points, faces), addBox(b.min(), b.max(), points, faces);
  return surfaceOf(points, faces);
}

// The first twelve faces are the post's.
Surface postUnderSlab(Triangles& faces, Points& points) {
  return surfaceOfBoxes({Eigen::Vector3f(-0.1f, -0.1f, 0.0f), Eigen::Vector3f(0.1f, 0.1f, 1.2f)},
                        {Eigen::Vector3f(-0.5f, -0.5f, 1.0f), Eigen::Vector3f(0.5f, 0.5f, 1.4f)},
                        faces, points);
}

// A post runs up into a slab. Its upper corners lie within it and see nothing; its sides below it
// see half of the sky beside them, or a little less.
TEST(SkySeen, IsThatOutsideWhereShellsRunIntoEachOther) {
  Points points;
  Triangles faces;
  const Surface surface = postUnderSlab(faces, points);
  ASSERT_EQ(surface.winding, 1);
  int sides = 0;
  for (int t = 0; t < 12; ++t) {  // of the post
    for (int k = 0; k < 3; ++k) {
      const int number = surface.corners[t][k];
      const bool upper = points[faces[t][k]].z() > 1.0f,
                 side = std::abs(surface.key_normals[number].z()) < 0.1f;
      if (!upper || !side) continue;
      ++sides;
      EXPECT_GT(surface.seen[number].open, 0.5f);
      EXPECT_LT(surface.seen[number].open, 0.99f);
      EXPECT_GT(surface.seen[number].thrown, 0.01f);  // from the slab
    }
  }
  EXPECT_EQ(sides, 12);
}

// One open edge anywhere does not hide what another shell runs into.
TEST(SkySeen, IsThatOutsideInAnOpenMeshToo) {
  Points points;
  Triangles faces;
  const Surface closed = postUnderSlab(faces, points);
  ObjectModel model{"post", 1, {}, Eigen::Isometry3d::Identity()};
  const auto count = static_cast<Eigen::Index>(points.size());
  model.mesh.vertices.resize(count + 3, 3);
  model.mesh.triangles.resize(static_cast<Eigen::Index>(faces.size()) + 1, 3);
  for (Eigen::Index v = 0; v < count; ++v)
    model.mesh.vertices.row(v) = points[v].cast<double>().transpose();
  model.mesh.vertices.bottomRows(3) << 3, 0, 0, 3.1, 0, 0, 3, 0.1, 0;
  for (std::size_t f = 0; f < faces.size(); ++f)
    model.mesh.triangles.row(static_cast<Eigen::Index>(f)) = faces[f].transpose();
  model.mesh.triangles.bottomRows(1) << static_cast<int>(count), static_cast<int>(count) + 1,
      static_cast<int>(count) + 2;
  const Surface open = makeSurface(model);
  ASSERT_EQ(open.winding, 0);
  for (int t = 0; t < 12; ++t) {  // of the post
    for (int k = 0; k < 3; ++k) {
      const SkySeen &seen = open.seen[open.corners[t][k]],
                    &alone = closed.seen[closed.corners[t][k]];
      EXPECT_NEAR(seen.open, alone.open, 0.1f) << t << ", " << k;
    }
  }
}

// A peg within a block, of which nothing comes out, is not black when it does.
TEST(SkySeen, IsFullOfWhatIsBuriedAltogether) {
  Points points;
  Triangles faces;
  const Surface surface = surfaceOfBoxes(
      {Eigen::Vector3f(-0.1f, -0.1f, 0.4f), Eigen::Vector3f(0.1f, 0.1f, 0.6f)},
      {Eigen::Vector3f(-0.5f, -0.5f, 0.0f), Eigen::Vector3f(0.5f, 0.5f, 1.0f)}, faces, points);
  ASSERT_FALSE(surface.seen.empty());
  for (const SkySeen& seen : surface.seen) EXPECT_FLOAT_EQ(seen.open, 1.0f);
}

}  // namespace
}  // namespace calipso::render
