#include "calipso_render/inpaint.hpp"

#include <gtest/gtest.h>
#include <omp.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "fill/band_turns.hpp"
#include "fill/patch_fill.hpp"
#include "grain_pictures.hpp"

namespace calipso::render {
namespace {

using namespace testing;

// Grain on spots that are large enough to be seen at the coarsest level too.
cv::Mat spots(int width, int height) {
  cv::Mat image = grain(width, height), smooth;
  cv::GaussianBlur(image, smooth, {0, 0}, 5.0);
  return 8.0 * (smooth - cv::Scalar::all(120.0)) + 0.5 * image + cv::Scalar::all(60.0);
}

TEST(PatchOrigins, AreWhereThePictureRepeatsItself) {
  const cv::Mat image = repeated(spots(160, 120), 52);
  cv::Mat hole = cv::Mat::zeros(120, 160, CV_8U);
  hole(cv::Rect(60, 40, 30, 30)).setTo(255);
  const cv::Mat origin = patchOrigins(image, hole, hole == 0, {}, {});
  int elsewhere = 0;
  for (int v = 0; v < 120; ++v) {
    for (int u = 0; u < 160; ++u) {
      const cv::Vec2s from = origin.at<cv::Vec2s>(v, u);
      if (hole.at<std::uint8_t>(v, u) == 0)
        EXPECT_EQ(from, cv::Vec2s(-1, -1));
      else
        elsewhere += std::abs(from[0] - u) != 52 || from[1] != v;
    }
  }
  EXPECT_EQ(elsewhere, 0);
}

TEST(PatchOrigins, ConnectALineThatEntersAtTwoPlaces) {
  // A dark line that falls by 1 px in 12 over grain, hidden in the middle.
  cv::Mat image = 0.1 * grain(320, 160) + cv::Scalar::all(150.0),
          hole = cv::Mat::zeros(160, 320, CV_8U);
  for (int u = 0; u < 320; ++u) image(cv::Rect(u, 60 + u / 12, 1, 4)).setTo(cv::Scalar::all(30));
  hole(cv::Rect(120, 40, 70, 70)).setTo(255);
  const InpaintResult r = inpaint(image, hole, cv::Mat());
  for (int u = 120; u < 190; ++u) {
    int dark = 0, near = 0;
    for (int v = 40; v < 110; ++v) {
      if (r.image.at<cv::Vec3f>(v, u)[1] > 90.0f) continue;
      ++dark, near += std::abs(v - (61.5 + u / 12)) < 6.0;
    }
    EXPECT_GE(near, 2) << u;
    EXPECT_EQ(near, dark) << u;
  }
}

TEST(PatchOrigins, StayInTheirLayer) {
  // Two grains that differ in colour alone, one above the other: nothing from below comes above the
  // border.
  cv::Mat image = 0.2 * grain(240, 160) + cv::Scalar(120, 90, 60),
          hole = cv::Mat::zeros(160, 240, CV_8U);
  cv::add(image(cv::Rect(0, 80, 240, 80)), cv::Scalar(-60, 20, 20),
          image(cv::Rect(0, 80, 240, 80)));
  hole(cv::Rect(80, 30, 60, 100)).setTo(255);
  const cv::Mat origin = patchOrigins(image, hole, hole == 0, {}, {});
  for (int v = 30; v < 130; ++v) {
    if (std::abs(v - 80) < 6) continue;  // the border may waver by a patch
    for (int u = 80; u < 140; ++u)
      EXPECT_EQ(origin.at<cv::Vec2s>(v, u)[1] < 80, v < 80) << u << ", " << v;
  }
}

TEST(PatchOrigins, ComeFromWhereTheGroundIsAboutAsNear) {
  const cv::Mat image = 0.2 * grain(240, 120) + cv::Scalar::all(100.0);
  cv::Mat hole = cv::Mat::zeros(120, 240, CV_8U);
  hole(cv::Rect(80, 40, 30, 30)).setTo(255);
  InpaintParams params;
  params.nearness = cv::Mat(120, 240, CV_32F, cv::Scalar(1.0f));
  params.nearness(cv::Rect(128, 0, 112, 120)).setTo(0.2f);  // five times as far
  const cv::Mat origin = patchOrigins(image, hole, hole == 0, {}, params);
  for (int v = 40; v < 70; ++v) {
    for (int u = 80; u < 110; ++u)
      EXPECT_LT(origin.at<cv::Vec2s>(v, u)[0], 131)
          << u << ", " << v;  // the patch's middle, by its radius
  }
}

// A board on a floor that is darker, by much or little, and as dark a spot at the hole's rim: what
// is around the hole is the board, so nothing comes from the floor.
TEST(PatchOrigins, ComeFromWhatHasTheColourAroundTheHole) {
  constexpr int kFloor = 112;  // its first row
  struct Case {
    double grain, darker;
    int spot;       // rows
    int otherwise;  // px that would come from the floor, at least
  };
  for (const Case& c : {Case{0.3, 110.0, 6, 100}, Case{0.4, 30.0, 14, 20}}) {
    cv::Mat image = c.grain * spots(240, 200) + cv::Scalar::all(120.0),
            hole = cv::Mat::zeros(200, 240, CV_8U);
    for (const cv::Rect& dark :
         {cv::Rect(0, kFloor, 240, 200 - kFloor), cv::Rect(90, 40 - c.spot, 40, c.spot)})
      cv::subtract(image(dark), cv::Scalar::all(c.darker), image(dark));
    hole(cv::Rect(80, 40, 70, 60)).setTo(255);
    const cv::Mat seen = hole == 0;
    pushPull(image, cv::Mat_<float>(1.0f / 255.0f * cv::Mat_<float>(seen))).copyTo(image, hole);
    const auto fromFloor = [&](float off_colour) {
      InpaintParams params;
      params.off_colour = off_colour, params.away_row = 3.0f, params.off_bland = 0.0f;
      cv::Mat rows;
      cv::extractChannel(patchOrigins(image, hole, seen, {}, params), rows, 1);
      return cv::countNonZero(rows >= kFloor);
    };
    EXPECT_GT(fromFloor(0.0f), c.otherwise) << c.darker;
    EXPECT_EQ(fromFloor(1.0f), 0) << c.darker;
  }
}

// A dark tower stands at the left and shows again through slits of a hole at the right, too narrow
// for any patch.
TEST(PatchOrigins, AgreeWithWhatShowsThroughNarrowGaps) {
  cv::Mat image(160, 240, CV_32FC3, cv::Scalar::all(180.0)), hole = cv::Mat::zeros(160, 240, CV_8U);
  image += 0.05 * (grain(240, 160) - cv::Scalar::all(120.0));
  image(cv::Rect(20, 30, 60, 100)).setTo(cv::Scalar::all(60.0));
  const cv::Rect around(130, 10, 100, 140);
  const cv::Rect tower(150, 30, 60, 100);
  image(tower).setTo(cv::Scalar::all(60.0));
  for (int u = around.x; u < around.br().x; u += 12)
    hole(cv::Rect(u, around.y, 8, around.height)).setTo(255);  // slits of 4 px
  const cv::Mat origin = patchOrigins(image, hole, hole == 0, {}, {});
  int wrong = 0, all = 0;
  for (int v = tower.y + 10; v < tower.br().y - 10; ++v) {
    for (int u = tower.x + 10; u < tower.br().x - 10; ++u) {
      if (hole.at<std::uint8_t>(v, u) == 0) continue;
      const cv::Vec2s from = origin.at<cv::Vec2s>(v, u);
      ++all, wrong += image.at<cv::Vec3f>(from[1], from[0])[0] > 120.0f;
    }
  }
  EXPECT_LT(wrong, all / 50);
}

TEST(PatchOrigins, DoNotDependOnTheNumberOfThreads) {
  const cv::Mat image = grain(200, 150);
  cv::Mat hole = cv::Mat::zeros(150, 200, CV_8U), first;
  hole(cv::Rect(40, 20, 90, 100)).setTo(255);
  const int threads = omp_get_max_threads();
  for (const int count : {1, 2, 5}) {
    omp_set_num_threads(count);
    const cv::Mat origin = patchOrigins(image, hole, hole == 0, {}, {});
    if (first.empty()) first = origin;
    EXPECT_EQ(cv::norm(origin, first, cv::NORM_INF), 0.0) << count;
  }
  omp_set_num_threads(threads);
}

TEST(SweepBands, FindTheBandsBesideThemAsOnOneThread) {
  std::vector<std::atomic<int>> visits(9);
  sweepBands(9, 3, [&](int band, int sweep) {
    ++visits[band];
    for (int other = std::max(0, band - 1); other <= std::min(8, band + 1); ++other)
      EXPECT_EQ(visits[other], sweep + (other == band || band % 2 == 1)) << band << ' ' << other;
  });
}

// So little of it that coarser levels have no patch of it to begin with.
TEST(PatchOrigins, ComeFromASurfaceOfWhichLittleIsSeen) {
  const cv::Rect strip(110, 60, 24, 112), hidden(90, 40, 80, 110);
  cv::Mat image = spots(256, 172), surface(172, 256, CV_8U, cv::Scalar(1)),
          hole = cv::Mat::zeros(172, 256, CV_8U);
  image(strip) = 0.5 * image(strip);
  surface(strip) = 2, hole(hidden) = 255;
  InpaintParams params;
  params.surface = surface;
  const cv::Mat origin = patchOrigins(image, hole, hole == 0, {}, params);
  int elsewhere = 0;
  for (int v = 63; v < 147; ++v) {
    for (int u = 113; u < 131; ++u) {
      const cv::Vec2s from = origin.at<cv::Vec2s>(v, u);
      elsewhere += surface.at<std::uint8_t>(from[1], from[0]) != 2;
    }
  }
  EXPECT_LT(elsewhere, 18 * 84 / 10);
}

// Of a thin hole coarse levels show nothing.
TEST(PatchOrigins, AreFoundForWhatIsThin) {
  const cv::Mat image = repeated(spots(320, 240), 52);
  const auto missed = [&](const cv::Mat& hole) {
    const cv::Mat origin = patchOrigins(image, hole, hole == 0, {}, {});
    int far = 0;
    for (int u = 110; u < 300; ++u) {
      const cv::Vec2s from = origin.at<cv::Vec2s>(30, u);
      if (from[0] < 0) return 1000;
      const cv::Vec3f difference =
          image.at<cv::Vec3f>(30, u) - image.at<cv::Vec3f>(from[1], from[0]);
      far += cv::norm(difference) > 30.0;
    }
    return far;
  };
  cv::Mat hole = cv::Mat::zeros(240, 320, CV_8U);
  hole(cv::Rect(100, 30, 210, 2)).setTo(255);
  EXPECT_LT(missed(hole), 20);
  hole(cv::Rect(60, 120, 50, 60)).setTo(255);  // beside one that they do show
  EXPECT_LT(missed(hole), 20);
}

TEST(PatchOrigins, HaveNoneWhereNoPatchIsWhole) {
  const cv::Mat image = grain(40, 40), hole(40, 40, CV_8U, cv::Scalar(255)),
                source = cv::Mat::zeros(40, 40, CV_8U);
  const cv::Mat origin = patchOrigins(image, hole, source, {}, {});
  EXPECT_EQ(cv::countNonZero(origin.reshape(1) != -1), 0);
}

// Also in pictures halved so often that some of the last pixels see nothing of what is known.
TEST(PushPull, CarriesTheOnlyColourEverywhere) {
  for (const int side : {2, 16, 20, 64, 100}) {
    cv::Mat image = cv::Mat::zeros(side / 2, side, CV_32FC3),
            weight = cv::Mat::zeros(image.size(), CV_32F);
    image.col(side - 1).setTo(cv::Scalar::all(100.0)), weight.col(side - 1).setTo(1.0f);
    const cv::Mat wanted(image.size(), CV_32FC3, cv::Scalar::all(100.0));
    EXPECT_LT(cv::norm(pushPull(image, weight), wanted, cv::NORM_INF), 1e-3) << side;
    weight.setTo(0.0f);  // nothing to carry
    EXPECT_TRUE(cv::checkRange(pushPull(image, weight))) << side;
  }
}

TEST(Inpaint, ContinuesWhatRepeatsItself) {
  const cv::Mat truth = repeated(spots(160, 120), 52);
  cv::Mat image = truth.clone(), hole = cv::Mat::zeros(120, 160, CV_8U);
  hole(cv::Rect(60, 40, 30, 30)).setTo(255);
  image.setTo(cv::Scalar::all(0), hole);
  const InpaintResult r = inpaint(image, hole, cv::Mat());
  EXPECT_TRUE(r.patches_found);
  EXPECT_LT(meanDifference(r.image, truth, hole), 2.0);
  EXPECT_EQ(cv::norm(r.image, image, cv::NORM_INF, hole == 0), 0.0);
}

TEST(Inpaint, CopiesComeFromTheSameSurface) {
  cv::Mat picture(96, 96, CV_32FC3), surface(96, 96, CV_8U, cv::Scalar(1)),
      hole = cv::Mat::zeros(96, 96, CV_8U);
  cv::RNG random(1);
  random.fill(picture, cv::RNG::NORMAL, 100.0, 4.0);
  picture(cv::Rect(0, 40, 96, 56)) += cv::Scalar::all(80.0);
  surface(cv::Rect(0, 56, 96, 40)) = 2;  // the paint changes elsewhere than the surface
  hole(cv::Rect(30, 20, 36, 60)) = 255;
  InpaintParams params;
  params.surface = surface;
  const InpaintResult filled = inpaint(picture, hole, cv::Mat(), params);
  int foreign = 0, copied = 0;
  for (int v = 0; v < 96; ++v) {
    for (int u = 0; u < 96; ++u) {
      const cv::Vec2s from = filled.origin.at<cv::Vec2s>(v, u);
      if (from[0] < 0) continue;
      ++copied,
          foreign += surface.at<std::uint8_t>(from[1], from[0]) != surface.at<std::uint8_t>(v, u) &&
                     std::abs(v - 56) > 3;
    }
  }
  EXPECT_GT(copied, 1000);
  EXPECT_LT(foreign, copied / 50);  // patches that lie across the border
}

// Behind the hole the one on the right goes farther than what is seen of it tells.
TEST(Inpaint, CopiesComeFromTheSurfaceThatIsHiddenThere) {
  const cv::Rect right(48, 0, 48, 96), hidden_part(34, 24, 14, 48);
  cv::Mat picture(96, 96, CV_32FC3), surface(96, 96, CV_8U, cv::Scalar(1)),
      hole = cv::Mat::zeros(96, 96, CV_8U);
  cv::RNG random(1);
  random.fill(picture, cv::RNG::NORMAL, 100.0, 4.0);
  random.fill(picture(right), cv::RNG::NORMAL, 100.0, 20.0);
  surface(right) = 2, surface(hidden_part) = 2;
  hole(cv::Rect(28, 20, 40, 56)) = 255;
  InpaintParams params;
  params.surface = surface;
  const InpaintResult filled = inpaint(picture, hole, cv::Mat(), params);
  const cv::Rect inside(hidden_part.x + 3, hidden_part.y + 3, hidden_part.width - 3,
                        hidden_part.height - 6);
  int foreign = 0;
  for (int v = inside.y; v < inside.br().y; ++v) {
    for (int u = inside.x; u < inside.br().x; ++u) {
      const cv::Vec2s from = filled.origin.at<cv::Vec2s>(v, u);
      foreign += from[0] < 0 || surface.at<std::uint8_t>(from[1], from[0]) != 2;
    }
  }
  EXPECT_LT(foreign, inside.area() / 20);
}

TEST(Inpaint, CopiesFromNoBannedPlace) {
  const cv::Mat image = grain(120, 90);
  cv::Mat hole = cv::Mat::zeros(90, 120, CV_8U), banned = cv::Mat::zeros(90, 120, CV_8U);
  hole(cv::Rect(50, 30, 20, 20)).setTo(255);
  banned(cv::Rect(0, 0, 40, 90)).setTo(255);
  const InpaintResult r = inpaint(image, hole, banned);
  for (int v = 30; v < 50; ++v) {
    for (int u = 50; u < 70; ++u) {
      const cv::Vec2s from = r.origin.at<cv::Vec2s>(v, u);
      ASSERT_GE(from[0], 40);
      ASSERT_EQ(hole.at<std::uint8_t>(from[1], from[0]), 0);
    }
  }
}

// All that is known is a border too narrow for whole patches at the coarsest level.
TEST(Inpaint, CopiesFromANarrowBorder) {
  const cv::Mat image = grain(320, 240);
  cv::Mat hole = cv::Mat::zeros(240, 320, CV_8U);
  hole(cv::Rect(25, 25, 270, 190)).setTo(255);
  EXPECT_TRUE(inpaint(image, hole, cv::Mat()).patches_found);
}

// What may be copied lies farther from the hole than that is large.
TEST(Inpaint, CopiesFromAnywhereIfItMay) {
  const cv::Mat image = grain(200, 80);
  cv::Mat hole = cv::Mat::zeros(80, 200, CV_8U), banned(80, 200, CV_8U, cv::Scalar(255));
  hole(cv::Rect(20, 30, 20, 20)).setTo(255), banned(cv::Rect(120, 0, 80, 80)).setTo(0);
  InpaintParams params;
  EXPECT_FALSE(inpaint(image, hole, banned, params).patches_found);
  params.from_anywhere = true;
  EXPECT_TRUE(inpaint(image, hole, banned, params).patches_found);
}

TEST(Inpaint, SaysWhenThereIsNothingToCopy) {
  const cv::Mat image(20, 20, CV_32FC3, cv::Scalar::all(50)), hole(20, 20, CV_8U, cv::Scalar(255));
  EXPECT_FALSE(inpaint(image, hole, cv::Mat()).patches_found);
}

}  // namespace
}  // namespace calipso::render
