#include "frame/seen_place.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "ball_stages.hpp"
#include "frame/revealed_place.hpp"

namespace calipso::render {
namespace {

using namespace testing;

// From beside the key frame's camera the table looks as its points do there; what lies beyond its
// picture is invented.
TEST(SeenPlace, IsCarriedIntoTheCamerasView) {
  const Setting s(params());
  const RenderParams p = params();
  FrameInput in = s.input(true, Eigen::Vector3f::Zero());
  in.camera.world_from_camera.translation().x() += 0.1;
  const StagedFrame frame(*s.prepared, p, in);
  ASSERT_FALSE(frame.at_key_camera);
  const SeenPlace place(frame);
  EXPECT_TRUE(place.fronts[0].empty() && place.live == nullptr);
  const Eigen::Vector2d middle = in.camera.projectWorld(kCentre);  // the ball rests there
  EXPECT_EQ(place.footprints[0].at<std::uint8_t>(cvRound(middle.y()), cvRound(middle.x())), 255);
  int compared = 0, beyond = 0;
  for (int v = 4; v < kHeight - 4; ++v) {
    for (int u = 4; u < kWidth - 4; ++u) {
      const auto table_point = receiverAt(table(), in.camera, u, v);
      if (!table_point) continue;
      const Eigen::Vector2d key = s.key.camera.projectWorld(table_point->position.cast<double>());
      if (key.x() > kWidth + 1) {
        ASSERT_EQ(place.invented.at<std::uint8_t>(v, u), 255) << u << ", " << v;
        ++beyond;
      } else if (key.x() < kWidth - 4 && key.y() > 4 && key.y() < kHeight - 4) {
        cv::Mat there;
        cv::getRectSubPix(s.prepared->plate_linear, {1, 1},
                          cv::Point2f(static_cast<float>(key.x()), static_cast<float>(key.y())),
                          there);
        // remap() knows places to 1/32 px
        ASSERT_LT(cv::norm(place.plate.at<cv::Vec3f>(v, u) - there.at<cv::Vec3f>(0, 0)), 0.02)
            << u << ", " << v;
        ++compared;
      }
    }
  }
  EXPECT_GT(compared, 3000);
  EXPECT_GT(beyond, 100);
}

TEST(RevealedPlace, TellsWhatNoFrameShows) {
  const BallStages s({0.25f, 0.0f, 0.0f});
  const RevealedPlace revealed(s.frame, s.place, s.reflections);
  const Eigen::Vector2d middle = s.input.camera.projectWorld(kCentre);
  const int u = static_cast<int>(middle.x()), v = static_cast<int>(middle.y());
  EXPECT_EQ(revealed.at(u, v).source, kInvented);  // one frame alone was learnt from
  EXPECT_EQ(revealed.at(5, kHeight - 5).source, kSeenElsewhere);
  EXPECT_EQ(revealed.at(5, kHeight - 5).colour,
            s.prepared->plate_linear.at<cv::Vec3f>(kHeight - 5, 5));
}

// A reflection that the key frame shows goes with its object; nothing else changes.
TEST(Reflections, OfWhatIsRemovedGo) {
  const Setting s(params());
  Prepared prepared = *s.prepared;
  const cv::Rect box(40, 80, 30, 20);
  const cv::Vec3f added(0.02f, 0.03f, 0.04f);
  prepared.mirror.strength = 1.0f;
  prepared.mirror.off = cv::Mat::zeros(kHeight, kWidth, CV_8U);
  prepared.mirror.at_key = cv::Mat::zeros(kHeight, kWidth, CV_32FC3);
  prepared.mirror.at_key(box).setTo(cv::Scalar(added));
  prepared.mirror.key_box = box;
  const RenderParams p = params();
  FrameInput in = s.input(true, Eigen::Vector3f::Zero());
  in.objects[0].removed = true;
  const StagedFrame frame(prepared, p, in);
  const SeenPlace place(frame);
  const Reflections reflections(frame, place);
  EXPECT_EQ(cv::boundingRect(reflections.marks()), box);
  const cv::Vec3f own = linearPixel(in.bgr, 50, 90);
  EXPECT_LT(cv::norm(reflections.takenOff(50, 90) - (own - added)), 1e-6);
  EXPECT_EQ(reflections.takenOff(39, 90), linearPixel(in.bgr, 39, 90));
  Pixel pixel{reflections.takenOff(50, 90), 0.0f, kOriginal};
  reflections.add(50, 90, pixel);
  EXPECT_EQ(pixel.source, kRendered);
  EXPECT_EQ(pixel.colour, reflections.takenOff(50, 90));  // nothing is mirrored any more
}

TEST(Reflections, AreNoneWhereNoneWereFound) {
  const BallStages s({0.25f, 0.0f, 0.0f});
  EXPECT_TRUE(s.reflections.marks().empty());
  EXPECT_EQ(s.reflections.unmirrored().data, s.input.bgr.data);
}

}  // namespace
}  // namespace calipso::render
