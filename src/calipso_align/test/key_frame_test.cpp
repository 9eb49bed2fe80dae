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

TEST(KeyFrame, StrokesOutsideOfAnObjectsRectangleAreNoneOfItAndRemarked) {
  const cv::Size size(160, 120);
  const cv::Mat image = testing::paint(size, testing::disc(80.3, 60.7, 30.2),
                                       cv::Vec3b(40, 160, 60), cv::Vec3b(150, 150, 150), 3.0);
  Segmenter segmenter(image, {{"disc", 7, cv::Rect(45, 25, 72, 72), {}}});
  const KeyFrame without = segmentKeyFrame(image, segmenter, {});
  cv::Mat strokes = cv::Mat::zeros(size, CV_8U);
  strokes(cv::Rect(130, 50, 5, 4)).setTo(7);
  const KeyFrame with = segmentKeyFrame(image, segmenter, strokes);
  EXPECT_EQ(cv::countNonZero(with.labels != without.labels), 0);
  EXPECT_TRUE(without.remarks.empty());
  ASSERT_EQ(with.remarks.size(), 1u);
  EXPECT_NE(with.remarks[0].find("'disc': 20 px"), std::string::npos) << with.remarks[0];
}

}  // namespace
}  // namespace calipso::align
