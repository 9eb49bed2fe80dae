#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "calipso_render/colour.hpp"
#include "calipso_render/shadow_map.hpp"
#include "calipso_render/sky_map.hpp"
#include "draw/kernels.hpp"
#include "draw/triangle_map.hpp"
#include "frame/line_codec.hpp"
#include "frame/mask_morphology.hpp"
#include "frame/plane_light.hpp"
#include "frame/plane_sky.hpp"
#include "frame/square_mask.hpp"
#include "place/plane_view.hpp"
#include "render_test_scene.hpp"
#include "texture/mesh_topology.hpp"

namespace calipso::render {
namespace {

using namespace testing;

const Eigen::Vector3d kCentre(0.0, 0.1, 0.12);

// A light that is less around a place.
class Hollow : public Visibility {
 public:
  float visibility(const Eigen::Vector3f& p, const Eigen::Vector3f&) const override {
    return 1.0f - 0.1f / (1.0f + p.squaredNorm());
  }
  bool empty() const override { return false; }
  std::optional<float> uniform(const Eigen::Vector3f&, const Eigen::Vector3f&,
                               float) const override {
    return std::nullopt;
  }
};

// Told at the corners, the ground that is mirrored between them is off by less than it changes.
TEST(SurfaceMaps, TellTheShadeOfTheGroundThatIsMirrored) {
  const Surface surface = makeSurface(ballAt(kCentre));
  const Actor actor = makeActor(surface, surface.key_vertices, camera());
  Appearance appearance;
  appearance.key_camera = camera();
  appearance.sources.assign(surface.triangles.size(), Appearance::Source::kBoth);
  const Eigen::Vector3f eye = camera().world_from_camera.translation().cast<float>();
  const Hollow hollow;
  const ShadedGround ground(table(), Light(), {&hollow}, hollow);
  const SurfaceMaps maps(actor, appearance, Light(), ground, eye);
  const VisibilityBuffer buffer({0, 0, kWidth, kHeight}, {&actor.screen});
  int shaded = 0;
  SurfaceRun place;
  Eigen::Vector3f weights;
  forEachPixelOf(actor, [&](int u, int v, const SurfacePoint& p) {
    const Eigen::Vector3f w = mirroredIn(p.normal, (eye - p.position).normalized());
    const float lit = ground.lit(p.position, w);
    const SurfacePlace here{buffer.ids(v)[u], static_cast<float>(u), static_cast<float>(v)};
    maps.locate(&here, 1, place, &weights);
    ASSERT_NEAR(place.sky[0], skyMirrored(p.seen, w, lit), 0.04f) << u << ", " << v;
    shaded += lit < 0.92f ? 1 : 0;
  });
  EXPECT_GT(shaded, 100);
}

// Against the surface point of every pixel, of a ball that has turned and moved since the key
// frame.
TEST(SurfaceMaps, TellWhatThePixelsShow) {
  const Surface surface = makeSurface(ballAt(kCentre));
  Eigen::Isometry3d turn = Eigen::Isometry3d::Identity();
  turn.translate(kCentre + Eigen::Vector3d(0.05, 0.1, 0.02))
      .rotate(Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 2, 3).normalized()));
  const Actor actor = makeActor(surface, transformed(surface.object_vertices, turn), camera());
  Appearance appearance;
  appearance.key_camera = camera();
  appearance.sources.assign(surface.triangles.size(), Appearance::Source::kBoth);
  const Eigen::Vector3f eye = camera().world_from_camera.translation().cast<float>();
  Light light;
  light.ambient[1] = {0.1f, -0.1f, 0.2f};
  const SurfaceMaps maps(actor, appearance, light, ShadedGround(), eye);
  const PlaneView view({}, camera());
  const VisibilityBuffer buffer({0, 0, kWidth, kHeight}, {&actor.screen});
  int seen = 0;
  SurfaceRun run, place;
  Eigen::Vector3f weights;
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      const std::uint32_t id = buffer.ids(v)[u];
      if (id == VisibilityBuffer::kNothing ||
          maps.of(VisibilityBuffer::triangleOf(id)).is(TriangleMap::kThin))
        continue;
      const SurfacePoint p = surfacePoint(actor, VisibilityBuffer::triangleOf(id), u, v, eye);
      const Eigen::Vector2d key = camera().projectWorld(p.key_position.cast<double>());
      run.column[0] = static_cast<float>(u);
      const unsigned traits = kernels().locate(maps.triangles(), buffer.ids(v) + u, {v, 1, 0, {}},
                                               view.sightLines(v), run);
      ASSERT_EQ(traits, TriangleMap::kPictured | TriangleMap::kTextured);
      const SurfacePlace here{id, static_cast<float>(u), static_cast<float>(v)};
      maps.locate(&here, 1, place, &weights);
      ASSERT_LT((weights - p.weights).norm(), 2e-3f) << u << ", " << v;
      for (const SurfaceRun* r : {&run, &place}) {
        const Eigen::Vector3f n(r->normal[0][0], r->normal[1][0], r->normal[2][0]),
            sight(r->sight[0][0], r->sight[1][0], r->sight[2][0]);
        ASSERT_LT((Eigen::Vector2d(r->key_u[0], r->key_v[0]) - key).norm(), 0.01) << u << ", " << v;
        ASSERT_LT((n - p.normal).norm(), 2e-3f) << u << ", " << v;
        ASSERT_LT((sight.normalized() - (p.position - eye).normalized()).norm(), 1e-3f);
        const Eigen::Vector3f w = mirroredIn(p.normal, (eye - p.position).normalized());
        ASSERT_NEAR(r->sky[0], skyMirrored(p.seen, w), 2e-3f);
        for (int c = 0; c < 3; ++c)
          ASSERT_NEAR(r->ambient[c][0], ambientOn(light, p.seen, appearance.thrown_back)[c], 2e-3f);
      }
      ++seen;
    }
  }
  EXPECT_GT(seen, 300);
}

TEST(LineCodec, EncodesAsCodeFromLinear) {
  constexpr int kCount = 2001;
  std::vector<float> colours[5];
  for (auto& channel : colours) channel.resize(kCount + 7, 1.0f);
  std::fill(colours[4].begin(), colours[4].end(), 0.0f);
  for (int i = 0; i < kCount; ++i)
    colours[0][i] = i / 1990.0f - 0.001f, colours[1][i] = 0.3f * i / 2000.0f,
    colours[2][i] = std::nanf("");
  std::vector<cv::Vec3b> codes(kCount);
  LineCodec(NoiseModel(), 3)
      .encode({colours[0].data(), colours[1].data(), colours[2].data(), colours[3].data(),
               colours[4].data()},
              5, 7, kCount, codes.data());
  for (int i = 0; i < kCount; ++i) {
    for (int c = 0; c < 3; ++c)
      ASSERT_EQ(codes[i][c], quantise(codeFromLinear(colours[c][i]))) << i << ", " << c;
  }
}

// A surface's own grain is there where the camera's noise is less: in all but what is not fresh.
TEST(LineCodec, AddsAtLeastTheGrainOfASurface) {
  constexpr int kCount = 2000;
  std::vector<float> colours[5];
  for (auto& channel : colours) channel.resize(kCount + 7, 0.2f);
  std::fill(colours[3].begin(), colours[3].begin() + kCount / 2, 1.0f);
  std::fill(colours[3].begin() + kCount / 2, colours[3].end(), 0.0f);
  std::fill(colours[4].begin(), colours[4].end(), 4.0f);
  std::vector<cv::Vec3b> codes(kCount);
  LineCodec(NoiseModel(), 3)
      .encode({colours[0].data(), colours[1].data(), colours[2].data(), colours[3].data(),
               colours[4].data()},
              0, 0, kCount, codes.data());
  const float clean = codeFromLinear(0.2f);
  double square = 0.0;
  for (int i = 0; i < kCount / 2; ++i) square += std::pow(codes[i][1] - clean, 2);
  EXPECT_NEAR(std::sqrt(square / (kCount / 2)), 4.0, 0.6);  // half of it is alike in neighbours
  for (int i = kCount / 2; i < kCount; ++i) ASSERT_EQ(codes[i][1], quantise(clean));
}

TEST(OutsideWinding, KnowsClosedMeshesFromOpenOnes) {
  const Surface surface = makeSurface(ballAt(kCentre));
  Triangles turned = surface.triangles, open = surface.triangles, disagreeing = surface.triangles;
  for (Eigen::Vector3i& t : turned) std::swap(t[0], t[1]);
  std::swap(disagreeing[200][0], disagreeing[200][1]);
  open.erase(open.begin() + 200);
  EXPECT_EQ(std::abs(surface.winding), 1);
  EXPECT_EQ(outsideWinding(surface.object_vertices, turned), -surface.winding);
  EXPECT_EQ(outsideWinding(surface.object_vertices, open), 0);
  EXPECT_EQ(outsideWinding(surface.object_vertices, disagreeing), 0);
}

// What lies on the far side of a closed mesh is hidden by its near side: leaving it out changes
// nothing.
TEST(OutsideWinding, LeavesOutOnlyWhatIsHidden) {
  Surface surface = makeSurface(ballAt(kCentre));
  const Actor actor = makeActor(surface, surface.key_vertices, camera());
  ASSERT_NE(actor.screen.hidden_side, 0);
  ScreenMesh all = actor.screen;
  all.hidden_side = 0;
  const cv::Rect whole(0, 0, kWidth, kHeight);
  const VisibilityBuffer some(whole, {&actor.screen}), every(whole, {&all});
  int different = 0;
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) different += some.ids(v)[u] != every.ids(v)[u];
  }
  EXPECT_LE(different, 4);  // on the silhouette the two sides meet within the edges' tolerance
  const Eigen::Vector3d light(0.3, 0.2, 1.0);
  const ShadowMap with({{&actor.vertices, &surface.triangles, surface.winding}}, light,
                       {256, 0.02, 16}),
      without({{&actor.vertices, &surface.triangles}}, light, {256, 0.02, 16});
  for (float x = -0.3f; x < 0.3f; x += 0.01f)
    EXPECT_NEAR(with.visibility({x, 0.1f, 0.0f}, Eigen::Vector3f::UnitZ()),
                without.visibility({x, 0.1f, 0.0f}, Eigen::Vector3f::UnitZ()), 0.02f)
        << x;
}

// What a pixel's corners see on average; what lies beyond the planes is lit.
float seenByCorners(const PlaceView& view, const Visibility& light, int u, int v) {
  float sum = 0.0f;
  for (int k = 0; k < 4; ++k) {
    Receiver r;
    sum += view.at(u - 0.5f + (k & 1), v - 0.5f + (k >> 1), r)
               ? light.visibility(r.position, r.normal)
               : 1.0f;
  }
  return 0.25f * sum;
}

TEST(PlanesInLight, AgreesWithEveryPixelOnItsOwn) {
  const Surface surface = makeSurface(ballAt(kCentre));
  const ShadowMap sun({{&surface.key_vertices, &surface.triangles}},
                      sunlight().direction.cast<double>(), {512, 0.03, 16});
  const PlaceView view(PlaneView(table(), camera()));
  const cv::Rect rect(13, 9, 120, 101);
  cv::Mat fast(rect.size(), CV_8U, cv::Scalar(255));
  planesInLight(view, sun, rect, SquareMask(), fast);
  int shaded = 0;
  for (int v = 0; v < rect.height; ++v) {
    for (int u = 0; u < rect.width; ++u) {
      const float exact = seenByCorners(view, sun, u + rect.x, v + rect.y);
      ASSERT_NEAR(fast.at<std::uint8_t>(v, u) / 255.0f, exact, 0.16f)
          << u << ", " << v;  // half of what may lie between two places
      shaded += exact < 0.5f;
    }
  }
  EXPECT_GT(shaded, 100);
}

// Squares stand within what is set, and all those do that lie far enough inside.
TEST(SquareMask, IsTheMaskLessItsRim) {
  const cv::Rect part(13, 9, 120, 101),
      set(20, 15, 70, 95);  // which reaches the part's lower border
  cv::Mat pixels = cv::Mat::zeros(part.size(), CV_8U), eroded;
  pixels(set & cv::Rect(0, 0, part.width, part.height)).setTo(255);
  const SquareMask mask(pixels, part, 5);
  cv::erode(pixels, eroded, cv::Mat::ones(11, 11, CV_8U));
  int count = 0;
  for (int v = 0; v < part.height; ++v) {
    for (int u = 0; u < part.width; ++u) {
      const bool on = mask.at(u + part.x, v + part.y);
      count += on;
      ASSERT_TRUE(!on || eroded.at<std::uint8_t>(v, u) != 0) << u << ", " << v;
    }
  }
  EXPECT_GT(count, 70 * 95 / 3);
  EXPECT_FALSE(mask.at(part.x - 20, part.y));
  EXPECT_TRUE(mask.all({part.x + 48, part.y + 47, 16, 16}));
  EXPECT_FALSE(mask.all({part.x, part.y, 64, 64}));
  EXPECT_FALSE(SquareMask().all({0, 0, 8, 8}));
}

TEST(SquareMask, IsGrownAddedToAndTakenFromBySquares) {
  const cv::Rect part(13, 9, 120, 101);
  SquareMask mask(part), other(cv::Rect(0, 0, 300, 200));
  EXPECT_TRUE(mask.box().empty());
  mask.set({50, 40, 1, 1}), other.set({50, 40, 20, 1}), other.set({250, 150, 8, 8});
  EXPECT_EQ(mask.box(), cv::Rect(48, 40, 8, 8));
  EXPECT_EQ(mask.grown(9).box(), cv::Rect(32, 24, 40, 40));  // two squares
  mask.add(other);                                           // which has squares beyond the part
  EXPECT_EQ(mask.box(), cv::Rect(48, 40, 24, 8));
  std::vector<int> ends;
  const auto record = [&](int begin, int end) { ends.insert(ends.end(), {begin, end}); };
  mask.visitRow(43, 51, 60, record), mask.visitRow(48, 13, 133, record);
  EXPECT_EQ(ends, (std::vector<int>{51, 60}));
  SquareMask last(part);
  last.set({64, 40, 8, 8});
  mask.remove(last);
  EXPECT_EQ(mask.box(), cv::Rect(48, 40, 16, 8));
  EXPECT_FALSE(mask.all({120, 100, 40, 8}));  // none of its squares beyond the part is set
}

// A sky that a half space hides: what is seen of it rises along the table.
class HalfSky : public Visibility {
 public:
  explicit HalfSky(float rise) : rise_(rise) {}
  float visibility(const Eigen::Vector3f& p, const Eigen::Vector3f&) const override {
    return std::clamp(0.5f + rise_ * p.x(), 0.0f, 1.0f);
  }
  bool empty() const override { return false; }
  std::optional<float> uniform(const Eigen::Vector3f&, const Eigen::Vector3f&,
                               float) const override {
    return std::nullopt;
  }

 private:
  float rise_;
};

// Pixels that a sharp shadow's border crosses are shaded in part.
TEST(PlanesInLight, IsAsSoftAsAPixelWhereTheSunIsAPoint) {
  const PlaceView view(PlaneView(table(), camera()));
  const HalfSky sun(1e6f);  // from nothing to all within a micrometre
  const cv::Rect rect(13, 9, 120, 101);
  cv::Mat levels(rect.size(), CV_8U, cv::Scalar(255));
  planesInLight(view, sun, rect, SquareMask(), levels);
  int in_part = 0;
  for (int v = 0; v < rect.height; ++v) {
    for (int u = 0; u < rect.width; ++u) {
      const int level = levels.at<std::uint8_t>(v, u);
      ASSERT_NEAR(level, 255.0f * seenByCorners(view, sun, u + rect.x, v + rect.y), 1.0f);
      in_part += level > 0 && level < 255;
    }
  }
  EXPECT_GE(in_part, rect.height);
}

TEST(SkyGrid, IsWhatThePlanesSeeAndDiffersByNoMoreThanItSays) {
  const PlaneView planes(table(), camera());
  const HalfSky slow(1.0f), fast(30.0f);
  const cv::Rect rect(13, 9, 120, 101);
  const SkyGrid grid(planes, slow, {kWidth, kHeight}, rect, SquareMask()),
      steep(planes, fast, {kWidth, kHeight}, rect, SquareMask());
  std::vector<std::uint8_t> level(rect.width), other(rect.width);
  bool any_known = false;
  for (int v = rect.y; v < rect.br().y; ++v) {
    grid.levels(planes, slow, v, rect.x, rect.br().x, level.data());
    steep.levels(planes, fast, v, rect.x, rect.br().x, other.data());
    for (int i = 0; i < rect.width; ++i) {
      const int u = i + rect.x;
      Receiver r;
      if (!planes.at(u, v, r)) continue;
      const float exact = slow.visibility(r.position, r.normal);
      ASSERT_NEAR(level[i], 255.0f * skyLight(exact), 31.0f);  // an eighth may be between places
      const float most = grid.differences(steep, {u, v, 1, 1}).front();
      any_known = any_known || most < 0.5f;
      ASSERT_LE(std::abs(level[i] - other[i]), 255.0f * most + 1.0f) << u << ", " << v;
    }
  }
  EXPECT_TRUE(any_known);
}

TEST(MaskMorphology, DoesWhatOpenCVDoes) {
  cv::Mat picture(60, 90, CV_8U), expected;
  cv::RNG(5).fill(picture, cv::RNG::UNIFORM, 0, 1000);
  picture.setTo(0, picture < 253);
  for (const int radius : {1, 3, 7}) {
    const DiscDilation dilate(radius);
    cv::dilate(picture, expected,
               cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * radius + 1, 2 * radius + 1}));
    for (const cv::Rect& part :
         {cv::Rect(0, 0, 90, 60), cv::Rect(20, 10, 40, 30), cv::Rect(60, 5, 30, 55)}) {
      cv::Mat out(part.size(), CV_8U);
      dilate(picture(part), out);
      EXPECT_EQ(cv::norm(out, expected(part), cv::NORM_INF), 0.0) << radius << " " << part;
    }
  }
  cv::morphologyEx(picture, expected, cv::MORPH_OPEN, cv::Mat::ones(3, 3, CV_8U));
  ASSERT_GT(cv::countNonZero(expected), 0);
  ASSERT_GT(cv::countNonZero(expected != picture), 0);
  EXPECT_EQ(cv::norm(openedByThree(picture), expected, cv::NORM_INF), 0.0);
}

}  // namespace
}  // namespace calipso::render
