#include "calipso_scene/triangle_mesh.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <string>

namespace calipso {
namespace {

std::string writeFile(const std::string& name, const std::string& text) {
  const std::string path = testing::TempDir() + name;
  std::ofstream(path) << text;
  return path;
}

const char* const kUnitCube =
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n"
    "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

std::string errorOf(const std::string& path) {
  try {
    loadMesh(path);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

TEST(TriangleMesh, unitCubeHasVolumeOneAndDiagonalRootThree) {
  const TriangleMesh cube = loadMesh(writeFile("cube.obj", kUnitCube));
  EXPECT_EQ(cube.vertexCount(), 8);
  EXPECT_EQ(cube.triangleCount(), 12);
  EXPECT_NEAR(signedVolume(cube), 1.0, 1e-14);  // round-off
  EXPECT_NEAR(boundingDiagonal(cube), std::sqrt(3.0), 1e-14);
}

TEST(TriangleMesh, normalsPointOutwards) {
  const TriangleMesh cube = loadMesh(writeFile("cube.obj", kUnitCube));
  const auto normals = vertexNormals(cube);
  for (int i = 0; i < cube.vertexCount(); ++i) {
    EXPECT_GT(normals.row(i).dot(cube.vertices.row(i) - Eigen::RowVector3d::Constant(0.5)), 0.5);
  }
}

// The cube's faces with some changed, as an OBJ file has them.
TriangleMesh cubeWith(const std::string& faces) {
  const std::string cube = kUnitCube;
  return loadMesh(writeFile("changed.obj", cube.substr(0, cube.find('f')) + faces));
}

TEST(TriangleMesh, facesThatAreDegenerateOrRepeatedAreLeftOut) {
  const std::string cube = kUnitCube;
  const TriangleMesh mesh = cubeWith(cube.substr(cube.find('f')) + "f 3 2 4\nf 1 4 2\nf 1 1 2\n");
  EXPECT_EQ(mesh.triangleCount(), 12);
}

TEST(TriangleMesh, facesWoundTheWrongWayRoundAreTurned) {
  for (const char* faces :
       {"f 1 2 3 4\nf 8 7 6 5\nf 5 6 2 1\nf 6 7 3 2\nf 7 8 4 3\nf 8 5 1 4\n",     // all
        "f 1 2 3 4\nf 8 7 6 5\nf 1 2 6 5\nf 2 3 7 6\nf 7 8 4 3\nf 8 5 1 4\n"}) {  // most
    EXPECT_NEAR(signedVolume(cubeWith(faces)), 1.0, 1e-14) << faces;
  }
}

TEST(TriangleMesh, openSurfaceIsWoundAsMostOfItIs) {
  const auto normals = vertexNormals(cubeWith("f 1 4 2\nf 2 3 4\nf 2 6 3\n"));
  EXPECT_GT(normals(0, 2), 0.5);
  EXPECT_GT(normals(3, 2), 0.5);
}

TEST(TriangleMesh, insideOfAHollowStaysFacingInwards) {
  const std::string hollow =
      "v .2 .2 .2\nv .8 .2 .2\nv .2 .8 .2\nv .2 .2 .8\n"
      "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n"
      "f 9 10 11\nf 9 12 10\nf 10 12 11\nf 9 11 12\n";
  EXPECT_NEAR(signedVolume(cubeWith(hollow)), 1.0 - 0.6 * 0.6 * 0.6 / 6.0, 1e-14);
}

TEST(TriangleMesh, verticesOfNoFaceDoNotCount) {
  const std::string cube = kUnitCube;
  const TriangleMesh mesh =
      cubeWith("v 50 0 0\n" + cube.substr(cube.find('f')));  // left over from something deleted
  EXPECT_EQ(mesh.vertexCount(), 9);
  EXPECT_NEAR(boundingDiagonal(mesh), std::sqrt(3.0), 1e-14);
}

TEST(TriangleMesh, objLinesGoOnAfterABackslash) {
  const std::string cube = kUnitCube;
  for (const char* end : {"\\\n", "\\\r\n"}) {
    std::string faces = cube.substr(cube.find('f'));
    for (size_t at = 0; (at = faces.find(" 2 ", at)) != std::string::npos; at += 3)
      faces.replace(at, 3, std::string(" 2 ") + end);
    EXPECT_NEAR(signedVolume(cubeWith(faces)), 1.0, 1e-14);
  }
}

TEST(TriangleMesh, objRoundTripIsExact) {
  TriangleMesh mesh = loadMesh(writeFile("cube.obj", kUnitCube));
  mesh.vertices *= 1.0 / 3.0;
  const std::string path = testing::TempDir() + "round_trip.obj";
  saveObj(mesh, path);
  const TriangleMesh again = loadMesh(path);
  EXPECT_EQ(again.vertices, mesh.vertices);
  EXPECT_EQ(again.triangles, mesh.triangles);
}

TEST(TriangleMesh, assimpFormatsMergeEqualVertices) {
  const std::string ply = writeFile("tetrahedron.ply",
                                    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\n"
                                    "property float y\nproperty float z\nelement face 4\n"
                                    "property list uchar int vertex_indices\nend_header\n"
                                    "0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
                                    "3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n");
  const TriangleMesh mesh = loadMesh(ply);
  EXPECT_EQ(mesh.vertexCount(), 4);
  EXPECT_NEAR(signedVolume(mesh), 1.0 / 6.0, 1e-7);  // PLY holds single precision
}

TEST(TriangleMesh, badIndexIsNamed) {
  const std::string path = writeFile("bad.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n");
  EXPECT_NE(errorOf(path).find("face 1 has index 9, but there are 3 vertices"), std::string::npos);
}

TEST(TriangleMesh, missingEmptyAndBrokenFilesAreRefused) {
  EXPECT_NE(errorOf("/nowhere/a.obj").find("cannot be opened"), std::string::npos);
  EXPECT_NE(errorOf(writeFile("empty.obj", "")).find("no vertices"), std::string::npos);
  EXPECT_NE(errorOf(writeFile("points.obj", "v 0 0 0\n")).find("no faces"), std::string::npos);
  EXPECT_NE(errorOf(writeFile("nan.obj", "v 0 nan 0\n")).find("line 1"), std::string::npos);
  EXPECT_NE(errorOf(writeFile("nan.off", "OFF\n3 1 0\nnan 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"))
                .find("not finite"),
            std::string::npos);
  EXPECT_NE(errorOf(writeFile("junk.ply", "junk")).find("cannot be read"), std::string::npos);
}

}  // namespace
}  // namespace calipso
