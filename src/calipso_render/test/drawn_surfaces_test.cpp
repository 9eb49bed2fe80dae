#include "frame/drawn_surfaces.hpp"

#include <gtest/gtest.h>

#include "ball_stages.hpp"
#include "frame/rest_picture.hpp"
#include "frame/still_pixels.hpp"
#include "frame/surface_sun.hpp"

namespace calipso::render {
namespace {

using namespace testing;

TEST(EditedRegion, HoldsWhatGoesAndWhatComes) {
  const BallStages s({0.25f, 0.0f, 0.0f});
  ASSERT_EQ(s.region.all & s.frame.whole(), s.region.all);
  EXPECT_EQ(s.region.drawn & s.region.all, s.region.drawn);
  EXPECT_EQ(s.region.revealed & s.region.all, s.region.revealed);
  const auto at = [&](const Eigen::Vector3d& x) {
    const Eigen::Vector2d p = s.input.camera.projectWorld(x);
    return cv::Point(static_cast<int>(p.x()), static_cast<int>(p.y()));
  };
  EXPECT_TRUE(s.region.revealed.contains(at(kCentre)));
  EXPECT_FALSE(s.region.drawn.contains(at(kCentre)));
  EXPECT_TRUE(s.region.drawn.contains(at(kCentre + Eigen::Vector3d(0.25, 0.0, 0.0))));
  EXPECT_EQ(s.removed.at<std::uint8_t>(at(kCentre) - s.region.all.tl()), 255);
}

TEST(DrawnSurfaces, CoverSquaresDeepWithinThem) {
  const BallStages s({0.0f, -0.45f, 0.15f});  // near the camera
  const int margin = s.render.background.shadow_margin_px;
  int covered = 0;
  for (int v = s.region.all.y; v < s.region.all.br().y; ++v) {
    for (int u = s.region.all.x; u < s.region.all.br().x; ++u) {
      const cv::Point at = cv::Point(u, v) - s.region.all.tl();
      const bool seen = s.surfaces.centre().idAt(u, v) != VisibilityBuffer::kNothing;
      ASSERT_EQ(s.surfaces.mask().at<std::uint8_t>(at) != 0, seen) << u << ", " << v;
      if (!s.surfaces.covered().at(u, v)) continue;
      ++covered;
      for (const cv::Point d : {cv::Point(margin, 0), {-margin, 0}, {0, margin}, {0, -margin}})
        ASSERT_NE(s.surfaces.mask().at<std::uint8_t>(at + d), 0) << u << ", " << v;
    }
  }
  EXPECT_GT(covered, 0);
}

// Interpolated from corners, the sun is what it is at the place itself.
TEST(SurfaceSun, BetweenCornersFollowsFromThem) {
  const BallStages s({0.0f, -0.45f, 0.15f});
  const Actor& actor = s.frame.objects[0].actor;
  std::vector<SurfaceMaps> maps;
  maps.emplace_back(actor, s.prepared->appearances[0], s.frame.light, ShadedGround(), s.frame.eye);
  const SurfaceSun sun(s.frame, s.place.view.planes(), s.surfaces, maps, s.moved, s.resting);
  const VisibilityBuffer& centre = s.surfaces.centre();
  int compared = 0;
  for (int v = s.region.all.y; v < s.region.all.br().y; ++v) {
    for (int u = s.region.all.x; u < s.region.all.br().x; ++u) {
      const std::uint32_t id = centre.idAt(u, v);
      if (id == VisibilityBuffer::kNothing) continue;
      const auto found = sun.between(u, v, centre.nearnessAt(u, v), 0);
      if (!found) continue;
      const SurfacePoint p =
          surfacePoint(actor, VisibilityBuffer::triangleOf(id), u, v, s.frame.eye);
      const float exact = p.normal.dot(s.frame.light.direction) > 0.0f
                              ? s.moved.sun->visibility(p.position, p.normal)
                              : 0.0f;
      ASSERT_NEAR(*found, exact, 0.15f) << u << ", " << v;  // corners differ by 0.12 at most
      ++compared;
    }
  }
  EXPECT_GT(compared, 1000);  // all but the limb, where the surface bends within a square
}

TEST(StillPixels, AreThoseOfWhatHasNotMoved) {
  const BallStages rests(Eigen::Vector3f::Zero()), moved({0.05f, 0.0f, 0.0f});
  EXPECT_TRUE(StillPixels(moved.frame, moved.place, moved.surfaces.centre(), moved.removed).none());
  const StillPixels still(rests.frame, rests.place, rests.surfaces.centre(), rests.removed);
  ASSERT_FALSE(still.none());
  const cv::Rect& region = rests.region.all;
  const Eigen::Vector2d middle = rests.input.camera.projectWorld(kCentre);
  const int i = static_cast<int>(middle.x()) - region.x, v = static_cast<int>(middle.y());
  EXPECT_EQ(still.row(v - region.y)[i], 1.0f);
  Row row;
  row.resize(region.width);
  std::fill(row.source.begin(), row.source.end(), kRendered);
  still.keep(v, row);
  EXPECT_EQ(row.source[i], kOriginal);
  EXPECT_EQ(row.source[0], kRendered);
}

TEST(RestPicture, GivesPixelsTheNearestOwner) {
  RestPicture picture({true, true}, {60, 40});
  const cv::Rect region(10, 5, 40, 30);
  cv::Mat seen(region.size(), CV_16S, cv::Scalar(-1)), removed = cv::Mat::zeros(30, 40, CV_8U);
  const cv::Point first(5, 10), second(30, 20);
  seen.at<short>(first) = 0, seen.at<short>(second) = 1;
  removed(cv::Rect(20, 10, 4, 4)).setTo(255);
  picture.spreadOwners(seen, removed, region);
  EXPECT_EQ(picture.box, cv::Rect(30, 15, 4, 4));
  EXPECT_EQ(picture.owners.at<short>(0, 0), -1);  // beyond the region nothing is known
  for (int v = 0; v < region.height; ++v) {
    for (int u = 0; u < region.width; ++u) {
      const double to_first = cv::norm(cv::Point(u, v) - first),
                   to_second = cv::norm(cv::Point(u, v) - second);
      if (std::abs(to_first - to_second) < 1.5) continue;  // distances are approximate
      ASSERT_EQ(picture.owners.at<short>(v + region.y, u + region.x), to_first < to_second ? 0 : 1)
          << u << ", " << v;
    }
  }
  EXPECT_EQ(picture.reach.at<std::uint8_t>(15, 30 - 5), 255);
  EXPECT_EQ(picture.reach.at<std::uint8_t>(15, 30 - 6), 0);
}

}  // namespace
}  // namespace calipso::render
