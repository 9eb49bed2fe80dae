#include "fill/line_bridge.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "calipso_render/inpaint.hpp"
#include "fill/line_ends.hpp"
#include "grain_pictures.hpp"

namespace calipso::render {
namespace {

using namespace testing;

// Dark lines over fine grain, hidden in a square.
struct Lines {
  cv::Mat image = 0.05 * grain(320, 200) + cv::Scalar::all(150.0), truth,
          hole = cv::Mat::zeros(200, 320, CV_8U);

  void line(const cv::Point& a, const cv::Point& b, int dark = 30, int width = 3) {
    cv::Mat covered(image.size(), CV_8U, cv::Scalar(0));
    cv::line(covered, a, b, cv::Scalar(255), width, cv::LINE_AA);
    image.forEach<cv::Vec3f>([&](cv::Vec3f& c, const int* at) {
      c += covered.at<std::uint8_t>(at[0], at[1]) / 255.0f * (cv::Vec3f::all(dark) - c);
    });
  }
  LineBridges bridge(const cv::Mat& surface = cv::Mat()) {
    hole(cv::Rect(110, 50, 100, 100)).setTo(255);
    truth = image.clone();
    image.setTo(cv::Scalar::all(0), hole);
    return bridgeLines(straightEdges(hole == 0, image), hole, hole == 0, surface, image);
  }
};

TEST(BridgeLines, ConnectTheTwoEndsOfALine) {
  Lines l;
  l.line({0, 80}, {319, 115});
  const LineBridges b = l.bridge();
  EXPECT_GT(cv::countNonZero(b.drawn), 700);  // nine rows of 100 px, less what the ends leave
  EXPECT_EQ(cv::countNonZero(b.drawn & (l.hole == 0)), 0);
  // Grain differs by 5 code values (12 % of 200) and a line's rim by a tenth of a pixel, which
  // are 12.
  EXPECT_LT(meanDifference(l.image, l.truth, b.drawn), 8.0);
  for (int v = 50; v < 150; ++v) {
    for (int u = 110; u < 210; ++u) {
      const cv::Vec2s from = b.origin.at<cv::Vec2s>(v, u);
      if (b.drawn.at<std::uint8_t>(v, u) != 0) {
        EXPECT_EQ(l.hole.at<std::uint8_t>(from[1], from[0]), 0);
      }
    }
  }
}

// The hole's rim runs beside the line at one of its ends, so that only farther back both of its
// sides are seen.
TEST(BridgeLines, ConnectALineThatIsSeenFromAfar) {
  Lines l;
  l.line({0, 80}, {319, 115});
  cv::fillConvexPoly(l.hole, std::vector<cv::Point>{{205, 107}, {228, 109}, {228, 130}, {205, 130}},
                     cv::Scalar(255));
  const LineBridges b = l.bridge();
  EXPECT_NE(b.core.at<std::uint8_t>(96, 150), 0);
}

// A ledge, its dark groove and the board below: the ledge's upper edge, near the groove, is no line
// of its own.
TEST(BridgeLines, TakeAlongWhatRunsBesideALine) {
  Lines l;
  const auto band = [&](float top, float bottom, float colour) {
    l.image.forEach<cv::Vec3f>([&](cv::Vec3f& c, const int* at) {
      const float v = static_cast<float>(at[0]) - 0.02f * static_cast<float>(at[1]);
      const float covered = std::clamp(v - top, 0.0f, 1.0f) * std::clamp(bottom - v, 0.0f, 1.0f);
      c += covered * (cv::Vec3f::all(colour) - c);
    });
  };
  band(80.0f, 91.0f, 195.0f), band(90.0f, 93.0f, 80.0f), band(92.0f, 120.0f, 180.0f);
  const LineBridges b = l.bridge();
  for (int u = 115; u < 205; u += 10) {
    const int top = cvRound(80.0f + 0.02f * static_cast<float>(u));
    EXPECT_NE(b.core.at<std::uint8_t>(top, u), 0) << u;
  }
  // Grain and a tenth of a pixel at edges of 60.
  EXPECT_LT(meanDifference(l.image, l.truth, b.core), 6.0);
}

// What is hidden where a line ends at the hole has nothing to say about it.
TEST(BridgeLines, DrawNothingThatIsHidden) {
  for (const int v : {70, 80, 90, 100}) {
    Lines l;
    l.line({0, v}, {319, v + 35}, 230);
    const LineBridges b = l.bridge();
    double darkest;
    cv::Mat green;
    cv::extractChannel(l.image, green, 1);
    cv::minMaxLoc(green, &darkest, nullptr, nullptr, nullptr, b.drawn);
    EXPECT_GT(darkest, 140.0) << v;  // the grain, 12.8 around 156
  }
}

// A wire, at one end before what is brighter.
TEST(BridgeLines, DrawALineAloneThatPassesBeforeOtherThings) {
  Lines l;
  for (int u = 110; u < l.image.cols; ++u)
    l.image.col(u) += cv::Scalar::all(std::min(0.7 * (u - 110), 70.0));
  l.line({0, 80}, {319, 100});
  const LineBridges b = l.bridge();
  for (int u = 112; u < 208; ++u) {
    const int v = cvRound(80.0 + 20.0 * u / 319.0);
    ASSERT_NE(b.drawn.at<std::uint8_t>(v, u), 0) << u;
    EXPECT_LT(l.image.at<cv::Vec3f>(v, u)[1], 80.0f) << u;  // the line has 30, its rim half of it
    EXPECT_EQ(b.drawn.at<std::uint8_t>(v - 3, u), 0) << u;
    EXPECT_EQ(b.drawn.at<std::uint8_t>(v + 3, u), 0) << u;
  }
}

// The joint of a pavement: the slabs on either side of it differ, and others lie at its other end.
TEST(BridgeLines, DrawAJointBetweenThingsThatDiffer) {
  Lines l;
  for (int v = 0; v < 200; ++v) {
    for (int u = 0; u < 320; ++u) {
      const bool below = v > 80 + 20 * u / 319, right = u > 160;
      const float slab = below ? (right ? 40.0f : -20.0f) : (right ? -30.0f : 60.0f);
      l.image.at<cv::Vec3f>(v, u) += cv::Vec3f::all(slab);
    }
  }
  l.line({0, 80}, {319, 100});
  const LineBridges b = l.bridge();
  for (int u = 112; u < 208; ++u) {
    const int v = cvRound(80.0 + 20.0 * u / 319.0);
    ASSERT_NE(b.before.at<std::uint8_t>(v, u), 0) << u;
    EXPECT_LT(l.image.at<cv::Vec3f>(v, u)[1], 80.0f) << u;
    EXPECT_EQ(b.drawn.at<std::uint8_t>(v - 3, u) | b.drawn.at<std::uint8_t>(v + 3, u), 0) << u;
  }
}

// A post of which nothing is known stands where the line is lost.
TEST(BridgeLines, ConnectALineThatIsHiddenBeforeItReachesTheHole) {
  Lines l;
  l.line({0, 80}, {319, 115});
  l.hole(cv::Rect(110, 50, 100, 100)).setTo(255);
  cv::Mat source = l.hole == 0;
  source.colRange(70, 112).setTo(0);
  const LineBridges b =
      bridgeLines(straightEdges(source, l.image), l.hole, source, cv::Mat(), l.image);
  EXPECT_NE(b.core.at<std::uint8_t>(96, 150), 0);
}

// A wire before a sky that brightens. The only other piece of such a wire has a bright bead.
TEST(BridgeLines, LeadNoCopiesWhereTheyPassBeforeOtherThings) {
  cv::Mat image = 0.05 * grain(320, 200) + cv::Scalar::all(110.0);
  for (int u = 110; u < image.cols; ++u)
    image.col(u) += cv::Scalar::all(std::min(0.7 * (u - 110), 70.0));
  cv::line(image, {0, 80}, {319, 100}, cv::Scalar::all(30), 3);
  cv::line(image, {60, 150}, {80, 151}, cv::Scalar::all(30), 3);
  cv::circle(image, {70, 146}, 4, cv::Scalar(0, 0, 250), cv::FILLED);
  cv::Mat hole = cv::Mat::zeros(image.size(), CV_8U);
  hole(cv::Rect(110, 50, 100, 100)).setTo(255);
  image.setTo(cv::Scalar::all(0), hole);
  const cv::Mat filled = inpaint(image, hole, cv::Mat()).image;
  EXPECT_LT(filled.at<cv::Vec3f>(90, 160)[1], 80.0f);  // the wire goes on
  cv::Mat red;
  cv::extractChannel(filled, red, 2);
  double reddest;
  cv::minMaxLoc(red, nullptr, &reddest, nullptr, nullptr, hole);
  EXPECT_LT(reddest, 220.0);  // of the brightest grain
}

TEST(BridgeLines, LeadALineToTheOneThatItMeets) {
  Lines l;
  l.line({0, 90}, {319, 90});
  l.line({150, 199}, {170, 90});
  const LineBridges b = l.bridge();
  EXPECT_LT(meanDifference(l.image, l.truth, b.drawn), 8.0);
  EXPECT_NE(b.drawn.at<std::uint8_t>(130, 163), 0);  // on the second line
  EXPECT_EQ(b.drawn.at<std::uint8_t>(70, 174), 0);   // beyond the first
}

// The gaps of a fence do not go on through the hedge that is seen above it.
TEST(BridgeLines, LeadNoLineThroughAnotherSurface) {
  Lines l;
  l.line({0, 90}, {319, 90});
  l.line({150, 199}, {170, 90});
  cv::Mat surface(l.image.size(), CV_8U, cv::Scalar(2));
  surface.rowRange(0, 120).setTo(1);
  const LineBridges b = l.bridge(surface);
  EXPECT_NE(b.drawn.at<std::uint8_t>(90, 140), 0);
  EXPECT_EQ(b.drawn.at<std::uint8_t>(130, 163), 0);
}

// A joint between two boards, before the right end of which a curtain hangs.
struct JointAtCurtain : Lines {
  cv::Mat boards = cv::Mat(200, 320, CV_8U, cv::Scalar(255));

  LineBridges bridge(const cv::Rect& curtain) {
    line({0, 100}, {curtain.x, 100});
    hole(cv::Rect(110, 50, curtain.x - 110, 100)).setTo(255);
    boards.setTo(0, hole), boards(curtain).setTo(0);
    image.setTo(cv::Scalar::all(0), hole);
    return bridgeLines(straightEdges(boards, image), hole, boards, cv::Mat(), image);
  }
};

TEST(BridgeLines, LeadALineToWhereItsSurfaceEnds) {
  JointAtCurtain l;
  const LineBridges b = l.bridge({180, 0, 140, 200});
  for (int u = 112; u < 178; ++u) {
    ASSERT_NE(b.drawn.at<std::uint8_t>(100, u), 0) << u;
    EXPECT_LT(l.image.at<cv::Vec3f>(100, u)[1], 60.0f) << u;
  }
  EXPECT_EQ(cv::countNonZero(b.drawn & (l.hole == 0)), 0);
}

TEST(BridgeLines, LeadNoLineFartherThanItIsSeen) {
  JointAtCurtain l;
  l.boards.colRange(0, 90).setTo(0);
  EXPECT_EQ(cv::countNonZero(l.bridge({180, 0, 140, 200}).drawn), 0);
}

// A broad line, of which both edges are found, goes on through what is faint to one of its like,
// whole and no further.
TEST(BridgeLines, LeadABroadLineThroughAFaintOne) {
  Lines l;
  l.line({0, 115}, {319, 115}, 118);
  l.line({150, 199}, {170, 80}, 30, 4);
  l.line({0, 80}, {319, 80});
  const LineBridges b = l.bridge();
  for (int v = 82; v < 150; ++v) {
    const int u = cvRound(150.0 + 20.0 * (199 - v) / 119.0);
    ASSERT_NE(b.drawn.at<std::uint8_t>(v, u), 0) << v;
    EXPECT_LT(l.image.at<cv::Vec3f>(v, u)[1], 70.0f) << v;
  }
  EXPECT_EQ(b.drawn.at<std::uint8_t>(72, 171), 0);
}

TEST(BridgeLines, LeaveALineThatHasNoOtherEnd) {
  Lines l;
  l.line({0, 90}, {160, 100});
  EXPECT_EQ(cv::countNonZero(l.bridge().drawn), 0);
}

TEST(BridgeLines, LeaveLinesOfDifferentColour) {
  Lines l;
  l.line({0, 100}, {160, 100}, 30);
  l.line({160, 100}, {319, 100}, 255);
  EXPECT_EQ(cv::countNonZero(l.bridge().drawn), 0);
}

// A wall's top before trees.
TEST(BridgeLines, ConnectAThingsEdgeBeforeTexture) {
  Lines l;
  cv::Mat texture = l.image.rowRange(0, 100);
  texture = 0.8 * grain(320, 100);
  cv::GaussianBlur(texture, texture, {}, 1.0);
  cv::multiply(texture - cv::Scalar::all(96.0), cv::Scalar::all(2.5), texture);
  texture += cv::Scalar::all(80.0);
  l.image.rowRange(100, 200) += cv::Scalar::all(50.0);
  const LineBridges b = l.bridge();
  for (int u = 112; u < 208; ++u) {
    ASSERT_NE(b.core.at<std::uint8_t>(100, u), 0) << u;
    EXPECT_GT(l.image.at<cv::Vec3f>(101, u)[1], 180.0f) << u;
    EXPECT_LT(l.image.at<cv::Vec3f>(98, u)[1], 180.0f) << u;
  }
}

TEST(BridgeLines, LeaveTextureOfManyLines) {
  Lines l;
  for (int v = 4; v < 200; v += 9) l.line({0, v}, {319, v}, 60);
  EXPECT_EQ(cv::countNonZero(l.bridge().drawn), 0);
}

// A floor, of other tiles on the right, ends at a wall in a dark gap; the labels have the border four
// pixels too high.
struct FloorAndWall {
  Lines l;
  cv::Mat surface{200, 320, CV_8U, cv::Scalar(1)};

  FloorAndWall() {
    l.image.rowRange(100, 200) -= cv::Scalar::all(90.0);
    l.image(cv::Rect(170, 100, 150, 100)) += cv::Scalar::all(70.0);
    l.line({0, 99}, {319, 99}, 20);
    surface.rowRange(0, 95) = 2;
    l.hole(cv::Rect(110, 50, 100, 100)).setTo(255);
    l.image.setTo(cv::Scalar::all(0), l.hole);
  }
  LineBridges bridge() {
    return bridgeBorders(straightEdges(l.hole == 0, l.image), l.hole, l.hole == 0, surface,
                         l.image);
  }
};

TEST(BridgeBorders, LeadAnEdgeBetweenSurfacesThroughOfWhichOneSideChanges) {
  FloorAndWall place;
  EXPECT_EQ(cv::countNonZero(place.l.bridge(place.surface).drawn), 0);  // as lines alone are told
  FloorAndWall again;
  const LineBridges b = again.bridge();
  for (int u = 112; u < 208; ++u) {
    ASSERT_NE(b.core.at<std::uint8_t>(99, u), 0) << u;
    EXPECT_LT(again.l.image.at<cv::Vec3f>(99, u)[1], 60.0f) << u;
    EXPECT_GT(again.l.image.at<cv::Vec3f>(96, u)[1], 110.0f) << u;
  }
}

TEST(BridgeBorders, TellWhereTheSurfacesMeet) {
  FloorAndWall place;
  place.bridge();
  for (int u = 112; u < 208; ++u) {
    EXPECT_EQ(place.surface.at<std::uint8_t>(97, u), 2) << u;
    EXPECT_EQ(place.surface.at<std::uint8_t>(102, u), 1) << u;
  }
  EXPECT_EQ(place.surface.at<std::uint8_t>(97, 100), 2);  // beside the hole, too
}

// A coping that lies almost in the plane of the wall below it: labels of both.
TEST(BridgeBorders, LieWhereTheyAreSeenThoughLabelsWaverBesideTheHole) {
  Lines l;
  l.image.rowRange(100, 200) -= cv::Scalar::all(90.0);
  cv::Mat surface(l.image.size(), CV_8U, cv::Scalar(InpaintParams::kNoPlane));
  surface.rowRange(100, 200) = 1, surface(cv::Rect(110, 96, 100, 4)) = 1;
  for (int v = 80; v < 100; ++v) {
    for (int u = 210; u < 320; u += 1 + v % 2) surface.at<std::uint8_t>(v, u) = 1;
  }
  l.hole(cv::Rect(110, 50, 100, 100)).setTo(255);
  l.image.setTo(cv::Scalar::all(0), l.hole);
  const LineBridges b =
      bridgeBorders(straightEdges(l.hole == 0, l.image), l.hole, l.hole == 0, surface, l.image);
  for (int u = 112; u < 208; ++u) {
    EXPECT_NE(b.core.at<std::uint8_t>(99, u) & b.core.at<std::uint8_t>(100, u), 0) << u;
    EXPECT_EQ(surface.at<std::uint8_t>(98, u), InpaintParams::kNoPlane) << u;
    EXPECT_EQ(surface.at<std::uint8_t>(101, u), 1) << u;
  }
}

TEST(BridgeBorders, LeaveEdgesWithinASurface) {
  FloorAndWall place;
  place.surface = 1;
  EXPECT_EQ(cv::countNonZero(place.bridge().drawn), 0);
}

// A strip of water (2) between the sky (7) and a rough rock of many surfaces, behind a tower of which
// only guesses are known.
TEST(BridgeBorders, LeadAHorizonOverAStripBeforeARoughRock) {
  Lines l;
  constexpr int kHorizon = 80, kRock = 88;
  cv::Mat surface(l.image.size(), CV_8U, cv::Scalar(InpaintParams::kNoPlane));
  cv::RNG rng(3);
  for (int v = 0; v < l.image.rows; ++v) {
    for (int u = 0; u < l.image.cols; ++u) {
      const bool rock = v >= kRock, water = v >= kHorizon && !rock;
      const double grey = rock ? 90.0 + rng.gaussian(20.0) : water ? 170.0 : 210.0;
      l.image.at<cv::Vec3f>(v, u) = cv::Vec3f::all(static_cast<float>(grey));
      surface.at<std::uint8_t>(v, u) = rock ? 3 + u / 40 % 2 : water ? 2 : 7;
    }
  }
  l.hole(cv::Rect(110, 50, 100, 100)).setTo(255);
  surface.setTo(InpaintParams::kNoPlane, l.hole);
  l.image.setTo(cv::Scalar::all(0), l.hole);
  const LineBridges b =
      bridgeBorders(straightEdges(l.hole == 0, l.image), l.hole, l.hole == 0, surface, l.image);
  const cv::Rect hole = cv::boundingRect(l.hole);
  ASSERT_TRUE(hole.y < kHorizon - 4 && hole.br().y > kRock + 4);
  for (int u = hole.x; u < hole.br().x; ++u) {
    ASSERT_NE(b.core.at<std::uint8_t>(kHorizon, u), 0) << u;
    EXPECT_GT(l.image.at<cv::Vec3f>(kHorizon - 3, u)[0], 200.0f) << u;
    EXPECT_NEAR(l.image.at<cv::Vec3f>(kHorizon + 3, u)[0], 170.0f, 8.0f) << u;
    EXPECT_EQ(surface.at<std::uint8_t>(kHorizon - 5, u), 7) << u;
    EXPECT_EQ(surface.at<std::uint8_t>(kHorizon + 5, u), 2) << u;
  }
}

cv::Mat loneLinesOf(const Lines& l) {
  const cv::Mat all(l.image.size(), CV_8U, cv::Scalar(255));
  return loneLines(straightEdges(all, l.image), all, l.image);
}

TEST(LoneLines, AreLongAndThinAlsoWhereTheyAreFaint) {
  Lines l;
  l.line({0, 80}, {200, 80}, 250);
  l.line({201, 80}, {319, 80}, 175);
  const cv::Mat lone = loneLinesOf(l);
  EXPECT_NE(lone.at<std::uint8_t>(80, 100), 0);
  EXPECT_NE(lone.at<std::uint8_t>(80, 280), 0);
  EXPECT_EQ(cv::countNonZero(lone.rowRange(90, 200)), 0);
}

TEST(LoneLines, AreNeitherTextureNorEdgesNorFaintAlone) {
  Lines texture, edge, faint;
  for (int v = 4; v < 200; v += 9) texture.line({0, v}, {319, v}, 60);
  edge.image.rowRange(100, 200) += cv::Scalar::all(60.0);
  faint.line({0, 80}, {319, 80}, 175);
  for (const Lines* l : {&texture, &edge, &faint}) EXPECT_EQ(cv::countNonZero(loneLinesOf(*l)), 0);
}

}  // namespace
}  // namespace calipso::render
