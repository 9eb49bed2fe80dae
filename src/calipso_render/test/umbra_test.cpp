// How dark shadows are told to be, surface by surface.

#include "place/umbra.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "ball_setting.hpp"
#include "calipso_render/colour.hpp"
#include "calipso_render/shadow_map.hpp"
#include "calipso_render/sky_map.hpp"
#include "test_room.hpp"

namespace calipso::render {
namespace {

using namespace testing;

const cv::Vec3f kUmbra(0.6f, 0.5f, 0.45f);

// What a camera sees of the table, which camera() sees as in the plate, in the shade of a ball that
// is moved by x.
View viewOfShade(const Surface& surface, float x, const Camera& from, const cv::Mat& plate) {
  Points vertices = surface.key_vertices;
  for (Eigen::Vector3f& p : vertices) p.x() += x;
  View view{plate.clone(),
            cv::Mat::zeros(kHeight, kWidth, CV_8U),
            from,
            {makeActor(surface, vertices, from)}};
  cv::Mat places(kHeight, kWidth, CV_32FC2, cv::Scalar::all(-1.0)), shade(plate.size(), CV_32FC3);
  const std::vector<Occluder> occluder = {{&view.actors[0].vertices, &surface.triangles}};
  const ShadowMap sun(occluder, sunlight().direction.cast<double>(), {512, 0.025, 16});
  const SkyMap sky(occluder, Eigen::Vector3d::UnitZ(), {256});
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      const auto r = receiverAt(table(), from, u, v);
      if (!r) continue;
      const Eigen::Vector2d place = camera().projectWorld(r->position.cast<double>());
      places.at<cv::Vec2f>(v, u) = {static_cast<float>(place.x()), static_cast<float>(place.y())};
      const float part = sun.visibility(r->position, r->normal),
                  open = sky.visibility(r->position, r->normal);
      for (int c = 0; c < 3; ++c)
        shade.at<cv::Vec3f>(v, u)[c] = kUmbra[c] * skyLight(open) + (1.0f - kUmbra[c]) * part;
    }
  }
  cv::remap(linearFromRealCodes(plate), view.picture, places, {}, cv::INTER_LINEAR);
  view.picture = view.picture.mul(shade);
  for (cv::Vec3f& x : cv::Mat_<cv::Vec3f>(view.picture))
    x = {codeFromLinear(x[0]), codeFromLinear(x[1]), codeFromLinear(x[2])};
  return view;
}

const Relief kNoRelief;

struct SeenTable {
  Background seen;
  UmbraSurfaces surfaces{table(), kNoRelief, camera()};
  Surface ball = makeSurface(ballAt({0.0, 0.1, kBallRadius}));

  SeenTable() {
    emptyTable().convertTo(seen.plate, CV_32F);
    seen.count = cv::Mat(kHeight, kWidth, CV_8U, cv::Scalar(9)),
    seen.spread = cv::Mat::zeros(kHeight, kWidth, CV_32F);
  }
  static std::optional<Receiver> at(int u, int v) { return receiverAt(table(), camera(), u, v); }
  SeenUmbra in(const std::vector<View>& views, const Visibility& unseen = UnseenShade()) const {
    return umbraAt(surfaces.shadedInViews(views, at, seen, sunlight(), unseen));
  }
};

// Of an object that moves: from the places that it shades in the views, against what was seen of
// them; also before a moving camera, where the key frame shows nothing of it.
TEST(Umbra, IsToldFromWhatTheViewsObjectsShade) {
  const SeenTable t;
  Camera moved = camera();
  moved.world_from_camera.translation() += Eigen::Vector3d(0.1, 0.0, 0.05);
  for (const Camera& further : {camera(), moved}) {
    std::vector<View> views = {viewOfShade(t.ball, -0.1f, camera(), t.seen.plate),
                               viewOfShade(t.ball, 0.15f, further, t.seen.plate)};
    views[0].labels.setTo(kBallLabel);
    const auto found = t.in(views).umbra;
    ASSERT_TRUE(found);
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR((*found)[c], kUmbra[c], 0.03f) << c;  // the maps have other resolutions
  }
}

TEST(Umbra, IsRefutedWhereNoShadowIsSeen) {
  const SeenTable t;
  const View unshaded{t.seen.plate, cv::Mat::zeros(kHeight, kWidth, CV_8U), camera(),
                      viewOfShade(t.ball, -0.1f, camera(), t.seen.plate).actors};
  const SeenUmbra none = t.in({unshaded, unshaded});
  EXPECT_FALSE(none.umbra);
  EXPECT_TRUE(none.refuted);
  // Unless something else keeps the sun off the place anyhow.
  const cv::Mat all(kHeight, kWidth, CV_8U, cv::Scalar(255));
  cv::Mat left = all.clone();
  left.colRange(kWidth / 2, kWidth).setTo(0);
  const UnseenShade unseen(left, all, SeenTable::at, sunlight().direction);
  const View shaded = viewOfShade(t.ball, 0.15f, camera(), t.seen.plate);
  const SeenUmbra right = t.in({unshaded, unshaded, unshaded, shaded, shaded}, unseen);
  ASSERT_TRUE(right.umbra);
  EXPECT_NEAR((*right.umbra)[1], kUmbra[1], 0.03f);
}

// All colours tell a shadow, or none: one alone would tint it.
TEST(Umbra, IsToldOnlyWhereAllColoursAreDarker) {
  const cv::Mat plate(20, 20, CV_32FC3, cv::Scalar::all(150)), dark(20, 20, CV_32F, cv::Scalar(0)),
      open(20, 20, CV_32F, cv::Scalar(1)), labels = cv::Mat::zeros(20, 20, CV_8U);
  const auto seen = [&](const cv::Vec3f& ratio) {
    const float lit = linearFromRealCode(150.0f);
    cv::Scalar codes;
    for (int c = 0; c < 3; ++c) codes[c] = codeFromLinear(ratio[c] * lit);
    return umbraAt(
        shadedInPicture(cv::Mat(plate.size(), CV_32FC3, codes), plate, dark, open, labels));
  };
  const cv::Vec3f darker(0.5f, 0.4f, 0.3f);
  ASSERT_TRUE(seen(darker).umbra);
  EXPECT_LT(cv::norm(*seen(darker).umbra - darker), 0.01);
  EXPECT_FALSE(seen({1.05f, 0.8f, 0.95f}).umbra);
}

// A floor and a wall: a support plane, too, or found in the depth image.
struct UmbraOfRoom : ::testing::Test {
  Relief relief = findRelief(Room().surfaces(), kSun);
  Light light;  // even ambient light
  const cv::Rect on_wall{110, 20, 20, 20}, on_floor{10, 90, 20, 20};
  const cv::Vec3f shared{0.5f, 0.5f, 0.5f};
  cv::Mat plate = cv::Mat(kHigh, kWide, CV_32FC3, cv::Scalar::all(0.5));

  UmbraOfRoom() { light.direction = kSun; }

  static std::vector<SupportPlane> floorAndWall() {
    SupportPlane wall;
    wall.normal = -Eigen::Vector3d::UnitY(), wall.offset = -kWallAway;
    return {floorPlane().front(), wall};
  }
  static void shade(const cv::Rect& where, const cv::Vec3f& umbra, std::vector<ShadedSpot>& spots) {
    const cv::Vec3f lit(0.4f, 0.5f, 0.6f);
    for (int v = where.y; v < where.br().y; ++v) {
      for (int u = where.x; u < where.br().x; ++u) spots.push_back({{u, v}, lit, umbra.mul(lit)});
    }
  }
  static void expectUmbra(const cv::Mat& found, const cv::Vec3f& umbra, const cv::Point& at) {
    const cv::Vec4b& levels = found.at<cv::Vec4b>(at);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(levels[c], 255.0f * umbra[c], 0.51f) << c;
    EXPECT_NEAR(levels[3], 255.0f * luminance(umbra), 0.51f);
  }
};

TEST_F(UmbraOfRoom, IsEachSupportPlanesOwn) {
  const cv::Vec3f floor(0.5f, 0.4f, 0.35f), wall(0.25f, 0.2f, 0.15f);
  std::vector<ShadedSpot> spots;
  shade(on_floor, floor, spots), shade(on_wall, wall, spots);
  const cv::Mat found = UmbraSurfaces(floorAndWall(), kNoRelief, roomCamera())
                            .umbra(spots, false, shared, light, plate);
  expectUmbra(found, floor, {80, 110});
  expectUmbra(found, wall, {25, 20});
  int edge = 0;
  while (isWall(edge)) ++edge;
  expectUmbra(found, wall, {80, edge});  // the darker, as which is seen is not sure
}

TEST_F(UmbraOfRoom, IsMeasuredOnWalls) {
  const cv::Vec3f wall(0.3f, 0.3f, 0.3f);
  std::vector<ShadedSpot> spots;
  shade(on_wall, wall, spots);
  expectUmbra(
      UmbraSurfaces(floorPlane(), relief, roomCamera()).umbra(spots, false, shared, light, plate),
      wall, {25, 20});
}

TEST_F(UmbraOfRoom, IsTheSharedOneOnSupportsThatShowNoShade) {
  const cv::Vec3f wall(0.25f, 0.2f, 0.15f);
  std::vector<ShadedSpot> spots;
  shade({110, 20, 5, 5}, {0.8f, 0.8f, 0.8f}, spots);  // too few
  const UmbraSurfaces surfaces(floorAndWall(), kNoRelief, roomCamera());
  expectUmbra(surfaces.umbra(spots, false, shared, light, plate), shared, {25, 20});
  shade(on_wall, wall, spots);
  shade(on_floor, {1.0f, 1.0f, 1.0f}, spots);  // it is not there
  const cv::Mat found = surfaces.umbra(spots, false, shared, light, plate);
  expectUmbra(found, wall, {25, 20});
  expectUmbra(found, shared, {80, 110});
}

// Dark and bright tiles, on which gloss adds the same in the shade.
TEST_F(UmbraOfRoom, LeavesWhatGlossAdds) {
  const cv::Vec3f part(0.4f, 0.3f, 0.25f);
  const float gloss = 0.02f;
  const auto spotsOn = [&](float dark, float bright) {
    std::vector<ShadedSpot> spots;
    for (int v = on_floor.y; v < on_floor.br().y; ++v) {
      for (int u = on_floor.x; u < on_floor.br().x; ++u) {
        const cv::Vec3f lit = cv::Vec3f::all((u / 4 + v / 4) % 2 == 0 ? dark : bright);
        spots.push_back({{u, v}, lit, part.mul(lit) + cv::Vec3f::all(gloss)});
      }
    }
    return spots;
  };
  const cv::Point dark_place(80, 110), bright_place(90, 110);
  plate.at<cv::Vec3f>(dark_place) = cv::Vec3f::all(0.1f),
  plate.at<cv::Vec3f>(bright_place) = cv::Vec3f::all(0.8f);
  const UmbraSurfaces surfaces(floorPlane(), kNoRelief, roomCamera());
  const cv::Mat found = surfaces.umbra(spotsOn(0.1f, 0.6f), true, shared, light, plate);
  expectUmbra(found, part + cv::Vec3f::all(gloss / 0.1f), dark_place);
  expectUmbra(found, part + cv::Vec3f::all(gloss / 0.8f), bright_place);
  // Tiles much alike do not tell it, nor does what is filled in the light.
  for (const bool seen_lit : {true, false}) {
    const std::vector<ShadedSpot> spots = seen_lit ? spotsOn(0.4f, 0.5f) : spotsOn(0.1f, 0.6f);
    const cv::Mat even = surfaces.umbra(spots, seen_lit, shared, light, plate);
    EXPECT_EQ(even.at<cv::Vec4b>(dark_place), even.at<cv::Vec4b>(bright_place));
  }
}

// What is darker beside an even ratio than it says is no gloss.
TEST_F(UmbraOfRoom, OfWhatIsMattIsOneRatio) {
  std::vector<ShadedSpot> spots;
  for (int u = 10; u < 110; ++u) {
    const cv::Vec3f lit = cv::Vec3f::all(u < 60 ? 0.1f : 0.6f);
    spots.push_back(
        {{u, 110}, lit, cv::Vec3f(0.4f, 0.3f, 0.25f).mul(lit) - cv::Vec3f(0.01f, 0, 0)});
  }
  EXPECT_FALSE(glossyUmbra(spots));
}

// As much sun as ambient light on the floor; on the wall it comes under another angle.
TEST_F(UmbraOfRoom, FollowsFromTheSharedOneOnWallsThatShowNoShade) {
  const UmbraSurfaces surfaces(floorPlane(), relief, roomCamera());
  const float wall = 1.0f / (1.0f + -kSun.y() / kSun.z());
  expectUmbra(surfaces.umbra({}, false, shared, light, plate), {wall, wall, wall}, {25, 20});
}

// Under a sky without a sun all is left, whatever makes walls darker.
TEST_F(UmbraOfRoom, IsAllOfItOnWallsWithoutASun) {
  light.sun = cv::Vec3f(0, 0, 0);
  for (const float left : {0.3f, 1.0f}) {
    std::vector<ShadedSpot> spots;
    shade(on_wall, cv::Vec3f::all(left), spots);
    const UmbraSurfaces surfaces(floorPlane(), relief, roomCamera());
    expectUmbra(surfaces.umbra(spots, false, shared, light, plate), {1, 1, 1}, {25, 20});
  }
}

// What stands before a support plane, which the depth image shows, does not tell of that.
TEST_F(UmbraOfRoom, SharesWhatIsSeenOnSupportsAlone) {
  std::vector<ShadedSpot> spots;
  shade(on_floor, shared, spots), shade(on_wall, {0.2f, 0.2f, 0.2f}, spots);
  shade(on_wall, {0.2f, 0.2f, 0.2f}, spots);
  const UmbraSurfaces surfaces(floorAndWall(), relief, roomCamera());
  const auto found = umbraAt(surfaces.onSupports(spots)).umbra;
  ASSERT_TRUE(found);
  EXPECT_LT(cv::norm(*found - shared), 1e-4);
}

}  // namespace
}  // namespace calipso::render
