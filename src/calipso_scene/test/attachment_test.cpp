#include "calipso_scene/attachment.hpp"

#include <gtest/gtest.h>

namespace calipso {
namespace {

// A strip of 11 x 2 vertices, 1 m wide, its upper edge along x at z = 0 of its own frame.
TriangleMesh strip() {
  TriangleMesh mesh;
  mesh.vertices.resize(22, 3);
  mesh.triangles.resize(20, 3);
  for (int i = 0; i < 11; ++i) {
    mesh.vertices.row(2 * i) << 0.1 * i, 0.0, 0.0;
    mesh.vertices.row(2 * i + 1) << 0.1 * i, 0.0, -0.5;
    if (i == 10) break;
    mesh.triangles.row(2 * i) << 2 * i, 2 * i + 1, 2 * i + 2;
    mesh.triangles.row(2 * i + 1) << 2 * i + 1, 2 * i + 3, 2 * i + 2;
  }
  return mesh;
}

AttachmentBox peg(double x, double z) {
  return {"peg", {x - 0.02, -0.02, z - 0.02}, {x + 0.02, 0.02, z + 0.02}};
}

const Eigen::Isometry3d kRaised(Eigen::Translation3d(0.0, 0.0, 2.0));

TEST(Attachment, boxesHoldWhatIsInThem) {
  EXPECT_EQ(attachedVertices(strip(), kRaised, {peg(0.0, 2.0), peg(1.0, 2.0)}),
            (std::vector<int>{0, 20}));
  EXPECT_TRUE(attachedVertices(strip(), kRaised, {}).empty());
}

// The strip's upper edge is found 5 cm too low: the pegs hold it all the same, each of them.
TEST(Attachment, everyBoxThatMissesTheModelGrowsByItself) {
  EXPECT_EQ(attachedVertices(strip(), kRaised, {peg(0.0, 2.05), peg(1.0, 2.05)}),
            (std::vector<int>{0, 20}));
  EXPECT_EQ(attachedVertices(strip(), kRaised, {peg(0.0, 2.0), peg(1.0, 2.05)}),
            (std::vector<int>{0, 20}));
}

TEST(Attachment, aBoxSomewhereElseHoldsNothing) {
  EXPECT_TRUE(attachedVertices(strip(), kRaised, {peg(0.5, 2.5)}).empty());
  EXPECT_EQ(attachedVertices(strip(), kRaised, {peg(0.5, 2.5), peg(1.0, 2.0)}),
            std::vector<int>{20});
}

}  // namespace
}  // namespace calipso
