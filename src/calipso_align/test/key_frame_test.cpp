#include "calipso_align/key_frame.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "calipso_align/contour.hpp"
#include "synthetic_picture.hpp"
#include "synthetic_shape.hpp"

namespace calipso::align {
namespace {

// A pear's mesh file, and the pear's middle stretched and its ends bent: more than a quadratic map
// does.
class KeyFrameModel : public ::testing::Test {
 protected:
  KeyFrameModel() : mesh_(test::pear()), bent_(mesh_) {
    scene_.camera = test::frontCamera();
    path_ = (std::filesystem::temp_directory_path() /
             ("key_frame_test_" + std::to_string(getpid()) + "_pear.obj"))
                .string();
    std::ofstream file(path_);
    for (int i = 0; i < mesh_.vertices.rows(); ++i) file << "v " << mesh_.vertices.row(i) << "\n";
    for (int f = 0; f < mesh_.triangles.rows(); ++f)
      file << "f " << mesh_.triangles.row(f).array() + 1 << "\n";
    for (int i = 0; i < bent_.vertices.rows(); ++i)
      bent_.vertices(i, 0) += 0.06 * std::sin(2.0 * M_PI * bent_.vertices(i, 2));
    SceneObject object;
    object.name = "pear";
    object.index = 1;
    object.cad_path = path_;
    scene_.objects = {object};
  }
  ~KeyFrameModel() override { std::filesystem::remove(path_); }

  // Of the fitted model's outline and the bent pear's.
  double overlap() const {
    const Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    const auto targets = segmentationTargets(scene_, std::nullopt);
    const auto view = targets[0].fit_model(test::contourOf(bent_, pose, scene_.camera));
    const Points x = test::inCamera(scene_.camera, pose, bent_.vertices);
    return testing::intersectionOverUnion(
        view.value().silhouette,
        maskOf(renderDepth(x, bent_.triangles, scene_.camera), scene_.camera));
  }

  TriangleMesh mesh_, bent_;
  std::string path_;
  Scene scene_;
};

TEST_F(KeyFrameModel, OfWhatMovesAsAWholeMeetsItsOutline) {
  // A pixel of some 150 along each side of 80 x 160.
  EXPECT_GT(overlap(), 0.97);
}

}  // namespace
}  // namespace calipso::align
